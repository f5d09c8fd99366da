//! The vectorized blur of one tile: columns first, then along the rows. Equals [`blurred_at`](super::blur::blurred_at)
//! bit for bit.

use super::blur::{Kernel, Number, Sample};
use crate::scanner::channel::Plane;
use fearless_simd::Simd;

/// Columns of a tile: one cache line of bytes.
pub(super) const COLUMNS: usize = 64;
/// Rows of a tile.
pub(super) const ROWS: usize = 8;
/// Largest radius of a blur.
pub(super) const MAX_RADIUS: usize = 15;
/// Columns held on either side of a tile, so that a row consists of whole strips.
pub(super) const MARGIN: usize = 16;
/// A row of a tile and its margins.
pub(super) const PADDED: usize = COLUMNS + 2 * MARGIN;
/// Samples processed side by side.
const STRIP: usize = 32;

/// A frame and the blur to apply to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlurInput<'a, S> {
    /// The frame.
    pub(crate) plane: &'a Plane<'a, S>,
    /// The blur.
    pub(crate) kernel: &'a Kernel,
}

/// A tile and its surroundings under the kernel; scratch space kept between tiles.
#[derive(Debug)]
pub(super) struct TileBlur<S: Sample> {
    copied: Box<[[S; PADDED]; ROWS + 2 * MAX_RADIUS]>,
    /// Sums of the first pass, divided by 256, and their remainders, row by row.
    high: [[S::Sum; PADDED]; ROWS],
    low: [[S::Sum; PADDED]; ROWS],
}

impl<S: Sample> Default for TileBlur<S> {
    fn default() -> Self {
        Self {
            copied: Box::new([[S::default(); PADDED]; ROWS + 2 * MAX_RADIUS]),
            high: [[S::Sum::default(); PADDED]; ROWS],
            low: [[S::Sum::default(); PADDED]; ROWS],
        }
    }
}

impl<S: Sample> TileBlur<S> {
    /// Blurs the tile whose top-left sample is (x, y) into `out`, an image of the plane's size: columns first, then
    /// along the rows.
    ///
    /// The second pass weighs quotients and remainders of the first pass's sums by 256 apart: `Σ w·s / 256 =
    /// Σ w·⌊s/256⌋ + Σ w·(s mod 256) / 256`. Both stay in the narrow integers that vector units are fastest with.
    #[inline(always)]
    pub(super) fn blur<V: Simd>(
        &mut self,
        vectors: V,
        input: BlurInput<'_, S>,
        (x, y): (usize, usize),
        out: &mut [S::Sum],
    ) {
        match input.kernel.radius() {
            // The paper's radius: a fixed length unrolls.
            3 => self.blur_by::<3, V>(vectors, input, (x, y), out),
            _ => self.blur_by::<0, V>(vectors, input, (x, y), out),
        }
    }

    /// The same for radius R, or any radius when R is 0.
    #[inline(always)]
    fn blur_by<const R: usize, V: Simd>(
        &mut self,
        vectors: V,
        input: BlurInput<'_, S>,
        (x, y): (usize, usize),
        out: &mut [S::Sum],
    ) {
        let BlurInput { plane, kernel } = input;
        let r = if R > 0 { R } else { kernel.radius() };
        let weights = &kernel.weights()[..=2 * r];
        let (width, height) = (COLUMNS.min(plane.width - x), ROWS.min(plane.height - y));
        let Self { copied, high, low } = self;
        let rows = Rows::of(plane, (x, y), r, copied);
        // Finish all rows before the second pass: reading recently stored data at other offsets stalls.
        for k in 0..ROWS {
            let near = &rows.0[k..=k + 2 * r];
            for strip in (0..PADDED).step_by(STRIP) {
                let sums = down::<R, S>(weights, near, strip);
                for (i, &sum) in sums.iter().enumerate() {
                    (high[k][strip + i], low[k][strip + i]) = S::split(sum);
                }
            }
        }
        for k in 0..height {
            let mut blurred = [S::Sum::default(); COLUMNS];
            S::along(vectors, weights, &high[k], &low[k], &mut blurred);
            let out = &mut out[(y + k) * plane.width + x..];
            match out.first_chunk_mut() {
                Some(out) if width == COLUMNS => *out = blurred,
                _ => out[..width].copy_from_slice(&blurred[..width]),
            }
        }
    }
}

/// The rows that the blur of a tile reads, from `r` above it to `r` below it.
struct Rows<'a, S>([&'a [S; PADDED]; ROWS + 2 * MAX_RADIUS]);

impl<'a, S: Sample> Rows<'a, S> {
    /// Borrows the plane's rows. For a tile at the border it copies them and repeats the nearest sample beyond it.
    #[inline(always)]
    fn of(
        plane: &Plane<'a, S>,
        (x, y): (usize, usize),
        r: usize,
        copied: &'a mut [[S; PADDED]; ROWS + 2 * MAX_RADIUS],
    ) -> Self {
        let reached = ROWS + 2 * r;
        let is_inside = x >= MARGIN
            && x + COLUMNS + MARGIN <= plane.width
            && y >= r
            && y + ROWS + r <= plane.height;
        if !is_inside {
            for (i, padded) in copied[..reached].iter_mut().enumerate() {
                let row = plane.row((y + i).saturating_sub(r).min(plane.height - 1));
                for (j, sample) in padded.iter_mut().enumerate() {
                    *sample = row[(x + j).saturating_sub(MARGIN).min(plane.width - 1)];
                }
            }
        }
        let mut rows = [&copied[0]; ROWS + 2 * MAX_RADIUS];
        for (i, row) in rows[..reached].iter_mut().enumerate() {
            *row = if is_inside {
                plane.row(y + i - r)[x - MARGIN..].first_chunk().expect("the tile lies inside")
            } else {
                &copied[i]
            };
        }
        Self(rows)
    }
}

#[inline(always)]
fn strip_of<T>(row: &[T; PADDED], from: usize) -> &[T; STRIP] {
    row[from..].first_chunk().expect("a strip lies within the padded row")
}

/// First pass for a strip of columns: Σ weight · sample over rows. Two rows at the same distance from the centre share
/// a weight.
#[inline(always)]
fn down<const R: usize, S: Sample>(
    weights: &[u16],
    rows: &[&[S; PADDED]],
    strip: usize,
) -> [S::Sum; STRIP] {
    let r = if R > 0 { R } else { weights.len() / 2 };
    let weight = |i: usize| S::Sum::from_weight(weights[i]);
    let mut sums = [S::Sum::default(); STRIP];
    let (by, centre) = (weight(r), strip_of(rows[r], strip));
    for (sum, &sample) in sums.iter_mut().zip(centre) {
        *sum = by * sample.into();
    }
    for i in 0..r {
        let (by, above, below) =
            (weight(i), strip_of(rows[i], strip), strip_of(rows[2 * r - i], strip));
        for j in 0..STRIP {
            let (above, below): (S::Sum, S::Sum) = (above[j].into(), below[j].into());
            sums[j] = sums[j] + by * (above + below);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::stripe::{
        blur::UNITS,
        vectors::{Vectors, Work},
    };

    struct BlurTile<'a>(BlurInput<'a, u16>, &'a mut [u32]);

    impl Work for BlurTile<'_> {
        type Output = ();
        fn run<V: Simd>(self, vectors: V) {
            TileBlur::default().blur(vectors, self.0, (0, 0), self.1);
        }
    }

    fn blur_tile(plane: &Plane<'_, u16>, kernel: &Kernel, out: &mut [u32]) {
        Vectors::widest().run(BlurTile(BlurInput { plane, kernel }, out));
    }

    #[test]
    fn full_scale_stays_full_scale_without_overflow() {
        let white = vec![u16::MAX; 64];
        let plane = Plane { width: 8, height: 8, stride: 8, samples: &white };
        let mut out = vec![0; 64];
        blur_tile(&plane, &Kernel::gaussian(3), &mut out);
        assert_eq!(out, vec![u32::from(u16::MAX) * UNITS; 64]);
    }
}
