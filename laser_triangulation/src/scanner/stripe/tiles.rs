//! The blurred image, computed only where it can exceed the threshold.
//!
//! A blurred sample exceeds a threshold only if some sample under the kernel does, because the weights sum to one. The
//! maximum of a tile of raw samples therefore decides *exactly* whether blurring near it can be skipped. Finding those
//! maxima reads the image once; everything after it grows with the stripe, not with the frame.

use super::{
    blur::{Sample, UNITS},
    segment::Regions,
    tile_blur::{BlurInput, COLUMNS, ROWS, TileBlur},
};
use crate::scanner::channel::Plane;
use fearless_simd::Simd;
use std::ops::Range;

/// Blurred samples of the tiles near bright pixels. Keeps its buffers between frames.
#[derive(Debug)]
pub(super) struct BlurredTiles<S: Sample> {
    width: usize,
    height: usize,
    /// Tiles per row of tiles.
    across: usize,
    /// True for each tile that holds a raw sample above the threshold.
    hot: Vec<bool>,
    /// True for each tile that has been blurred.
    blurred: Vec<bool>,
    /// Blurred samples, row by row; only those in blurred tiles belong to this frame.
    samples: Vec<S::Sum>,
    tile: TileBlur<S>,
    /// Largest samples of one row of tiles, column by column.
    maxima: Vec<[S; COLUMNS]>,
}

/// A row of pixels and the tiles that it crosses.
#[derive(Clone, Copy)]
struct TileRow<'a> {
    /// Row of the image.
    y: usize,
    /// True for each tile that has been blurred.
    tiles: &'a [bool],
}

impl<S: Sample> Default for BlurredTiles<S> {
    fn default() -> Self {
        Self {
            width: 0,
            height: 0,
            across: 0,
            hot: Vec::new(),
            blurred: Vec::new(),
            samples: Vec::new(),
            tile: TileBlur::default(),
            maxima: Vec::new(),
        }
    }
}

impl<S: Sample> BlurredTiles<S> {
    /// Blurs every tile of the frame that can contain a blurred sample above `threshold` (blurred units); without a
    /// threshold, every tile.
    #[inline(always)]
    pub(super) fn compute<V: Simd>(
        &mut self,
        vectors: V,
        input: BlurInput<'_, S>,
        threshold: Option<u32>,
    ) {
        let BlurInput { plane, kernel } = input;
        self.resize(plane.width, plane.height);
        if let Some(threshold) = threshold {
            self.find_hot(vectors, plane, threshold);
            self.spread(kernel.radius());
        } else {
            self.blurred.fill(true);
        }
        for tile_row in 0..self.blurred.len() / self.across {
            let row = tile_row * self.across..(tile_row + 1) * self.across;
            if !self.blurred[row.clone()].contains(&true) {
                continue;
            }
            for tile in row {
                if self.blurred[tile] {
                    self.blur(vectors, input, tile);
                }
            }
        }
    }

    /// Adds the runs of blurred samples above `threshold` to `regions`.
    #[inline(always)]
    pub(super) fn segment<V: Simd>(&self, vectors: V, threshold: u32, regions: &mut Regions) {
        regions.clear();
        let threshold = S::narrow(threshold);
        for (tile_row, tiles) in self.blurred.chunks_exact(self.across).enumerate() {
            let some = tiles.contains(&true);
            for y in tile_row * ROWS..((tile_row + 1) * ROWS).min(self.height) {
                regions.start_row();
                if some {
                    self.segment_row(vectors, TileRow { y, tiles }, threshold, regions);
                }
            }
        }
    }

    #[inline(always)]
    fn segment_row<V: Simd>(
        &self,
        vectors: V,
        TileRow { y, tiles }: TileRow<'_>,
        threshold: S::Sum,
        regions: &mut Regions,
    ) {
        let row = self.row(y);
        // Start of the open run.
        let mut start = None;
        for (tile, _) in tiles.iter().enumerate().filter(|&(_, &is_blurred)| is_blurred) {
            let x = tile * COLUMNS;
            let mask = if let Some(sums) = row[x..].first_chunk() {
                S::above(vectors, sums, threshold)
            } else {
                let mut sums = [S::Sum::default(); COLUMNS];
                sums[..row.len() - x].copy_from_slice(&row[x..]);
                S::above(vectors, &sums, threshold)
            };
            // Bits that differ from their predecessor: where runs begin and end.
            let mut changes = mask ^ (mask << 1 | u64::from(start.is_some()));
            while changes != 0 {
                let at = (x + changes.trailing_zeros() as usize) as u32;
                start = match start {
                    None => Some(at),
                    Some(start) => {
                        regions.push(y as u32, start, at);
                        None
                    }
                };
                changes &= changes - 1;
            }
            // After a blurred tile without a blurred successor, and at the end of the row, a run ends.
            if let Some(begun) = start
                && tiles.get(tile + 1) != Some(&true)
            {
                regions.push(y as u32, begun, (x + COLUMNS).min(row.len()) as u32);
                start = None;
            }
        }
    }

    /// Returns the blurred sample at a pixel of a blurred tile.
    pub(super) fn known(&self, x: usize, y: usize) -> u32 {
        self.samples[y * self.width + x].into()
    }

    /// Blurs the tiles that hold the pixels of these columns and rows, unless they are already blurred.
    #[inline(always)]
    pub(super) fn ensure<V: Simd>(
        &mut self,
        vectors: V,
        input: BlurInput<'_, S>,
        xs: Range<usize>,
        ys: Range<usize>,
    ) {
        for tile_y in ys.start / ROWS..ys.end.div_ceil(ROWS) {
            for tile_x in xs.start / COLUMNS..xs.end.div_ceil(COLUMNS) {
                let tile = tile_y * self.across + tile_x;
                if !std::mem::replace(&mut self.blurred[tile], true) {
                    self.blur(vectors, input, tile);
                }
            }
        }
    }

    #[inline(always)]
    fn blur<V: Simd>(&mut self, vectors: V, input: BlurInput<'_, S>, tile: usize) {
        let origin = (tile % self.across * COLUMNS, tile / self.across * ROWS);
        self.tile.blur(vectors, input, origin, &mut self.samples);
    }

    /// Returns the number of columns.
    pub(super) const fn width(&self) -> usize {
        self.width
    }

    /// Returns all samples for modification, row by row; only those in blurred tiles belong to this frame.
    pub(super) fn samples_mut(&mut self) -> &mut [S::Sum] {
        &mut self.samples
    }

    /// Returns the blurred samples of row `y`; only those in blurred tiles belong to this frame.
    #[inline(always)]
    pub(super) fn row(&self, y: usize) -> &[S::Sum] {
        &self.samples[y * self.width..][..self.width]
    }

    /// Returns all rows from `y` on.
    #[inline(always)]
    pub(super) fn rows_from(&self, y: usize) -> &[S::Sum] {
        &self.samples[y * self.width..]
    }

    fn resize(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) {
            return;
        }
        (self.width, self.height) = (width, height);
        self.across = width.div_ceil(COLUMNS);
        let tiles = self.across * height.div_ceil(ROWS);
        self.hot.resize(tiles, false);
        self.maxima.resize(self.across, [S::default(); COLUMNS]);
        self.blurred.resize(tiles, false);
        self.samples.resize(width * height, S::Sum::default());
    }

    /// Reads the whole image, once.
    #[inline(always)]
    fn find_hot<V: Simd>(&mut self, vectors: V, plane: &Plane<'_, S>, threshold: u32) {
        let limit = threshold / UNITS;
        let Self { hot, maxima, across, .. } = self;
        for (tile_row, hot) in hot.chunks_exact_mut(*across).enumerate() {
            let rows = tile_row * ROWS..((tile_row + 1) * ROWS).min(plane.height);
            // Most rows are dark; a plain maximum is the fastest test.
            let is_dark = |y| Into::<u32>::into(maximum(plane.row(y))) <= limit;
            if rows.clone().all(is_dark) {
                hot.fill(false);
                continue;
            }
            maxima.fill([S::default(); COLUMNS]);
            // Row by row, because sequential memory access is fastest.
            for y in rows {
                let row = plane.row(y);
                let (tiles, rest) = row.as_chunks();
                for (maxima, tile) in maxima.iter_mut().zip(tiles) {
                    S::raise(vectors, maxima, tile);
                }
                if let (false, Some(last)) = (rest.is_empty(), maxima.last_mut()) {
                    raise_last(vectors, last, row);
                }
            }
            for (hot, maxima) in hot.iter_mut().zip(maxima.iter()) {
                *hot = S::some_above(vectors, maxima, limit);
            }
        }
    }

    /// Marks the tiles that the kernel can reach from a hot one.
    #[inline(always)]
    fn spread(&mut self, radius: usize) {
        let down = self.hot.len() / self.across;
        let (reach_x, reach_y) = (radius.div_ceil(COLUMNS), radius.div_ceil(ROWS));
        self.blurred.fill(false);
        for tile_y in 0..down {
            if !self.hot[tile_y * self.across..(tile_y + 1) * self.across].contains(&true) {
                continue;
            }
            for tile_x in 0..self.across {
                if !self.hot[tile_y * self.across + tile_x] {
                    continue;
                }
                let xs = tile_x.saturating_sub(reach_x)..(tile_x + reach_x + 1).min(self.across);
                for y in tile_y.saturating_sub(reach_y)..(tile_y + reach_y + 1).min(down) {
                    self.blurred[y * self.across + xs.start..y * self.across + xs.end].fill(true);
                }
            }
        }
    }
}

/// Returns the largest sample of a row.
#[inline(always)]
fn maximum<S: Sample>(row: &[S]) -> S {
    row.iter().fold(S::default(), |maximum, &sample| maximum.max(sample))
}

/// Returns the maximum of a row's last, incomplete tile. It includes samples before it, which its neighbour counts too.
/// An unnecessarily hot tile costs time but changes nothing.
#[inline(always)]
fn raise_last<S: Sample, V: Simd>(vectors: V, maxima: &mut [S; COLUMNS], row: &[S]) {
    if let Some(tile) = row.last_chunk() {
        S::raise(vectors, maxima, tile);
    } else {
        let mut tile = [S::default(); COLUMNS];
        tile[..row.len()].copy_from_slice(row);
        S::raise(vectors, maxima, &tile);
    }
}
