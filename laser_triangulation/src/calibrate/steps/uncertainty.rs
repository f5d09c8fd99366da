//! The uncertainty of a map of heights: from the stated uncertainty of the gauge, or from the residuals.
//!
//! Errors of the gauge are common to all plateaus of one stated height, so repeating a height does not reveal them. The
//! noise of the lines is independent from plateau to plateau. Both are propagated through the fit, which weights all
//! plateaus equally.

use nalgebra::{DMatrix, DVector};

use super::{
    GaugeHeight, HeightTerms, Plateau, StepsError,
    fit::{self, Fit},
};
use crate::metrology::student::{NORMAL_95, factor_95};

/// Residuals contradict the stated uncertainty if chance alone would make them as large in less than 1 of 100 cases.
/// Quantile of the normal distribution.
const CONTRADICTED: f64 = 2.326_3;

/// The uncertainty of a map.
pub(super) struct Uncertainty {
    /// Covariance of the map's values. 95 % of the errors lie within 1.96 standard deviations, however few heights it is
    /// estimated from.
    pub(super) covariance: DMatrix<f64>,
    /// Number of independent heights beyond those that determine the map.
    pub(super) degrees_of_freedom: usize,
    /// One standard deviation of a plateau's height, metres.
    pub(super) sigma_m: f64,
    /// Half width of the 95 % interval of a plateau's height, metres.
    pub(super) u95_m: f64,
    /// Root mean square of the residuals over what the stated uncertainty explains, if it contradicts them.
    pub(super) excess: Option<f64>,
    /// True if the gauge's uncertainty was stated.
    pub(super) is_stated: bool,
}

/// Returns the uncertainty of a fit. `lens_m` is the error that a lens may cause between plateaus, which counts if no
/// height is left over to show it.
///
/// # Errors
/// Neither an uncertainty of the gauge nor heights left over; some heights with an uncertainty and some without.
pub(super) fn of_fit(
    fit: &Fit,
    plateaus: &[Plateau],
    lens_m: f64,
) -> Result<Uncertainty, StepsError> {
    let equations = Equations::new(fit, plateaus).ok_or(StepsError::NoMap)?;
    let stated = stated_sigmas(plateaus)?;
    let degrees_of_freedom = equations.redundancy().round() as usize;
    let factor = factor_95(degrees_of_freedom as f64);
    let is_stated = stated.is_some();
    let (variance, excess) = match stated {
        Some(sigmas) => equations.stated(&sigmas, degrees_of_freedom, lens_m),
        None if degrees_of_freedom == 0 => return Err(StepsError::NoRedundancy),
        None => (equations.estimated(factor / NORMAL_95), None),
    };
    let all = &equations.solver * &variance * equations.solver.transpose();
    let num = fit.model.values().len();
    let u95_m = NORMAL_95 * equations.mean_height_variance(&variance).sqrt();
    Ok(Uncertainty {
        covariance: all.view((0, 0), (num, num)).into_owned(),
        degrees_of_freedom,
        sigma_m: u95_m / if is_stated { NORMAL_95 } else { factor },
        u95_m,
        excess,
        is_stated,
    })
}

/// Returns the stated standard deviation of every plateau's height; `None` if none is stated. A zero without one is the
/// gauge's reference, and exact.
fn stated_sigmas(plateaus: &[Plateau]) -> Result<Option<Vec<f64>>, StepsError> {
    if plateaus.iter().all(|plateau| plateau.height.sigma_m.is_none()) {
        return Ok(None);
    }
    let sigma = |plateau: &Plateau| match plateau.height {
        GaugeHeight { sigma_m: Some(sigma_m), .. } => Ok(sigma_m),
        GaugeHeight { height_m: 0.0, .. } => Ok(0.0),
        GaugeHeight { height_m, .. } => Err(StepsError::PartlyStated { height_m }),
    };
    plateaus.iter().map(sigma).collect::<Result<_, _>>().map(Some)
}

/// The linearised equations of a fit.
struct Equations {
    /// From heights to values of the map.
    solver: DMatrix<f64>,
    /// From errors of heights to residuals.
    away: DMatrix<f64>,
    residuals: DVector<f64>,
    /// Variance of the noise of each equation.
    noise: DMatrix<f64>,
    /// Projects on the mean height of each plateau. The rest is the inclination of the lines.
    means: DMatrix<f64>,
    /// A column for each different height: 1 in its equations.
    gauge: DMatrix<f64>,
    /// Column of `gauge` of each plateau.
    height_of: Vec<usize>,
    /// Equations per plateau.
    each: f64,
}

impl Equations {
    fn new(fit: &Fit, plateaus: &[Plateau]) -> Option<Self> {
        let places = fit::places(plateaus, fit.model.term);
        let (jacobian, residuals) = fit.linearised(&places)?;
        let solver = fit::solver(&jacobian)?;
        let num = places.len();
        let each = if fit.model.term == HeightTerms::Both { 2.0 } else { 1.0 };
        let mut heights: Vec<f64> = Vec::new();
        let mut height_of = Vec::with_capacity(plateaus.len());
        for GaugeHeight { height_m, .. } in plateaus.iter().map(|plateau| plateau.height) {
            let known = heights.iter().position(|known| known.total_cmp(&height_m).is_eq());
            height_of.push(known.unwrap_or(heights.len()));
            if known.is_none() {
                heights.push(height_m);
            }
        }
        let noise_m2: Option<Vec<f64>> = places
            .iter()
            .map(|place| {
                let slope = fit.model.slope_m_per_px(place.px)?;
                Some(each * (slope * plateaus[place.plateau].sigma_px).powi(2))
            })
            .collect();
        let same = |i: usize, j: usize| places[i].plateau == places[j].plateau;
        Some(Self {
            away: DMatrix::identity(num, num) - jacobian * &solver,
            solver,
            residuals,
            noise: DMatrix::from_diagonal(&DVector::from_vec(noise_m2?)),
            means: DMatrix::from_fn(num, num, |i, j| if same(i, j) { 1.0 / each } else { 0.0 }),
            gauge: DMatrix::from_fn(num, heights.len(), |i, j| {
                f64::from(u8::from(height_of[places[i].plateau] == j))
            }),
            height_of,
            each,
        })
    }

    /// Returns how many independent errors of the gauge the residuals show: 0 if any heights would fit.
    fn redundancy(&self) -> f64 {
        let shares = self.gauge.column_iter().map(|column| {
            (column.transpose() * &self.away * column)[(0, 0)] / column.norm_squared()
        });
        shares.sum()
    }

    /// Returns the variance of all heights for a gauge whose uncertainty is estimated from the residuals, enlarged by
    /// the factor for their small number.
    fn estimated(&self, factor: f64) -> DMatrix<f64> {
        let (noise, [mean_m2, _]) = (self.with_inclinations(small_sample), self.observed());
        let explained_m2 = (&self.means * self.seen(&noise)).trace();
        let seen = (&self.means * &self.away * &self.gauge).norm_squared();
        let gauge_m2 = ((factor.powi(2) * mean_m2 - explained_m2) / seen).max(0.0);
        noise + &self.gauge * self.gauge.transpose() * gauge_m2
    }

    /// Returns the variance of all heights for a gauge of known uncertainty, and the ratio of the residuals to it if it
    /// is contradicted.
    fn stated(
        &self,
        sigmas_m: &[f64],
        degrees_of_freedom: usize,
        lens_m: f64,
    ) -> (DMatrix<f64>, Option<f64>) {
        let mut of_heights = DVector::zeros(self.gauge.ncols());
        for (height, sigma_m) in self.height_of.iter().zip(sigmas_m) {
            of_heights[*height] = sigma_m.powi(2).max(of_heights[*height]);
        }
        let gauge = &self.gauge * DMatrix::from_diagonal(&of_heights) * self.gauge.transpose();
        let variance = self.with_inclinations(|_| 1.0) + gauge;
        let is_checked = degrees_of_freedom > 0;
        let lens_m2 = if is_checked { 0.0 } else { self.each * lens_m.powi(2) };
        let variance = variance + &self.means * lens_m2;
        let freedom = (&self.means * &self.away).trace();
        let expected = &self.means * self.seen(&variance) * &self.means;
        let effective = expected.trace().powi(2) / (&expected * &expected).trace();
        let (observed_m2, expected_m2) = (self.observed()[0], expected.trace());
        let ratio = observed_m2 / expected_m2;
        if freedom < 0.5 || ratio.is_nan() || ratio <= largest_ratio(effective) {
            return (variance, None);
        }
        let widened = if is_checked {
            variance * (ratio * small_sample(effective).powi(2))
        } else {
            // Equal heights in different places contradict each other, whatever the gauge's errors are.
            let more_m2 = small_sample(freedom).powi(2) * observed_m2 - expected_m2;
            variance + &self.means * (more_m2 / freedom)
        };
        (widened, Some(ratio.sqrt()))
    }

    /// Returns the noise of the lines, and what the inclinations of the lines scatter beyond it, enlarged by a factor
    /// that depends on their number.
    fn with_inclinations(&self, factor: impl Fn(f64) -> f64) -> DMatrix<f64> {
        let num = self.noise.nrows();
        let rest = DMatrix::identity(num, num) - &self.means;
        let seen = (&rest * &self.away * &rest).trace();
        if seen < 0.5 {
            return self.noise.clone();
        }
        let explained_m2 = (&rest * self.seen(&self.noise)).trace();
        let more_m2 = (factor(seen).powi(2) * self.observed()[1] - explained_m2) / seen;
        &self.noise + rest * more_m2.max(0.0)
    }

    /// Returns the variance of the residuals that a variance of heights causes.
    fn seen(&self, variance: &DMatrix<f64>) -> DMatrix<f64> {
        &self.away * variance * &self.away
    }

    /// Returns the sum of squared residuals of the plateaus' means, and of the rest.
    fn observed(&self) -> [f64; 2] {
        let of_means = (&self.means * &self.residuals).norm_squared();
        [of_means, (self.residuals.norm_squared() - of_means).max(0.0)]
    }

    fn mean_height_variance(&self, variance: &DMatrix<f64>) -> f64 {
        (&self.means * variance).trace() / self.noise.nrows() as f64
    }
}

/// Returns the factor that enlarges a standard deviation from few values so that 1.96 of it hold 95 %.
fn small_sample(degrees_of_freedom: f64) -> f64 {
    factor_95(degrees_of_freedom.max(1.0)) / NORMAL_95
}

/// Returns the ratio of a sum of squares to its expectation that chance exceeds in 1 of 100 cases: the quantile of chi
/// square over its degrees of freedom (Wilson and Hilferty 1931).
fn largest_ratio(degrees_of_freedom: f64) -> f64 {
    let variance = 2.0 / (9.0 * degrees_of_freedom);
    (1.0 - variance + CONTRADICTED * variance.sqrt()).powi(3)
}
