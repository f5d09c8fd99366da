//! Calibration from known heights: fits the projective map from image positions to heights.

mod lateral;
mod model;
mod plateau;
mod vertical_incidence;

pub use lateral::KnownLateral;
pub use model::{HeightModel, HeightTerms};
pub use plateau::{GaugePlateau, Plateau, find_plateaus};
pub use vertical_incidence::{
    KnownDistance, VerticalGeometry, VerticalIncidenceError, vertical_incidence,
};

pub use crate::metrology::PlateauError;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::metrology::student::factor_95;

/// Fewest different heights: a one-dimensional projective map has three parameters.
pub const MIN_HEIGHTS: usize = 3;
/// Significance level: terms along the stripe are added if chance alone would improve the fit as much in less than 1 of
/// 100 cases.
const CHANCE: f64 = 0.01;

/// The reason why heights determine no map.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StepsError {
    /// Too few different heights.
    #[error(
        "{found} different heights are given, {MIN_HEIGHTS} or more are needed: a camera sees equal steps the smaller the farther they are"
    )]
    TooFew {
        /// Different heights given.
        found: usize,
    },
    /// The stripe does not move with the height, or not always in the same direction.
    #[error(
        "the stripe does not move steadily with the height: {lower_m} m lies at {lower_px:.2} px, {upper_m} m at {upper_px:.2} px across the stripe; are the heights in their order along the stripe?"
    )]
    Order {
        /// A height, metres.
        lower_m: f64,
        /// Its position across the stripe, pixels.
        lower_px: f64,
        /// The next height, metres.
        upper_m: f64,
        /// Its position across the stripe, pixels.
        upper_px: f64,
    },
    /// No map fits.
    #[error("no projective map takes these positions to these heights")]
    NoMap,
}

/// A calibrated map and how well it fits.
#[derive(Clone, Debug)]
pub struct StepsCalibration {
    /// Map from image positions to heights.
    pub model: HeightModel,
    /// Residual of each plateau, in the order given.
    pub checks: Vec<PlateauCheck>,
    /// Root mean square of the residuals, metres.
    pub rms_m: f64,
    /// Largest residual as a share of the range of heights.
    pub linearity: f64,
    /// Number of equations beyond the unknowns; 0: the residuals carry no information.
    pub degrees_of_freedom: usize,
    /// One standard deviation of a plateau's height, metres: the larger of the estimates from the residuals and from
    /// the noise of the lines.
    pub sigma_m: f64,
    /// Half width of the 95 % interval, metres; infinite without redundancy.
    pub u95_m: f64,
}

/// A plateau and its height by the map.
#[derive(Clone, Debug)]
pub struct PlateauCheck {
    /// The plateau.
    pub plateau: Plateau,
    /// Its height according to the map, metres.
    pub measured_m: f64,
    /// Its height according to the map fitted to all other plateaus, metres; `None` if those are too few.
    pub left_out_m: Option<f64>,
    /// One standard deviation of `measured_m` from the scatter along the line alone, metres.
    pub noise_m: f64,
}

/// Fits the map. `terms` selects its terms; `None` adds terms along the stripe only if they fit better than by chance.
///
/// # Errors
/// Fewer than three different heights, heights in another order than their positions, or positions that fit no map.
pub fn calibrate_steps(
    plateaus: &[Plateau],
    terms: Option<HeightTerms>,
) -> Result<StepsCalibration, StepsError> {
    check_heights(plateaus)?;
    let across = HeightModel::fit(plateaus, HeightTerms::Across).ok_or(StepsError::NoMap)?;
    let model = match terms {
        Some(HeightTerms::Across) => across,
        Some(HeightTerms::Both) => {
            HeightModel::fit(plateaus, HeightTerms::Both).ok_or(StepsError::NoMap)?
        }
        None => match HeightModel::fit(plateaus, HeightTerms::Both) {
            Some(both) if is_better(&both, &across, plateaus) => both,
            _ => across,
        },
    };
    let checks: Vec<_> = (0..plateaus.len())
        .map(|at| check(plateaus, at, &model))
        .collect::<Option<_>>()
        .ok_or(StepsError::NoMap)?;
    let residuals: Vec<_> = checks.iter().map(|c| c.measured_m - c.plateau.height_m).collect();
    let squares: f64 = residuals.iter().map(|residual| residual * residual).sum();
    let num = plateaus.len() as f64;
    let heights = || plateaus.iter().map(|plateau| plateau.height_m);
    let range_m = heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min);
    let largest_m = residuals.iter().fold(0.0, |largest: f64, r| largest.max(r.abs()));
    let noise_m = (checks.iter().map(|c| c.noise_m.powi(2)).sum::<f64>() / num).sqrt();
    // The terms along the stripe are determined by the inclinations of the lines, not by their middles.
    let degrees_of_freedom = plateaus.len().saturating_sub(3);
    let by_residuals_m =
        if degrees_of_freedom > 0 { (squares / degrees_of_freedom as f64).sqrt() } else { 0.0 };
    let sigma_m = by_residuals_m.max(noise_m);
    Ok(StepsCalibration {
        model: model.with_spread(plateaus, sigma_m),
        checks,
        rms_m: (squares / num).sqrt(),
        linearity: largest_m / range_m,
        degrees_of_freedom,
        sigma_m,
        u95_m: factor_95(degrees_of_freedom as f64) * sigma_m,
    })
}

fn check(plateaus: &[Plateau], at: usize, model: &HeightModel) -> Option<PlateauCheck> {
    let plateau = plateaus[at].clone();
    let place = [plateau.middle_px(), plateau.across_px];
    let others: Vec<_> =
        plateaus.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, p)| p.clone()).collect();
    let is_enough = check_heights(&others).is_ok();
    let left_out = if is_enough { HeightModel::fit(&others, model.term) } else { None };
    Some(PlateauCheck {
        measured_m: model.height_m(place)?,
        left_out_m: left_out.and_then(|model| model.height_m(place)),
        noise_m: model.slope_m_per_px(place)?.abs() * plateau.sigma_px,
        plateau,
    })
}

/// Checks that there are at least three different heights and that their positions are monotonic.
fn check_heights(plateaus: &[Plateau]) -> Result<(), StepsError> {
    let mut levels: Vec<(f64, f64)> = plateaus.iter().map(|p| (p.height_m, p.across_px)).collect();
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found = 1 + levels.windows(2).filter(|pair| pair[0].0 < pair[1].0).count();
    if levels.is_empty() || found < MIN_HEIGHTS {
        return Err(StepsError::TooFew { found: if levels.is_empty() { 0 } else { found } });
    }
    let (first, last) = (levels[0], levels[levels.len() - 1]);
    let sense = (last.1 - first.1).signum();
    for pair in levels.windows(2) {
        let ((lower_m, lower_px), (upper_m, upper_px)) = (pair[0], pair[1]);
        if lower_m < upper_m && (upper_px - lower_px) * sense <= 0.0 {
            return Err(StepsError::Order { lower_m, lower_px, upper_m, upper_px });
        }
    }
    Ok(())
}

/// Returns true if the two additional parameters explain more than chance: Fisher's test, whose quantile has a closed
/// form for two parameters.
fn is_better(both: &HeightModel, across: &HeightModel, plateaus: &[Plateau]) -> bool {
    let freedom = 2 * plateaus.len() as i64 - 5;
    let (with, without) = (both.squares(plateaus), across.squares(plateaus));
    if freedom < 1 || !(with.is_finite() && without.is_finite()) {
        return false;
    }
    let half = freedom as f64 / 2.0;
    let limit = half * (CHANCE.powf(-1.0 / half) - 1.0);
    (without - with) / 2.0 > limit * with / freedom as f64
}

/// Solves a linear least-squares problem by singular values; `None` if it is singular within rounding.
fn least_squares(rows: &DMatrix<f64>, values: &DVector<f64>) -> Option<DVector<f64>> {
    let svd = rows.clone().svd(true, true);
    let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
    if smallest.is_nan() || smallest <= 1e-10 * largest {
        return None;
    }
    svd.solve(values, 0.0).ok()
}

#[cfg(test)]
mod tests;
