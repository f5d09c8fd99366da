//! A weighted least-squares parabola, one per lane: the logarithm of a Gaussian.

use super::lanes::{Lane, lane_of};

/// The normal equations of y = p₀ + p₁t + p₂t², weights w.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NormalSums {
    /// Σ w tᵏ, k = 0 … 4.
    powers: [Lane; 5],
    /// Σ w tᵏ y, k = 0 … 2.
    right: [Lane; 3],
}

/// One lane's least-squares parabola. With too few samples its values are NaN.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parabola {
    /// p₀.
    pub(crate) constant: f32,
    /// p₁.
    pub(crate) slope: f32,
    /// p₂.
    pub(crate) curvature: f32,
    /// Σ w tᵏ, k = 0 … 2.
    pub(crate) sums: [f32; 3],
    /// The symmetric matrix a₁₁, a₁₂, a₂₂ of the two equations for p₁ and p₂ that are left without p₀.
    pub(crate) matrix: [f32; 3],
    /// Its determinant.
    pub(crate) determinant: f32,
}

impl NormalSums {
    /// Adds a sample `y` at the place `t`.
    #[inline(always)]
    pub(super) fn add(&mut self, lane: usize, weight: f32, t: f32, y: f32) {
        let (first, second) = (weight * t, weight * t * t);
        self.powers[0][lane] += weight;
        self.powers[1][lane] += first;
        self.powers[2][lane] += second;
        self.powers[3][lane] += second * t;
        self.powers[4][lane] += second * t * t;
        self.right[0][lane] += weight * y;
        self.right[1][lane] += first * y;
        self.right[2][lane] += second * y;
    }

    /// Solves the equations of one lane.
    #[inline(always)]
    pub(super) fn solve(&self, lane: usize) -> Parabola {
        let [s0, s1, s2, s3, s4] = lane_of(&self.powers, lane);
        let [r0, r1, r2] = lane_of(&self.right, lane);
        // p₀ eliminated: two equations for p₁ and p₂.
        let (a11, a12, a22) = (s2 - s1 * s1 / s0, s3 - s1 * s2 / s0, s4 - s2 * s2 / s0);
        let (b1, b2) = (r1 - s1 * r0 / s0, r2 - s2 * r0 / s0);
        let determinant = a11 * a22 - a12 * a12;
        let slope = (b1 * a22 - b2 * a12) / determinant;
        let curvature = (b2 * a11 - b1 * a12) / determinant;
        Parabola {
            constant: (r0 - slope * s1 - curvature * s2) / s0,
            slope,
            curvature,
            sums: [s0, s1, s2],
            matrix: [a11, a12, a22],
            determinant,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::lanes::LANES, *};

    #[test]
    fn samples_of_a_parabola_give_it_back_whatever_their_weights() {
        let mut sums = NormalSums::default();
        for (t, weight) in [(-2.0_f32, 1.0), (-1.0, 4.0), (0.0, 0.5), (2.0, 3.0)] {
            sums.add(LANES - 1, weight, t, 3.0 + 2.0 * t - 0.5 * t * t);
        }
        let parabola = sums.solve(LANES - 1);
        for (solved, expected) in
            [(parabola.constant, 3.0), (parabola.slope, 2.0), (parabola.curvature, -0.5)]
        {
            assert!((solved - expected).abs() < 1e-5, "{parabola:?}");
        }
        assert!(sums.solve(0).curvature.is_nan(), "no samples make no number");
    }
}
