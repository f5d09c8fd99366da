//! The blurred image, computed only where it can matter.
//!
//! A blurred sample exceeds a threshold only if some sample under the kernel does: the weights sum to one. So the
//! maximum of a tile of raw samples decides *exactly* whether blurring near it can be left out. Finding those maxima is
//! one read of the image; everything after it grows with the stripe, not with the frame.

use super::{
    blur::{Kernel, Sample, Scratch, UNITS, blur_span},
    segment::Regions,
};
use crate::scanner::channel::Plane;
use std::ops::Range;

/// Rows of a tile.
pub(super) const ROWS: usize = 8;
/// Columns of a tile: one cache line of bytes.
pub(super) const COLUMNS: usize = 64;

/// Blurred samples of the tiles near bright pixels. Buffers are kept from frame to frame.
#[derive(Debug)]
pub struct BlurredTiles<S: Sample> {
    width: usize,
    height: usize,
    /// Tiles in a row of tiles.
    across: usize,
    /// Whether a tile holds a raw sample above the threshold.
    hot: Vec<bool>,
    /// Whether a tile has been blurred.
    blurred: Vec<bool>,
    /// Blurred samples, row by row; only those in blurred tiles are of this frame.
    samples: Vec<S::Sum>,
    scratch: Scratch<S::Sum>,
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
            scratch: Scratch::default(),
        }
    }
}

impl<S: Sample> BlurredTiles<S> {
    /// Blurs every tile of `plane` in which a blurred sample above `threshold` (blurred units) can lie.
    pub fn compute(&mut self, plane: &Plane<'_, S>, kernel: &Kernel, threshold: u32) {
        self.resize(plane.width, plane.height);
        self.find_hot(plane, threshold);
        self.spread(kernel.radius());
        self.blur_marked(plane, kernel);
    }

    /// Blurs all tiles, and hands out the samples to be changed, row by row.
    pub fn compute_everywhere(&mut self, plane: &Plane<'_, S>, kernel: &Kernel) -> &mut [S::Sum] {
        self.resize(plane.width, plane.height);
        self.blurred.fill(true);
        self.blur_marked(plane, kernel);
        &mut self.samples
    }

    fn blur_marked(&mut self, plane: &Plane<'_, S>, kernel: &Kernel) {
        for tile_row in 0..self.hot.len() / self.across {
            let mut from = 0;
            while let Some(span) =
                next_span(&self.blurred[tile_row * self.across..][..self.across], from)
            {
                from = span.end;
                self.blur(plane, kernel, (span, tile_row));
            }
        }
    }

    /// Puts the runs of blurred samples above `threshold` into `regions`.
    pub fn segment(&self, threshold: u32, regions: &mut Regions) {
        regions.clear();
        let threshold = S::narrow(threshold);
        for (tile_row, tiles) in self.blurred.chunks_exact(self.across).enumerate() {
            let some = tiles.contains(&true);
            for y in tile_row * ROWS..((tile_row + 1) * ROWS).min(self.height) {
                regions.start_row();
                if some {
                    self.segment_row(y, tiles, threshold, regions);
                }
            }
        }
    }

    fn segment_row(&self, y: usize, tiles: &[bool], threshold: S::Sum, regions: &mut Regions) {
        let row = &self.samples[y * self.width..][..self.width];
        let mut from = 0;
        while let Some(span) = next_span(tiles, from) {
            from = span.end;
            let end = (span.end * COLUMNS).min(self.width);
            let mut x = span.start * COLUMNS;
            while let Some(start) = row[x..end].iter().position(|&s| s > threshold).map(|i| x + i) {
                x = row[start..end].iter().position(|&s| s <= threshold).map_or(end, |i| start + i);
                regions.push(y as u32, start as u32, x as u32);
            }
        }
    }

    /// The blurred sample at a pixel of a tile that was blurred.
    pub fn known(&self, x: usize, y: usize) -> u32 {
        self.samples[y * self.width + x].into()
    }

    /// Blurs the tiles that hold these pixels, if they have not been blurred.
    pub fn ensure(
        &mut self,
        plane: &Plane<'_, S>,
        kernel: &Kernel,
        (xs, ys): (Range<usize>, Range<usize>),
    ) {
        for tile_y in ys.start / ROWS..ys.end.div_ceil(ROWS) {
            for tile_x in xs.start / COLUMNS..xs.end.div_ceil(COLUMNS) {
                let blurred = &mut self.blurred[tile_y * self.across + tile_x];
                if !std::mem::replace(blurred, true) {
                    self.blur(plane, kernel, (tile_x..tile_x + 1, tile_y));
                }
            }
        }
    }

    /// Blurs consecutive tiles of a row of tiles.
    fn blur(
        &mut self,
        plane: &Plane<'_, S>,
        kernel: &Kernel,
        (tiles, tile_y): (Range<usize>, usize),
    ) {
        let (x0, x1) = (tiles.start * COLUMNS, (tiles.end * COLUMNS).min(self.width));
        for y in tile_y * ROWS..((tile_y + 1) * ROWS).min(self.height) {
            let out = &mut self.samples[y * self.width..][..self.width];
            blur_span(plane, kernel, (y, x0, x1), &mut self.scratch, out);
        }
    }

    /// Blurred samples of row `y`; only those in blurred tiles are of this frame.
    pub fn row(&self, y: usize) -> &[S::Sum] {
        &self.samples[y * self.width..][..self.width]
    }

    fn resize(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) {
            return;
        }
        (self.width, self.height) = (width, height);
        self.across = width.div_ceil(COLUMNS);
        let tiles = self.across * height.div_ceil(ROWS);
        self.hot.resize(tiles, false);
        self.blurred.resize(tiles, false);
        self.samples.resize(width * height, S::Sum::default());
    }

    /// The one read of the whole image.
    fn find_hot(&mut self, plane: &Plane<'_, S>, threshold: u32) {
        let is_hot = |maximum: S| Into::<u32>::into(maximum) > threshold / UNITS;
        for (tile_row, hot) in self.hot.chunks_exact_mut(self.across).enumerate() {
            let rows = tile_row * ROWS..((tile_row + 1) * ROWS).min(plane.height);
            let whole = plane.width / COLUMNS;
            // Fixed sizes: the maxima stay in vector registers. Below the last row it is read again, which changes none.
            let tiles: [&[[S; COLUMNS]]; ROWS] = std::array::from_fn(|i| {
                plane.row((rows.start + i).min(rows.end - 1)).as_chunks().0
            });
            for (tile, hot) in hot[..whole].iter_mut().enumerate() {
                let mut maxima = tiles[0][tile];
                for row in &tiles[1..] {
                    for (maximum, sample) in maxima.iter_mut().zip(row[tile]) {
                        *maximum = (*maximum).max(sample);
                    }
                }
                *hot = is_hot(maxima.into_iter().fold(S::default(), S::max));
            }
            if let Some(hot) = hot.get_mut(whole) {
                let rest = rows.flat_map(|y| &plane.row(y)[whole * COLUMNS..]);
                *hot = is_hot(rest.copied().max().unwrap_or_default());
            }
        }
    }

    /// Marks the tiles that the kernel can reach from a hot one.
    fn spread(&mut self, radius: usize) {
        let down = self.hot.len() / self.across;
        let (reach_x, reach_y) = (radius.div_ceil(COLUMNS), radius.div_ceil(ROWS));
        self.blurred.fill(false);
        for tile_y in 0..down {
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

/// The next consecutive tiles that are set, at or after `from`.
fn next_span(tiles: &[bool], from: usize) -> Option<Range<usize>> {
    let start = from + tiles[from..].iter().position(|&set| set)?;
    let end =
        tiles[start..].iter().position(|&set| !set).map_or(tiles.len(), |length| start + length);
    Some(start..end)
}
