//! The normal equations of one round of Fisher scoring, and their solution.
//!
//! Unknowns, in this order and relative so that all have similar size: ln A, ln s, B / A, c / s. The centre comes last,
//! so its uncertainty is the last pivot of the factorisation.

use super::{
    super::{
        lanes::{LANES, Lane, Sections, each},
        noise::PixelNoise,
    },
    LanePrior, STILL_CENTRE, STILL_SHAPE,
    curve::{Curve, Pixel, PixelWidth},
    likelihood::{Evidence, clipped, measured},
    start::Start,
};

/// Σ information ∇μ ∇μᵀ / A², upper triangle row by row, and Σ score ∇μ / A.
pub(super) struct NormalEquations {
    matrix: [Lane; 10],
    right: [Lane; 4],
    amplitude: Lane,
}

/// One lane's step and the uncertainty of its centre.
pub(super) struct Solution {
    /// Step of ln A, ln s, B / A and c / s.
    pub(super) step: [f32; 4],
    /// Variance of c / s.
    pub(super) centre_variance: f32,
}

impl Solution {
    /// True if another round would change nothing significant.
    #[inline(always)]
    pub(super) fn still(&self) -> bool {
        let [amplitude, sigma, _, centre] = self.step;
        (centre * centre < STILL_CENTRE * STILL_CENTRE * self.centre_variance)
            & (amplitude.abs() < STILL_SHAPE)
            & (sigma.abs() < STILL_SHAPE)
    }
}

impl NormalEquations {
    /// Sets up the equations at that curve, from the rows that `start` holds.
    #[inline(always)]
    pub(super) fn of(
        sections: &Sections,
        start: &Start,
        curve: &Curve,
        noise: PixelNoise,
        full_scale: f32,
    ) -> Self {
        let none = [0.0; LANES];
        let mut equations =
            Self { matrix: [none; 10], right: [none; 4], amplitude: curve.amplitude };
        let inverse: Lane = each(|lane| 1.0 / curve.sigma_px[lane]);
        let width: [PixelWidth; LANES] =
            std::array::from_fn(|lane| PixelWidth::of(curve.sigma_px[lane]));
        for i in start.rows(sections) {
            let place = sections.place(i);
            let samples = sections.raw[i];
            let is_clipped = samples.iter().any(|&sample| sample <= 0.0 || sample >= full_scale);
            for lane in 0..LANES {
                let u = (place[lane] - curve.centre_px[lane]) * inverse[lane];
                let pixel = Pixel::at(u, width[lane]);
                let level = curve.amplitude[lane] * pixel.level + curve.background[lane];
                let sample = samples[lane];
                let mut evidence = measured(sample, level, noise);
                if is_clipped {
                    let censored = clipped(sample, level, full_scale, noise);
                    let cut = sample <= 0.0 || sample >= full_scale;
                    evidence.score = if cut { censored.score } else { evidence.score };
                    evidence.information =
                        if cut { censored.information } else { evidence.information };
                }
                let holds = start.holds(i as f32, lane);
                evidence.score = if holds { evidence.score } else { 0.0 };
                evidence.information = if holds { evidence.information } else { 0.0 };
                equations.add(lane, pixel, evidence);
            }
        }
        equations
    }

    #[inline(always)]
    fn add(&mut self, lane: usize, pixel: Pixel, evidence: Evidence) {
        let Pixel { level, by_centre, by_sigma } = pixel;
        let Evidence { score, information } = evidence;
        let weighted = (information * level, information * by_sigma, information * by_centre);
        self.matrix[0][lane] += weighted.0 * level;
        self.matrix[1][lane] += weighted.0 * by_sigma;
        self.matrix[2][lane] += weighted.0;
        self.matrix[3][lane] += weighted.0 * by_centre;
        self.matrix[4][lane] += weighted.1 * by_sigma;
        self.matrix[5][lane] += weighted.1;
        self.matrix[6][lane] += weighted.1 * by_centre;
        self.matrix[7][lane] += information;
        self.matrix[8][lane] += weighted.2;
        self.matrix[9][lane] += weighted.2 * by_centre;
        self.right[0][lane] += score * level;
        self.right[1][lane] += score * by_sigma;
        self.right[2][lane] += score;
        self.right[3][lane] += score * by_centre;
    }

    /// Solves one lane's equations by the factorisation J = L D Lᵀ.
    #[inline(always)]
    pub(super) fn solve(&self, lane: usize, prior: &LanePrior) -> Solution {
        let amplitude = self.amplitude[lane];
        let square = amplitude * amplitude;
        let m = |k: usize| self.matrix[k][lane] * square;
        let (m1, m2, m3, m5, m6, m8) = (m(1), m(2), m(3), m(5), m(6), m(8));
        let [p0, p1, p2, p3] = prior.precision;
        let (a00, a11, a22, a33) = (m(0) + p0, m(4) + p1, m(7) + p2, m(9) + p3);
        let r = |k: usize| self.right[k][lane] * amplitude;
        let g = prior.gradient;
        let b = [r(0) + g[0], r(1) + g[1], r(2) + g[2], r(3) + g[3]];
        // A pivot lost to rounding is limited to the rounding error.
        let pivot = |d: f32, of: f32| d.max(1e-6 * of);
        let d0 = 1.0 / a00;
        let (l1, l2, l3) = (m1 * d0, m2 * d0, m3 * d0);
        let d1 = 1.0 / pivot(a11 - l1 * m1, a11);
        let (e2, e3) = (m5 - l1 * m2, m6 - l1 * m3);
        let (k2, k3) = (e2 * d1, e3 * d1);
        let d2 = 1.0 / pivot(a22 - l2 * m2 - k2 * e2, a22);
        let f3 = m8 - l2 * m3 - k2 * e3;
        let j3 = f3 * d2;
        let d3 = 1.0 / pivot(a33 - l3 * m3 - k3 * e3 - j3 * f3, a33);
        let y1 = b[1] - l1 * b[0];
        let y2 = b[2] - l2 * b[0] - k2 * y1;
        let y3 = b[3] - l3 * b[0] - k3 * y1 - j3 * y2;
        let x3 = y3 * d3;
        let x2 = y2 * d2 - j3 * x3;
        let x1 = y1 * d1 - k2 * x2 - k3 * x3;
        let x0 = b[0] * d0 - l1 * x1 - l2 * x2 - l3 * x3;
        Solution { step: [x0, x1, x2, x3], centre_variance: d3 }
    }
}
