//! Calibration from known heights: fits the projective map from image positions to heights.

mod assignment;
mod bow;
mod fit;
mod lateral;
mod model;
mod order;
mod plateau;
mod uncertainty;
mod vertical_incidence;

pub use assignment::assign_heights;
pub use bow::LineBow;
pub use lateral::{KnownLateral, KnownLength, LateralScale};
pub use model::{HeightModel, HeightTerms};
pub use plateau::{GaugeHeight, GaugePlateau, Plateau, find_plateaus};
pub use vertical_incidence::{
    KnownDistance, VerticalGeometry, VerticalIncidenceError, vertical_incidence,
};

pub use crate::metrology::PlateauError;

use thiserror::Error;

use super::GaugePicture;
use crate::{metrology::student::NORMAL_95, scanner::calibration::range};
use fit::Fit;

/// Fewest different heights: a one-dimensional projective map has three parameters.
pub const MIN_HEIGHTS: usize = 3;
/// Significance level: terms along the stripe are added if chance alone would improve the fit as much in less than 1 of
/// 100 cases.
const CHANCE: f64 = 0.01;
/// Displacement by a lens in the corner of the image that goes unnoticed without redundancy, as a share of the distance
/// from the middle: usual lenses for machine vision stay below.
const LENS: f64 = 0.01;
/// Largest value of |x³ - x| between -1 and 1: the cubic displacement by a lens that a map through three heights leaves.
const CUBIC: f64 = 0.385;
/// Heights contradict the order of their positions from this many standard deviations on.
const REVERSED: f64 = 3.0;

/// The zero of the stated heights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeightReference {
    /// All heights are stated over one zero.
    #[default]
    Common,
    /// Heights are known relative to the others in the same picture only: the bed drifts between pictures. The first
    /// picture defines the zero of the map.
    EachPicture,
}

/// The map that is wanted.
#[derive(Clone, Copy, Debug)]
pub struct StepsRequest {
    /// Terms of the map; `None` adds terms along the stripe only if they fit better than by chance.
    pub terms: Option<HeightTerms>,
    /// Zero of the heights.
    pub reference: HeightReference,
    /// Size and direction of the pictures.
    pub picture: GaugePicture,
}

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
    /// Too few differences within the pictures.
    #[error(
        "{found} height differences within a picture are given, 2 or more are needed: a camera sees equal steps the smaller the farther they are"
    )]
    TooFewDifferences {
        /// Differences given.
        found: usize,
    },
    /// The heights determine the map exactly, and the gauge's uncertainty is unknown.
    #[error(
        "as many heights as the map has parameters: they fit exactly, and nothing shows how wrong they are. Give one more height, or \
         state the uncertainty of the gauge: 3.68mm±0.002mm, or --gauge-sigma for all heights"
    )]
    NoRedundancy,
    /// Some heights have an uncertainty, others do not.
    #[error(
        "the height {height_m} m has no uncertainty, others have one: state it for all but 0, or with --gauge-sigma for the rest"
    )]
    PartlyStated {
        /// A height without uncertainty, metres.
        height_m: f64,
    },
    /// The heights fit in both directions.
    #[error(
        "the heights fit whether a higher surface lies at smaller or at larger positions in the picture: state --height-sign -1 (smaller) \
         or 1 (larger), or give them in their order along the stripe"
    )]
    AmbiguousSign,
    /// Two heights of a picture can be exchanged.
    #[error(
        "the plateaus near {:.0} and {:.0} px along the stripe fit the heights {lower_m} m and {upper_m} m either way round: give the \
         heights in their order along the stripe", .places_px[0], .places_px[1]
    )]
    AmbiguousHeights {
        /// The lower height, metres.
        lower_m: f64,
        /// The higher one, metres.
        upper_m: f64,
        /// Middle of the plateaus to which they were assigned, pixels along the stripe.
        places_px: [f64; 2],
    },
    /// The stripe does not move with the height, or not always in the same direction.
    #[error(
        "the stripe does not move steadily with the height: {lower_m} m lies at {lower_px:.2} px, {upper_m} m at {upper_px:.2} px across the \
         stripe; are the heights in their order along the stripe? --any-order finds it; a tilted line needs --terms both"
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
    /// Height of each picture's zero over that of the first, metres; empty if all pictures have one zero.
    pub offsets_m: Vec<f64>,
    /// Root mean square of the residuals, metres.
    pub rms_m: f64,
    /// Largest residual as a share of the range of heights.
    pub linearity: f64,
    /// Number of independent heights beyond the unknowns; 0: the residuals carry no information. A height that is given
    /// several times counts once: its error is the same each time.
    pub degrees_of_freedom: usize,
    /// One standard deviation of a plateau's height, metres: from the stated uncertainty of the gauge and the noise of
    /// the lines, or from the residuals.
    pub sigma_m: f64,
    /// Half width of the 95 % interval, metres.
    pub u95_m: f64,
    /// True if the uncertainty of the gauge was stated, false if it was estimated from the residuals.
    pub is_stated: bool,
    /// Size of the residuals over what the stated uncertainty explains, if they contradict it; all uncertainties are
    /// widened accordingly.
    pub excess: Option<f64>,
    /// How the lines of the plateaus are curved, which widens `sigma_m` and `u95_m`, and what is measured with the calibration.
    pub bow: LineBow,
}

/// A plateau and its height by the map.
#[derive(Clone, Debug)]
pub struct PlateauCheck {
    /// The plateau.
    pub plateau: Plateau,
    /// Its height according to the map, over the zero of the stated height, metres.
    pub measured_m: f64,
    /// Its height according to the map fitted to all other plateaus, metres; `None` if those are too few.
    pub left_out_m: Option<f64>,
    /// One standard deviation of `measured_m` from the scatter along the line alone, metres.
    pub noise_m: f64,
}

/// Fits the map.
///
/// # Errors
/// Too few different heights, heights in another order than their positions, positions that fit no map, or as many
/// heights as unknowns without a stated uncertainty of the gauge.
pub fn calibrate_steps(
    plateaus: &[Plateau],
    request: &StepsRequest,
) -> Result<StepsCalibration, StepsError> {
    check_number(plateaus, request.reference)?;
    let fit = choose(plateaus, request)
        .ok_or_else(|| order::of_positions(plateaus).unwrap_or(StepsError::NoMap))?;
    let checks: Vec<_> = (0..plateaus.len())
        .map(|at| check(plateaus, at, &fit, request))
        .collect::<Option<_>>()
        .ok_or(StepsError::NoMap)?;
    order::check(&checks, request.reference)?;
    let lens_m = lens_m(&fit, plateaus, &request.picture);
    let found = uncertainty::of_fit(&fit, plateaus, lens_m)?;
    let bow = LineBow::new(&fit, plateaus).ok_or(StepsError::NoMap)?;
    let residuals = checks.iter().map(|c| c.measured_m - c.plateau.height.height_m);
    let squares: f64 = residuals.clone().map(|residual| residual * residual).sum();
    let heights_m = plateaus.iter().map(|plateau| plateau.height.height_m);
    let [lowest_m, highest_m] = range(heights_m).ok_or(StepsError::NoMap)?;
    let largest_m = residuals.fold(0.0, |largest: f64, r| largest.max(r.abs()));
    Ok(StepsCalibration {
        model: fit.model.with_covariance(found.covariance),
        rms_m: (squares / checks.len() as f64).sqrt(),
        linearity: largest_m / (highest_m - lowest_m),
        checks,
        offsets_m: fit.offsets_m,
        degrees_of_freedom: found.degrees_of_freedom,
        sigma_m: found.sigma_m.hypot(bow.rms_m()),
        u95_m: found.u95_m.hypot(NORMAL_95 * bow.rms_m()),
        bow,
        is_stated: found.is_stated,
        excess: found.excess,
    })
}

/// Returns the error in height that a lens may cause between the plateaus, if no height is left over to show it.
fn lens_m(fit: &Fit, plateaus: &[Plateau], picture: &GaugePicture) -> f64 {
    let across_px = range(plateaus.iter().map(|plateau| plateau.across_px));
    let [from, to]: [f64; 2] = across_px.unwrap_or_default();
    let [width, height] = picture.size_px.map(|px| 0.5 * f64::from(px));
    let error_px = LENS * CUBIC * (0.5 * (to - from)).powi(3) / (width * width + height * height);
    let slopes = plateaus.iter().filter_map(|plateau| {
        fit.model.slope_m_per_px([plateau.middle_px(), plateau.across_px]).map(f64::abs)
    });
    error_px * slopes.fold(0.0, f64::max)
}

/// Fits the map with the terms that are wanted, or those along the stripe too if they fit better than by chance.
fn choose(plateaus: &[Plateau], request: &StepsRequest) -> Option<Fit> {
    let fit = |term| Fit::new(plateaus, term, request.reference);
    match request.terms {
        Some(term) => fit(term),
        None => match (fit(HeightTerms::Across), fit(HeightTerms::Both)) {
            (Some(across), Some(both)) if !is_better(&both, &across, plateaus) => Some(across),
            (across, both) => both.or(across),
        },
    }
}

fn check(
    plateaus: &[Plateau],
    at: usize,
    fit: &Fit,
    request: &StepsRequest,
) -> Option<PlateauCheck> {
    let plateau = plateaus[at].clone();
    let place = [plateau.middle_px(), plateau.across_px];
    let others: Vec<_> =
        plateaus.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, p)| p.clone()).collect();
    let has_zero = request.reference == HeightReference::Common
        || others.iter().any(|other| other.picture == plateau.picture);
    let is_enough = has_zero && check_number(&others, request.reference).is_ok();
    let left_out =
        is_enough.then(|| Fit::new(&others, fit.model.term, request.reference)).flatten();
    let height_m = |fit: &Fit| Some(fit.model.height_m(place)? - fit.offset_m(plateau.picture));
    Some(PlateauCheck {
        measured_m: height_m(fit)?,
        left_out_m: left_out.and_then(|left_out| height_m(&left_out)),
        noise_m: fit.model.slope_m_per_px(place)?.abs() * plateau.sigma_px,
        plateau,
    })
}

/// Checks that there are at least three different heights, or two differences within pictures.
fn check_number(plateaus: &[Plateau], reference: HeightReference) -> Result<(), StepsError> {
    let mut heights: Vec<(usize, f64)> = plateaus
        .iter()
        .map(|plateau| match reference {
            HeightReference::Common => (0, plateau.height.height_m),
            HeightReference::EachPicture => (plateau.picture, plateau.height.height_m),
        })
        .collect();
    heights.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    heights.dedup();
    let mut pictures: Vec<usize> = heights.iter().map(|(picture, _)| *picture).collect();
    pictures.dedup();
    match reference {
        HeightReference::Common if heights.len() < MIN_HEIGHTS => {
            Err(StepsError::TooFew { found: heights.len() })
        }
        HeightReference::EachPicture if heights.len() < pictures.len() + 2 => {
            Err(StepsError::TooFewDifferences { found: heights.len() - pictures.len() })
        }
        _ => Ok(()),
    }
}

/// Returns true if the two additional parameters explain more than chance: in all positions, or in the inclinations of
/// the lines alone, which do not depend on the heights of the gauge.
fn is_better(both: &Fit, across: &Fit, plateaus: &[Plateau]) -> bool {
    let places = fit::places(plateaus, HeightTerms::Both);
    let num_offsets = both.offsets_m.len().saturating_sub(1);
    let of_all = both.squares(&places).zip(across.squares(&places));
    let of_inclinations = both.inclinations(plateaus).zip(across.inclinations(plateaus));
    let is_beyond = |squares: Option<(f64, f64)>, freedom: usize| {
        squares.is_some_and(|(with, without)| is_beyond_chance(with, without, freedom))
    };
    is_beyond(of_all, (2 * plateaus.len()).saturating_sub(5 + num_offsets))
        || is_beyond(of_inclinations, plateaus.len().saturating_sub(2))
}

/// Fisher's test, whose quantile has a closed form for two parameters. `with` and `without` are sums of squares,
/// `freedom` is the number of equations beyond the unknowns.
fn is_beyond_chance(with: f64, without: f64, freedom: usize) -> bool {
    if freedom < 1 || !(with.is_finite() && without.is_finite()) {
        return false;
    }
    let half = freedom as f64 / 2.0;
    let limit = half * (CHANCE.powf(-1.0 / half) - 1.0);
    (without - with) / 2.0 > limit * with / freedom as f64
}

#[cfg(test)]
mod any_order;
#[cfg(test)]
mod coverage;
#[cfg(test)]
mod tests;
