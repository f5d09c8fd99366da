//! Step 3 of Yao et al. 2023: the Gaussian blur, in integers, so that every way to compute it gives the same bits.
//!
//! The kernel is separable, its weights are multiples of 1/256 that sum to one. A blurred sample keeps 8 fractional
//! bits ("blurred units": 256 a grey level). Both passes are exact; one rounding, half up, ends the second. Beyond the
//! border the nearest sample is repeated.

use super::lanes::{Lane, each};
use crate::scanner::channel::Plane;
use fearless_simd::{Simd, prelude::*, u8x64, u16x32, u32x16};
use std::{
    fmt::Debug,
    ops::{Add, Mul},
};

/// Blurred units a grey level.
pub const UNITS: u32 = 256;

/// An integer that holds weighted sums of samples.
pub trait Number:
    Copy + Ord + Default + Debug + Into<u32> + Add<Output = Self> + Mul<Output = Self> + Send
{
    /// The weight 0..=256.
    fn from_weight(weight: u16) -> Self;
}

impl Number for u16 {
    #[inline(always)]
    fn from_weight(weight: u16) -> Self {
        weight
    }
}

impl Number for u32 {
    #[inline(always)]
    fn from_weight(weight: u16) -> Self {
        weight.into()
    }
}

/// A sample of an image.
pub trait Sample:
    Copy + Ord + Default + Debug + Into<u32> + Into<Self::Sum> + Send + 'static
{
    /// Holds `256 * Self::MAX + 255`: sums of one pass, and blurred samples.
    type Sum: Number;
    /// Half of 256, for rounding.
    const HALF: Self::Sum;
    /// Quotient and remainder by 256.
    fn split(sum: Self::Sum) -> (Self::Sum, Self::Sum);
    /// The number, or the largest that [`Self::Sum`] holds, which no blurred sample exceeds.
    fn narrow(sum: u32) -> Self::Sum;
    /// Whether some sample of the rows is above the limit.
    fn some_above<V: Simd>(vectors: V, rows: &[&[Self; COLUMNS]; ROWS], limit: u32) -> bool;
    /// The second pass along one row: from sums of the first pass, divided by 256, and their remainders.
    fn along<V: Simd>(
        vectors: V,
        weights: &[u16],
        sums: (&[Self::Sum; PADDED], &[Self::Sum; PADDED]),
        blurred: &mut [Self::Sum; COLUMNS],
    );
    /// Bit i: whether blurred sample i is above the threshold.
    fn above<V: Simd>(vectors: V, sums: &[Self::Sum; 64], threshold: Self::Sum) -> u64;
}

/// [`Sample::along`] in vectors of one type. Left to itself the compiler shuffles overlapping samples instead of loading
/// them again.
macro_rules! along {
    ($vector:ident, $sum:ty, $lanes:literal) => {
        #[inline(always)]
        fn along<V: Simd>(
            vectors: V,
            weights: &[u16],
            (high, low): (&[$sum; PADDED], &[$sum; PADDED]),
            blurred: &mut [$sum; COLUMNS],
        ) {
            #[inline(always)]
            fn near<V: Simd>(vectors: V, row: &[$sum; PADDED], from: usize) -> $vector<V> {
                $vector::from_slice(vectors, &row[from..][..$lanes])
            }
            #[inline(always)]
            fn weighed<V: Simd>(
                vectors: V,
                weights: &[u16],
                row: &[$sum; PADDED],
                from: usize,
            ) -> $vector<V> {
                let r = weights.len() / 2;
                let mut sum = near(vectors, row, from + r) * <$sum>::from(weights[r]);
                for i in 0..r {
                    let pair = near(vectors, row, from + i) + near(vectors, row, from + 2 * r - i);
                    sum += pair * <$sum>::from(weights[i]);
                }
                sum
            }
            let from = MARGIN - weights.len() / 2;
            for (at, blurred) in (from..).step_by($lanes).zip(blurred.chunks_exact_mut($lanes)) {
                let carried = (weighed(vectors, weights, low, at) + Self::HALF) >> 8_u32;
                (weighed(vectors, weights, high, at) + carried).store_slice(blurred);
            }
        }
    };
}

impl Sample for u8 {
    type Sum = u16;
    const HALF: u16 = 128;
    #[inline(always)]
    fn split(sum: u16) -> (u16, u16) {
        (sum >> 8, sum & 0xff)
    }
    fn narrow(sum: u32) -> u16 {
        u16::try_from(sum).unwrap_or(u16::MAX)
    }
    #[inline(always)]
    fn some_above<V: Simd>(vectors: V, rows: &[&[u8; COLUMNS]; ROWS], limit: u32) -> bool {
        let limit = u8::try_from(limit).unwrap_or(u8::MAX);
        let mut maximum = u8x64::from_slice(vectors, rows[0]);
        for row in &rows[1..] {
            maximum = maximum.max(u8x64::from_slice(vectors, *row));
        }
        maximum.simd_gt(limit).any_true()
    }
    along!(u16x32, u16, 32);
    #[inline(always)]
    fn above<V: Simd>(vectors: V, sums: &[u16; 64], threshold: u16) -> u64 {
        let left = u16x32::from_slice(vectors, &sums[..32]).simd_gt(threshold).to_bitmask();
        let right = u16x32::from_slice(vectors, &sums[32..]).simd_gt(threshold).to_bitmask();
        left | right << 32
    }
}

impl Sample for u16 {
    type Sum = u32;
    const HALF: u32 = 128;
    #[inline(always)]
    fn split(sum: u32) -> (u32, u32) {
        (sum >> 8, sum & 0xff)
    }
    fn narrow(sum: u32) -> u32 {
        sum
    }
    #[inline(always)]
    fn some_above<V: Simd>(vectors: V, rows: &[&[u16; COLUMNS]; ROWS], limit: u32) -> bool {
        let limit = u16::try_from(limit).unwrap_or(u16::MAX);
        let mut maximum = u16x32::from_slice(vectors, &rows[0][..COLUMNS / 2]);
        for row in rows {
            maximum = maximum.max(u16x32::from_slice(vectors, &row[..COLUMNS / 2]));
            maximum = maximum.max(u16x32::from_slice(vectors, &row[COLUMNS / 2..]));
        }
        maximum.simd_gt(limit).any_true()
    }
    along!(u32x16, u32, 16);
    #[inline(always)]
    fn above<V: Simd>(vectors: V, sums: &[u32; 64], threshold: u32) -> u64 {
        let mut bits = 0;
        for (i, sums) in sums.as_chunks::<16>().0.iter().enumerate() {
            bits |= u32x16::from_slice(vectors, sums).simd_gt(threshold).to_bitmask() << (16 * i);
        }
        bits
    }
}

/// Weights of one pass, `2r + 1` of them, in 1/256, symmetric, summing to 256.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    weights: Vec<u16>,
    variance_px2: f64,
    noise_gain: f64,
    /// [`Self::ramp_energies`] for whole lengths.
    ramp_energy: Vec<f32>,
}

/// Windows up to this length have their noise tabulated; in longer ones the blur hardly matters.
const TABULATED: usize = 96;

impl Kernel {
    /// A Gaussian of standard deviation 0.3 (r - 1) + 0.8 pixels, 1.4 for the paper's r = 3; radius 0 changes nothing.
    ///
    /// The paper prints a radius only; this is what `GaussianBlur` of `OpenCV` derives from the kernel's size.
    pub fn gaussian(radius: u32) -> Self {
        if radius == 0 {
            return Self::of(vec![UNITS as u16]);
        }
        let sigma_px = 0.3 * (f64::from(radius) - 1.0) + 0.8;
        let side: Vec<f64> =
            (1..=radius).map(|i| (-0.5 * (f64::from(i) / sigma_px).powi(2)).exp()).collect();
        let total = 1.0 + 2.0 * side.iter().sum::<f64>();
        let side: Vec<u16> =
            side.iter().map(|w| (f64::from(UNITS) * w / total).round() as u16).collect();
        // What rounding leaves over goes to the centre: the weights must sum to one exactly.
        let centre = UNITS as u16 - 2 * side.iter().sum::<u16>();
        Self::of(side.iter().rev().copied().chain([centre]).chain(side.iter().copied()).collect())
    }

    fn of(weights: Vec<u16>) -> Self {
        let r = (weights.len() / 2) as f64;
        let share = |w: u16| f64::from(w) / f64::from(UNITS);
        let variance_px2 =
            weights.iter().enumerate().map(|(i, &w)| (i as f64 - r).powi(2) * share(w)).sum();
        let noise_gain = weights.iter().map(|&w| share(w).powi(2)).sum();
        let ramp_energy = (0..=TABULATED + 1)
            .map(|length| blurred_ramp_energy(&weights, length) as f32)
            .collect();
        Self { weights, variance_px2, noise_gain, ramp_energy }
    }

    /// The radius r, pixels.
    pub fn radius(&self) -> usize {
        self.weights.len() / 2
    }

    /// The weights, first to last.
    pub fn weights(&self) -> &[u16] {
        &self.weights
    }

    /// Variance of the kernel, px².
    pub fn variance_px2(&self) -> f64 {
        self.variance_px2
    }

    /// What one pass leaves of the variance of white noise: the sum of the squared weights.
    pub fn noise_gain(&self) -> f64 {
        self.noise_gain
    }

    /// Variance of Σ (i - c) G over windows of `length` pixels about c, when G is white noise of variance 1 that went
    /// through this kernel across the window.
    #[inline(always)]
    pub fn ramp_energies(&self, length: &Lane) -> Lane {
        each(|lane| {
            let length = length[lane].max(0.0);
            if length > TABULATED as f32 {
                return (length * length * length - length) / 12.0;
            }
            let at = length as usize;
            let (below, above) = (self.ramp_energy[at], self.ramp_energy[at + 1]);
            below + (length - at as f32) * (above - below)
        })
    }
}

/// Σ over raw samples of the squared weight with which each enters Σ (i - c) G: the ramp convolved with the kernel.
fn blurred_ramp_energy(kernel: &[u16], length: usize) -> f64 {
    let middle = (length as f64 - 1.0) / 2.0;
    let raw = 0..(length + kernel.len()).saturating_sub(1);
    raw.map(|raw| {
        let reached = (raw + 1).saturating_sub(kernel.len())..(raw + 1).min(length);
        let weight = |i: usize| (i as f64 - middle) * f64::from(kernel[raw - i]) / f64::from(UNITS);
        reached.map(weight).sum::<f64>().powi(2)
    })
    .sum()
}

/// One blurred sample by definition: the weighted sum over the kernel's square.
pub fn blurred_at<S: Sample>(plane: &Plane<'_, S>, kernel: &Kernel, x: usize, y: usize) -> u32 {
    let r = kernel.radius();
    let clamp = |at: usize, i: usize, end: usize| (at + i).saturating_sub(r).min(end - 1);
    let mut sum = 0;
    for (i, &wy) in kernel.weights.iter().enumerate() {
        let row = plane.row(clamp(y, i, plane.height));
        let mut row_sum = 0;
        for (j, &wx) in kernel.weights.iter().enumerate() {
            let sample: u32 = row[clamp(x, j, plane.width)].into();
            row_sum += u32::from(wx) * sample;
        }
        sum += u32::from(wy) * row_sum;
    }
    (sum + UNITS / 2) / UNITS
}

/// Columns and rows of a tile: one cache line of bytes.
pub const COLUMNS: usize = 64;
/// Rows of a tile.
pub const ROWS: usize = 8;
/// Largest radius of a blur.
pub const MAX_RADIUS: usize = 15;
/// Columns to either side of a tile that are held with it: whole strips make a row.
const MARGIN: usize = 16;
/// A row of a tile and its margins.
pub const PADDED: usize = COLUMNS + 2 * MARGIN;
/// Samples that are worked on side by side.
const STRIP: usize = 32;

/// A tile and what the kernel reaches around it; scratch space that is kept between tiles.
#[derive(Debug)]
pub struct TileBlur<S: Sample> {
    rows: Box<[[S; PADDED]; ROWS + 2 * MAX_RADIUS]>,
    /// Sums of the first pass, divided by 256, and their remainders, row by row.
    high: [[S::Sum; PADDED]; ROWS],
    low: [[S::Sum; PADDED]; ROWS],
}

impl<S: Sample> Default for TileBlur<S> {
    fn default() -> Self {
        Self {
            rows: Box::new([[S::default(); PADDED]; ROWS + 2 * MAX_RADIUS]),
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
    pub fn blur<V: Simd>(
        &mut self,
        vectors: V,
        (plane, kernel): (&Plane<'_, S>, &Kernel),
        (x, y): (usize, usize),
        out: &mut [S::Sum],
    ) {
        match kernel.radius() {
            // The paper's radius: a fixed length unrolls.
            3 => self.blur_by::<3, V>(vectors, (plane, kernel), (x, y), out),
            _ => self.blur_by::<0, V>(vectors, (plane, kernel), (x, y), out),
        }
    }

    /// The same for radius R, or any radius when R is 0.
    #[inline(always)]
    fn blur_by<const R: usize, V: Simd>(
        &mut self,
        vectors: V,
        (plane, kernel): (&Plane<'_, S>, &Kernel),
        (x, y): (usize, usize),
        out: &mut [S::Sum],
    ) {
        let r = if R > 0 { R } else { kernel.radius() };
        let weights = &kernel.weights()[..2 * r + 1];
        let (width, height) = (COLUMNS.min(plane.width - x), ROWS.min(plane.height - y));
        self.take(plane, (x, y), height + 2 * r, r);
        // All rows before the second pass: what was just stored cannot be read again at other places at once.
        for k in 0..ROWS {
            let near = &self.rows[k..k + 2 * r + 1];
            for strip in (0..PADDED).step_by(STRIP) {
                let sums = down::<R, S>(weights, near, strip);
                for (i, &sum) in sums.iter().enumerate() {
                    (self.high[k][strip + i], self.low[k][strip + i]) = S::split(sum);
                }
            }
        }
        for k in 0..height {
            let mut blurred = [S::Sum::default(); COLUMNS];
            S::along(vectors, weights, (&self.high[k], &self.low[k]), &mut blurred);
            let out = &mut out[(y + k) * plane.width + x..];
            match out.first_chunk_mut() {
                Some(out) if width == COLUMNS => *out = blurred,
                _ => out[..width].copy_from_slice(&blurred[..width]),
            }
        }
    }

    /// Takes the samples that the tile's blur reads; beyond the border the nearest is repeated.
    #[inline(always)]
    fn take(&mut self, plane: &Plane<'_, S>, (x, y): (usize, usize), rows: usize, r: usize) {
        let is_inside = x >= MARGIN && x + COLUMNS + MARGIN <= plane.width;
        for (i, padded) in self.rows[..rows].iter_mut().enumerate() {
            let row = plane.row((y + i).saturating_sub(r).min(plane.height - 1));
            if is_inside {
                padded.copy_from_slice(&row[x - MARGIN..][..PADDED]);
            } else {
                for (j, sample) in padded.iter_mut().enumerate() {
                    *sample = row[(x + j).saturating_sub(MARGIN).min(plane.width - 1)];
                }
            }
        }
    }
}

#[inline(always)]
fn strip_of<T>(row: &[T; PADDED], from: usize) -> &[T; STRIP] {
    row[from..].first_chunk().expect("a strip lies within the padded row")
}

/// The first pass for a strip of columns: Σ weight · sample over rows. Two at the same distance from the centre share a
/// weight.
#[inline(always)]
fn down<const R: usize, S: Sample>(
    weights: &[u16],
    rows: &[[S; PADDED]],
    strip: usize,
) -> [S::Sum; STRIP] {
    let r = if R > 0 { R } else { weights.len() / 2 };
    let weight = |i: usize| S::Sum::from_weight(weights[i]);
    let mut sums = [S::Sum::default(); STRIP];
    let (by, centre) = (weight(r), strip_of(&rows[r], strip));
    for (sum, &sample) in sums.iter_mut().zip(centre) {
        *sum = by * sample.into();
    }
    for i in 0..r {
        let (by, above, below) =
            (weight(i), strip_of(&rows[i], strip), strip_of(&rows[2 * r - i], strip));
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
    use crate::scanner::stripe::vectors::{Vectors, Work};

    struct BlurTile<'a>(&'a Plane<'a, u16>, &'a Kernel, &'a mut [u32]);

    impl Work for BlurTile<'_> {
        type Output = ();
        fn run<V: Simd>(self, vectors: V) {
            TileBlur::default().blur(vectors, (self.0, self.1), (0, 0), self.2);
        }
    }

    fn blur_tile(plane: &Plane<'_, u16>, kernel: &Kernel, out: &mut [u32]) {
        Vectors::widest().run(BlurTile(plane, kernel, out));
    }

    #[test]
    fn the_papers_kernel_is_a_gaussian_of_1_4_px() {
        let kernel = Kernel::gaussian(3);
        assert_eq!(kernel.weights(), [7, 27, 57, 74, 57, 27, 7]);
        // A truncated Gaussian: a little narrower than 1.4² = 1.96.
        assert!((kernel.variance_px2() - 1.83).abs() < 0.05, "{}", kernel.variance_px2());
    }

    #[test]
    fn weights_sum_to_one_for_every_radius() {
        for radius in 0..=15 {
            let kernel = Kernel::gaussian(radius);
            assert_eq!(kernel.weights().len(), 2 * radius as usize + 1);
            assert_eq!(
                kernel.weights().iter().map(|&w| u32::from(w)).sum::<u32>(),
                UNITS,
                "radius {radius}"
            );
        }
    }

    #[test]
    fn a_bright_pixel_becomes_the_square_of_the_kernel() {
        let kernel = Kernel::gaussian(1);
        assert_eq!(kernel.weights(), [61, 134, 61]);
        let picture = [
            0, 0, 0, 0, //
            0, 0, 0, 0, //
            0, 255, 0, 0, //
            0, 0, 0, 0_u8,
        ];
        // Rounded: 255 · 61 · 61 / 256 = 3706.5, 255 · 61 · 134 / 256 = 8142.1, 255 · 134 · 134 / 256 = 17885.9.
        let expected = [
            0, 0, 0, 0, //
            3706, 8142, 3706, 0, //
            8142, 17886, 8142, 0, //
            3706, 8142, 3706, 0,
        ];
        let plane = Plane { width: 4, height: 4, stride: 4, samples: &picture };
        let blurred: Vec<u32> =
            (0..16).map(|at| blurred_at(&plane, &kernel, at % 4, at / 4)).collect();
        assert_eq!(blurred, expected);
    }

    #[test]
    fn beyond_the_border_the_nearest_sample_is_repeated() {
        let plane = Plane { width: 1, height: 3, stride: 1, samples: &[0_u8, 0, 255] };
        let kernel = Kernel::gaussian(1);
        let blurred = [0, 1, 2].map(|y| blurred_at(&plane, &kernel, 0, y));
        assert_eq!(blurred, [0, 61 * 255, (134 + 61) * 255]);
    }

    #[test]
    fn full_scale_stays_full_scale_without_overflow() {
        let kernel = Kernel::gaussian(3);
        let white = vec![u16::MAX; 64];
        let plane = Plane { width: 8, height: 8, stride: 8, samples: &white };
        assert_eq!(blurred_at(&plane, &kernel, 4, 4), u32::from(u16::MAX) * UNITS);
        let mut out = vec![0; 64];
        blur_tile(&plane, &kernel, &mut out);
        assert_eq!(out, vec![u32::from(u16::MAX) * UNITS; 64]);
    }
}
