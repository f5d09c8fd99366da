//! Step 3 of Yao et al. 2023: the Gaussian blur. It uses integers, so every implementation gives the same bits.
//!
//! The kernel is separable; its weights are multiples of 1/256 and sum to one. A blurred sample keeps 8 fractional bits
//! ("blurred units": 256 per grey level). Both passes are exact; the second ends with the only rounding, half up.
//! Beyond the border the nearest sample is repeated.

use super::{
    lanes::{Lane, each},
    tile_blur::{COLUMNS, MARGIN, PADDED},
};
use crate::scanner::channel::Plane;
use fearless_simd::{Simd, prelude::*, u8x64, u16x32, u32x16};
use std::{
    fmt::Debug,
    ops::{Add, Mul, Sub},
};

/// Blurred units per grey level.
pub(super) const UNITS: u32 = 256;

/// An integer wide enough for weighted sums of samples.
pub(super) trait Number:
    Copy
    + Ord
    + Default
    + Debug
    + Into<u32>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Send
{
    /// Converts a weight, 0..=256.
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

/// An image sample.
pub(super) trait Sample:
    Copy + Ord + Default + Debug + Into<u32> + Into<Self::Sum> + Send + 'static
{
    /// Holds `256 * Self::MAX + 255`: sums of one pass, and blurred samples.
    type Sum: Number;
    /// Half of 256, for rounding.
    const HALF: Self::Sum;
    /// Quotient and remainder by 256.
    fn split(sum: Self::Sum) -> (Self::Sum, Self::Sum);
    /// Converts the number, limited to the largest that [`Self::Sum`] holds, which no blurred sample exceeds.
    fn narrow(sum: u32) -> Self::Sum;
    /// Updates the maximum of every column.
    fn raise<V: Simd>(vectors: V, maxima: &mut [Self; COLUMNS], row: &[Self; COLUMNS]);
    /// True if any sample exceeds the limit.
    fn some_above<V: Simd>(vectors: V, samples: &[Self; COLUMNS], limit: u32) -> bool;
    /// Second pass along one row, from the sums of the first pass divided by 256 and their remainders.
    fn along<V: Simd>(
        vectors: V,
        weights: &[u16],
        high: &[Self::Sum; PADDED],
        low: &[Self::Sum; PADDED],
        blurred: &mut [Self::Sum; COLUMNS],
    );
    /// Returns a mask: bit i is set if blurred sample i exceeds the threshold.
    fn above<V: Simd>(vectors: V, sums: &[Self::Sum; 64], threshold: Self::Sum) -> u64;
}

/// [`Sample::along`] in vectors of one type. Without this macro the compiler shuffles overlapping samples instead of
/// loading them again.
macro_rules! along {
    ($vector:ident, $sum:ty, $lanes:literal) => {
        #[inline(always)]
        fn along<V: Simd>(
            vectors: V,
            weights: &[u16],
            high: &[$sum; PADDED],
            low: &[$sum; PADDED],
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
    fn raise<V: Simd>(vectors: V, maxima: &mut [Self; COLUMNS], row: &[Self; COLUMNS]) {
        let larger = u8x64::from_slice(vectors, maxima).max(u8x64::from_slice(vectors, row));
        larger.store_slice(maxima);
    }
    #[inline(always)]
    fn some_above<V: Simd>(vectors: V, samples: &[Self; COLUMNS], limit: u32) -> bool {
        let limit = Self::try_from(limit).unwrap_or(Self::MAX);
        u8x64::from_slice(vectors, samples).simd_gt(limit).any_true()
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
    fn raise<V: Simd>(vectors: V, maxima: &mut [Self; COLUMNS], row: &[Self; COLUMNS]) {
        for (maxima, row) in maxima.chunks_exact_mut(32).zip(row.chunks_exact(32)) {
            let larger = u16x32::from_slice(vectors, maxima).max(u16x32::from_slice(vectors, row));
            larger.store_slice(maxima);
        }
    }
    #[inline(always)]
    fn some_above<V: Simd>(vectors: V, samples: &[Self; COLUMNS], limit: u32) -> bool {
        let limit = Self::try_from(limit).unwrap_or(Self::MAX);
        let [left, right] = [&samples[..32], &samples[32..]];
        let larger = u16x32::from_slice(vectors, left).max(u16x32::from_slice(vectors, right));
        larger.simd_gt(limit).any_true()
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
pub(super) struct Kernel {
    weights: Vec<u16>,
    variance_px2: f64,
    noise_gain: f64,
    /// [`Self::ramp_energies`] for integer lengths.
    ramp_energy: Vec<f32>,
}

/// Windows up to this length have their noise tabulated; in longer ones the blur hardly matters.
const TABULATED: usize = 96;

/// Returns the standard deviation of a blur, 0.3 (r - 1) + 0.8 pixels, 1.4 for the paper's r = 3; radius 0 is no blur.
///
/// The paper gives only a radius; this is the formula by which OpenCV's `GaussianBlur` derives sigma from the kernel
/// size.
pub(in crate::scanner) fn sigma_px(radius: u32) -> f64 {
    if radius == 0 { 0.0 } else { 0.3 * (f64::from(radius) - 1.0) + 0.8 }
}

impl Kernel {
    /// Returns a Gaussian of standard deviation [`sigma_px`]. Radius 0 changes nothing.
    pub(super) fn gaussian(radius: u32) -> Self {
        if radius == 0 {
            return Self::of(vec![UNITS as u16]);
        }
        let sigma_px = sigma_px(radius);
        let side: Vec<f64> =
            (1..=radius).map(|i| (-0.5 * (f64::from(i) / sigma_px).powi(2)).exp()).collect();
        let total = 1.0 + 2.0 * side.iter().sum::<f64>();
        let side: Vec<u16> =
            side.iter().map(|w| (f64::from(UNITS) * w / total).round() as u16).collect();
        // The centre absorbs the rounding error: the weights must sum to exactly one.
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

    /// Returns the radius r, pixels.
    pub(super) fn radius(&self) -> usize {
        self.weights.len() / 2
    }

    /// Returns the weights, first to last.
    pub(super) fn weights(&self) -> &[u16] {
        &self.weights
    }

    /// Returns the variance of the kernel, px².
    pub(super) fn variance_px2(&self) -> f64 {
        self.variance_px2
    }

    /// Returns the factor by which one pass scales the variance of white noise: the sum of the squared weights.
    pub(super) fn noise_gain(&self) -> f64 {
        self.noise_gain
    }

    /// Returns the variance of Σ (i - c) G over windows of `length` pixels about c, for white noise G of variance 1
    /// that passed through this kernel across the window.
    #[inline(always)]
    pub(super) fn ramp_energies(&self, length: &Lane) -> Lane {
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

/// Returns Σ over raw samples of the squared weight with which each enters Σ (i - c) G: the ramp convolved with the
/// kernel.
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

/// Returns one blurred sample by definition: the weighted sum over the kernel's square.
pub(super) fn blurred_at<S: Sample>(
    plane: &Plane<'_, S>,
    kernel: &Kernel,
    x: usize,
    y: usize,
) -> u32 {
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

#[cfg(test)]
mod tests {
    use super::*;
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
    }
}
