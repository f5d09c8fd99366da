//! Correlation of the errors of neighbouring points, which arises because a blur or a ridge filter averages the same
//! samples into both.

use super::blur::Kernel;
use crate::scanner::params::{ExtractionParams, Method};

/// 99.9 % quantile of a standard normal distribution.
const QUANTILE: f64 = 3.090_232_31;
/// Errors with a smaller correlation count as independent.
const INDEPENDENT: f64 = 0.05;
/// Minimum independent variance of points with almost equal errors, as a share of their variance: pixel locking,
/// rounding.
const MIN_OWN_VARIANCE: f64 = 0.05;

/// Correlation of the errors of two points as a function of their distance along the stripe.
#[derive(Clone, Debug)]
pub(crate) struct Correlation {
    /// At distances 0, 1, …; 0 beyond. The first is 1.
    by_distance: Vec<f64>,
}

impl Correlation {
    /// Returns the correlation for points found with these parameters, if the noise of the image is white.
    pub(crate) fn along_the_stripe(params: &ExtractionParams) -> Self {
        Self::of(&match params.method {
            Method::GrayGravity | Method::GaussianFit | Method::ImprovedGravity => {
                let kernel = Kernel::gaussian(params.blur_radius);
                kernel.weights().iter().map(|&weight| f64::from(weight)).collect()
            }
            Method::Steger => {
                let sigma_px = params.ridge_sigma_px;
                let radius = (4.0 * sigma_px).ceil() as i32;
                let weight = |x: i32| (-0.5 * (f64::from(x) / sigma_px).powi(2)).exp();
                (-radius..=radius).map(weight).collect::<Vec<_>>()
            }
            // They read only the samples of their own line.
            Method::GaussianMl | Method::LogGaussian | Method::FirPeak => vec![1.0],
        })
    }

    /// Returns the correlation of white noise after a filter with these weights: Σ w(i) w(i + d) / Σ w².
    fn of(weights: &[f64]) -> Self {
        let at = |distance: usize| -> f64 {
            weights.iter().zip(&weights[distance..]).map(|(a, b)| a * b).sum()
        };
        let energy = at(0);
        let by_distance: Vec<f64> =
            (0..weights.len()).map(|distance| at(distance) / energy).collect();
        let end = by_distance.iter().rposition(|&share| share > 1e-3).unwrap_or(0);
        Self { by_distance: by_distance[..=end].to_vec() }
    }

    /// Returns the smallest distance at which errors count as independent, at least 1.
    pub(super) fn independent_distance(&self) -> usize {
        let distance = self.by_distance.iter().position(|&share| share < INDEPENDENT);
        distance.unwrap_or(self.by_distance.len())
    }

    /// Returns the variance of the sum of errors at consecutive places with the standard deviations `sigmas`, signs
    /// included.
    pub(crate) fn variance(&self, sigmas: &[f64]) -> f64 {
        let product = |distance: usize| -> f64 {
            sigmas.iter().zip(&sigmas[distance..]).map(|(a, b)| a * b).sum()
        };
        let beyond = self.by_distance.iter().enumerate().take(sigmas.len()).skip(1);
        product(0) + 2.0 * beyond.map(|(distance, share)| share * product(distance)).sum::<f64>()
    }

    /// Returns the χ² of the residuals of a straight line through `num` consecutive points that chance exceeds in 0.1 %
    /// of the lines; 0 for fewer than 3 points.
    ///
    /// For independent errors this is the quantile of χ² with num − 2 degrees of freedom by Wilson and Hilferty 1931
    /// (doi 10.1073/pnas.17.12.684, eq. 3). Correlated errors spread less about their line: the degrees of freedom and
    /// the scale of χ² then follow from its mean and from Σ ρ², its variance (Satterthwaite 1946, doi 10.2307/3002019).
    pub(super) fn chi_square_limit(&self, num: usize) -> f64 {
        if num < 3 {
            return 0.0;
        }
        let mean = self.mean_chi_square(num).max(MIN_OWN_VARIANCE * (num - 2) as f64);
        let squares: f64 = self.by_distance[1..].iter().map(|share| share * share).sum();
        let unit = (1.0 + 2.0 * squares).min(mean);
        let degrees = mean / unit;
        let spread = 2.0 / (9.0 * degrees);
        mean * (1.0 - spread + QUANTILE * spread.sqrt()).powi(3)
    }

    /// Returns the mean χ²: the trace of (I − H) R for the line's hat matrix H and the correlations R.
    fn mean_chi_square(&self, num: usize) -> f64 {
        let middle = (num - 1) as f64 / 2.0;
        let places: Vec<f64> = (0..num).map(|at| at as f64 - middle).collect();
        let norm: f64 = places.iter().map(|place| place * place).sum();
        let level = self.variance(&vec![1.0; num]) / num as f64;
        num as f64 - level - self.variance(&places) / norm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(method: Method, blur_radius: u32) -> Correlation {
        let params = ExtractionParams { method, blur_radius, ..ExtractionParams::default() };
        Correlation::along_the_stripe(&params)
    }

    #[test]
    fn a_blur_of_three_equal_weights_gives_a_triangle() {
        let correlation = Correlation::of(&[1.0, 1.0, 1.0]);
        assert_eq!(correlation.by_distance, [1.0, 2.0 / 3.0, 1.0 / 3.0]);
        assert_eq!(correlation.independent_distance(), 3);
        // The mean for three such points: (3 + 2·2·2/3 + 2·1/3) / 9.
        let third = 1.0 / 3.0;
        assert!((correlation.variance(&[third; 3]) - (19.0 / 3.0) / 9.0).abs() < 1e-12);
    }

    #[test]
    fn unblurred_points_are_independent() {
        for correlation in [of(Method::GaussianFit, 0), of(Method::GaussianMl, 3)] {
            assert_eq!(correlation.by_distance, [1.0]);
            assert_eq!(correlation.independent_distance(), 1);
            // 99.9 % quantiles of χ² from tables.
            for (num, quantile, tolerance) in
                [(3, 10.828, 0.7), (5, 16.266, 0.4), (12, 29.588, 0.2)]
            {
                let limit = correlation.chi_square_limit(num);
                assert!((limit - quantile).abs() < tolerance, "{num} points: {limit}");
            }
        }
    }

    #[test]
    fn blurred_points_scatter_less_about_their_line() {
        let (blurred, own) = (of(Method::ImprovedGravity, 3), of(Method::ImprovedGravity, 0));
        for num in [3, 5, 9, 31] {
            let [blurred, own] = [&blurred, &own].map(|errors| errors.mean_chi_square(num));
            assert!(
                blurred < own && (own - (num - 2) as f64).abs() < 1e-9,
                "{num}: {blurred} {own}"
            );
        }
    }
}
