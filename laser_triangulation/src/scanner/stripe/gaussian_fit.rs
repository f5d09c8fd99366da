//! Step 5 of Yao et al. 2023: the coarse peak, the maximum of a Gaussian through the blurred cross-section.

use super::{
    blur::UNITS,
    lanes::{Centres, LANES, Lane, Sections, each, lane_of},
    logarithm::ln,
    parabola::{NormalSums, Parabola},
    section::Noise,
};

/// Returns the maximum of the Gaussian fitted to the candidate's samples, pixels from the first of them.
///
/// The logarithm of a Gaussian is a parabola: ln G(t) = p₀ + p₁t + p₂t². Least squares in the logarithm, each sample
/// weighted by G², because noise of ln G is that of G divided by G (Guo 2011, doi 10.1109/MSP.2011.941846). The maximum
/// lies at -p₁ / 2p₂. If the parabola opens upwards, or its maximum lies outside the candidate, the brightest sample is
/// returned.
#[inline(always)]
pub(super) fn coarse_peak(sections: &Sections, brightest: &Lane) -> Lane {
    let fit = Fit::of(sections, brightest);
    each(|lane| if fit.is_peak[lane] > 0.0 { fit.position_px[lane] } else { brightest[lane] })
}

/// The same fit as a complete estimator with uncertainty: the derivative of the maximum with respect to each sample
/// times that sample's noise. Where the brightest sample is returned, the uncertainty is half the candidate.
#[inline(always)]
pub(super) fn gaussian_fit(sections: &Sections, brightest: &Lane, noise: &Noise<'_>) -> Centres {
    let fit = Fit::of(sections, brightest);
    let sigma = fit.sigma(sections, brightest, noise);
    let length = sections.length();
    Centres {
        position_px: each(|lane| {
            if fit.is_peak[lane] > 0.0 { fit.position_px[lane] } else { brightest[lane] }
        }),
        sigma_px: each(
            |lane| if fit.is_peak[lane] > 0.0 { sigma[lane] } else { length[lane] / 2.0 },
        ),
    }
}

/// A parabola through the logarithms of every lane, t = 0 at the brightest sample, levels in shares of the peak.
struct Fit {
    /// 1 if the parabola has its maximum inside the candidate, else 0.
    is_peak: Lane,
    /// Position of the maximum, pixels from the candidate's first sample.
    position_px: Lane,
    /// Derivative of the maximum with respect to the right-hand side Σ w tᵏ ln G of the normal equations, k = 0, 1, 2.
    gradient: [Lane; 3],
}

impl Fit {
    #[inline(always)]
    fn of(sections: &Sections, brightest: &Lane) -> Self {
        // Weights w = G².
        let mut sums = NormalSums::default();
        let last = sections.last_place();
        let by_peak = each(|lane| 1.0 / sections.peak[lane]);
        let ln_peak = each(|lane| ln(sections.peak[lane]));
        for i in sections.candidate_rows() {
            let (place, level) = (sections.place(i), sections.blurred[i]);
            for lane in 0..LANES {
                let is_inside = (place[lane] >= 0.0) & (place[lane] <= last[lane]);
                let share = level[lane] * by_peak[lane];
                let weight = if is_inside { share * share } else { 0.0 };
                let t = place[lane] - brightest[lane];
                // Relative to the peak, so that equal samples give an exactly level parabola.
                let logarithm = ln(if is_inside { level[lane] } else { 1.0 }) - ln_peak[lane];
                sums.add(lane, weight, t, logarithm);
            }
        }
        Self::solve(&sums, brightest, &last)
    }

    #[inline(always)]
    fn solve(sums: &NormalSums, brightest: &Lane, last: &Lane) -> Self {
        let none = [0.0; LANES];
        let mut fit = Self { is_peak: none, position_px: none, gradient: [none; 3] };
        for lane in 0..LANES {
            let Parabola { slope, curvature, sums: [s0, s1, s2], matrix, determinant, .. } =
                sums.solve(lane);
            let [a11, a12, a22] = matrix;
            let position_px = brightest[lane] - slope / (2.0 * curvature);
            // Also false for too few samples: the position is then NaN.
            let is_peak = (curvature < 0.0) & (position_px >= 0.0) & (position_px <= last[lane]);
            fit.is_peak[lane] = if is_peak { 1.0 } else { 0.0 };
            fit.position_px[lane] = position_px;
            // d(-p₁/2p₂) = -dp₁/2p₂ + p₁dp₂/2p₂², with p₁ and p₂ as functions of b₁ and b₂, and those of the right-hand
            // side.
            let (by_slope, by_curvature) =
                (-0.5 / curvature, 0.5 * slope / (curvature * curvature));
            let by_b1 = (by_slope * a22 - by_curvature * a12) / determinant;
            let by_b2 = (by_curvature * a11 - by_slope * a12) / determinant;
            fit.gradient[0][lane] = -(by_b1 * s1 + by_b2 * s2) / s0;
            fit.gradient[1][lane] = by_b1;
            fit.gradient[2][lane] = by_b2;
        }
        fit
    }

    /// Returns the standard deviation of the maximum: every raw sample's noise times its effect on the maximum, through
    /// the blur, which correlates the noise of neighbours.
    #[inline(always)]
    fn sigma(&self, sections: &Sections, brightest: &Lane, noise: &Noise<'_>) -> Lane {
        let kernel = noise.kernel.weights();
        let r = noise.kernel.radius();
        let last = sections.last_place();
        let rows = sections.candidate_rows();
        let mut variance = [0.0; LANES];
        // The raw sample at row `i - r` affects blurred samples up to r away.
        for i in rows.start..rows.end + 2 * r {
            let mut moved = [0.0; LANES];
            for near in i.saturating_sub(2 * r).max(rows.start)..(i + 1).min(rows.end) {
                let weight = f32::from(kernel[i - near]) / UNITS as f32;
                let (place, level) = (sections.place(near), sections.blurred[near]);
                for lane in 0..LANES {
                    let is_inside = (place[lane] >= 0.0) & (place[lane] <= last[lane]);
                    let t = place[lane] - brightest[lane];
                    let [g0, g1, g2] = lane_of(&self.gradient, lane);
                    // d(w ln G) = w dG / G: the weight times the derivative of the maximum with respect to the
                    // logarithm.
                    let by_level = (g0 + t * (g1 + t * g2)) * level[lane];
                    moved[lane] += if is_inside { by_level * weight } else { 0.0 };
                }
            }
            for lane in 0..LANES {
                // Beyond the candidate, use the level of its end.
                let row = (i as f32 - r as f32).max(sections.first[lane]).min(sections.last[lane]);
                let level = sections.blurred[row as usize][lane];
                variance[lane] += moved[lane]
                    * moved[lane]
                    * (noise.constant as f32 + noise.per_level as f32 * level);
            }
        }
        let gain = noise.kernel.noise_gain() as f32;
        each(|lane| {
            let by_peak = sections.peak[lane] * sections.peak[lane];
            (variance[lane] * gain).sqrt() / by_peak
        })
    }
}
