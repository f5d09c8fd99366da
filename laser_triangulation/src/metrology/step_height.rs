//! The height of a step according to ISO 5436-1:2000, type A1.

use nalgebra::Point3;
use thiserror::Error;

use super::{
    correlation::inflation,
    plateaus::{self, Piece, PlateauError},
    robust::{self, Equation},
    student::factor_95,
    surface::{Surface, is_measured},
};
use crate::statistics::median;

/// Fewest points of each of the three parts of a profile.
const MIN_POINTS: usize = 4;
/// Noise level to which heights are scaled for the search of plateaus.
const NOISE: f64 = 0.05;
/// Smallest noise assumed in the search of plateaus, as a share of the range of heights: clean profiles have none.
const LEAST_NOISE: f64 = 3e-4;

/// A measured step with its uncertainty.
#[derive(Clone, Debug)]
pub struct StepHeight {
    /// Height of the middle part over the straight line through the outer ones, metres; a groove's is negative.
    pub height_m: f64,
    /// One standard deviation of the height, metres.
    pub sigma_m: f64,
    /// Half width of the 95 % interval, metres.
    pub u95_m: f64,
    /// Start and end of the middle part along the profile, metres.
    pub edges_m: [f64; 2],
    /// One standard deviation of the height of single profiles, metres.
    pub profile_sigma_m: f64,
    /// Number of profiles used.
    pub num_profiles: usize,
    /// Number of profiles with too few points.
    pub num_rejected: usize,
    /// Number of independent profiles with the same information.
    pub effective_profiles: f64,
    /// Angle between the surface beside the step and the plane z = 0, radians. The height is along z: perpendicular to an
    /// inclined surface the step is lower by the cosine.
    pub inclination_rad: f64,
}

/// The reason why no step height can be measured.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StepHeightError {
    /// No ridge or groove was found.
    #[error(
        "no ridge or groove was found: the profile has {}, three are needed (base, step, base); select a region with one step, or give the edges of the step", listed(.parts_m)
    )]
    Edges {
        /// Start and end of each level part found along the profile, metres.
        parts_m: Vec<[f64; 2]>,
    },
    /// The profile is too short to find the edges.
    #[error(
        "a profile of {0} points is too short to find the edges of a step; give the edges, or a larger region"
    )]
    Short(usize),
    /// The outer parts have different heights.
    #[error(
        "the parts beside the step differ by {difference_m:.3e} m, the step is {height_m:.3e} m: a stair, not a step of type A1"
    )]
    Stair {
        /// Difference of the outer parts, metres.
        difference_m: f64,
        /// Height of the middle part, metres.
        height_m: f64,
    },
    /// No profile has enough points.
    #[error(
        "none of {0} profiles has {MIN_POINTS} points in each of the three parts; left and right of the edges a third to a whole of the step's width is used"
    )]
    TooFew(usize),
}

fn listed(parts_m: &[[f64; 2]]) -> String {
    let places = parts_m.iter().map(|[from, to]| format!("{:.3} to {:.3}", 1e3 * from, 1e3 * to));
    let places = places.collect::<Vec<_>>().join(", ");
    let parts = if parts_m.len() == 1 { "part" } else { "parts" };
    format!("{} level {parts} ({places} mm)", parts_m.len())
}

/// Measures the step in every row of a surface, x being along the row. `edges_m`: start and end of the middle part;
/// `None` finds them in the median of all rows, which requires rows that run across the edges.
///
/// Each profile: `Z = α·X + β + h·δ` (ISO 5436-1:2000, 7.2), here with Tukey's weights; δ is 1 over the middle third of the
/// step and 0 over the outer parts, from one third to one width of the step away from each edge, so that h is the height.
/// The uncertainty of the mean comes from the scatter of the profiles, corrected for correlation by their effective
/// number.
///
/// # Errors
/// No step, or too few points.
pub fn measure(
    surface: &Surface,
    edges_m: Option<[f64; 2]>,
) -> Result<StepHeight, StepHeightError> {
    let edges_m = match edges_m {
        Some(edges_m) => edges_m,
        None => find_edges(surface)?,
    };
    let fits: Vec<Option<OneProfile>> =
        surface.rows().map(|row| one_profile(row, edges_m)).collect();
    let heights: Vec<f64> = fits.iter().flatten().map(|fit| fit.height_m).collect();
    let num = heights.len();
    if num == 0 {
        return Err(StepHeightError::TooFew(fits.len()));
    }
    let mean = heights.iter().sum::<f64>() / num as f64;
    let residuals: Vec<f64> = heights.iter().map(|height| height - mean).collect();
    let squares: f64 = residuals.iter().map(|residual| residual * residual).sum();
    let [factor, _] = inflation(&residuals, num);
    let effective = (num as f64 / factor).max(1.0);
    // The scatter of two profiles is less certain than the scatter within each.
    let (profile_sigma_m, freedom) = if num > 2 {
        ((squares / (num - 1) as f64).sqrt(), effective - 1.0)
    } else {
        (fits.iter().flatten().map(|fit| fit.sigma_m).sum::<f64>() / num as f64, 1e3)
    };
    let sigma_m = profile_sigma_m / effective.sqrt();
    Ok(StepHeight {
        height_m: mean,
        sigma_m,
        u95_m: factor_95(freedom) * sigma_m,
        edges_m,
        profile_sigma_m,
        num_profiles: num,
        num_rejected: fits.len() - num,
        effective_profiles: effective,
        inclination_rad: inclination_rad(fits.iter().flatten()),
    })
}

/// The step in one profile.
struct OneProfile {
    height_m: f64,
    /// One standard deviation of the height, metres.
    sigma_m: f64,
    /// Place across the profile, metres.
    y_m: f64,
    /// Height of the line through the outer parts below the middle of the step, metres, and its slope.
    base: [f64; 2],
}

/// Returns the inclination of the surface beside the step; along the profiles alone if they lie at one place.
fn inclination_rad<'a>(profiles: impl Iterator<Item = &'a OneProfile>) -> f64 {
    let (mut slopes, mut levels) = (Vec::new(), Vec::new());
    for OneProfile { y_m, base: [level_m, slope], .. } in profiles {
        slopes.push(*slope);
        levels.push(Equation { row: [1.0, *y_m].into(), value: *level_m });
    }
    let along = median(&mut slopes).unwrap_or(0.0);
    let across = robust::solve(&levels).map_or(0.0, |fit| fit.x[1]);
    along.hypot(across).atan()
}

/// Returns the step in one profile; `None` if a part has too few points.
fn one_profile(row: &[Point3<f64>], [left, right]: [f64; 2]) -> Option<OneProfile> {
    let width = right - left;
    let middle = 0.5 * (left + right);
    let part = |x: f64| {
        let outside = (left - x).max(x - right);
        if (x - middle).abs() <= width / 6.0 {
            Some(1)
        } else if (width / 3.0..=width).contains(&outside) {
            Some(if x < middle { 0 } else { 2 })
        } else {
            None
        }
    };
    let (mut counts, mut sum_y_m) = ([0; 3], 0.0);
    let mut equations: Vec<Equation<3>> = Vec::with_capacity(row.len());
    for point in row.iter().filter(|point| is_measured(point)) {
        let Some(part) = part(point.x) else { continue };
        counts[part] += 1;
        sum_y_m += point.y;
        let delta = if part == 1 { 1.0 } else { 0.0 };
        let row = [1.0, (point.x - middle) / width, delta].into();
        equations.push(Equation { row, value: point.z });
    }
    if counts.iter().any(|count| *count < MIN_POINTS) {
        return None;
    }
    let fit = robust::solve(&equations)?;
    let correlated = inflation(&fit.residuals, fit.residuals.len())[0];
    Some(OneProfile {
        height_m: fit.x[2],
        sigma_m: (correlated * fit.covariance[(2, 2)]).sqrt(),
        y_m: sum_y_m / equations.len() as f64,
        base: [fit.x[0], fit.x[1] / width],
    })
}

/// Finds the edges of the step in the median of all rows.
fn find_edges(surface: &Surface) -> Result<[f64; 2], StepHeightError> {
    let profile = median_profile(surface);
    let mut steps: Vec<f64> =
        profile.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs()).collect();
    let low = profile.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min);
    let high = profile.iter().map(|point| point[1]).fold(f64::NEG_INFINITY, f64::max);
    let noise = median(&mut steps).unwrap_or(0.0).max(LEAST_NOISE * (high - low));
    let scale = |z: f64| if noise > 0.0 { z * NOISE / noise } else { 0.0 };
    let scaled: Vec<_> = profile.iter().map(|[x, z]| [*x, scale(*z)]).collect();
    let pieces = plateaus::cut(&scaled, 3).map_err(|error| match error {
        PlateauError::Count { places, .. } => StepHeightError::Edges { parts_m: places },
        _ => StepHeightError::Short(profile.len()),
    })?;
    let (difference_m, height_m) = levels(&profile, &pieces).ok_or(StepHeightError::TooFew(1))?;
    if difference_m.abs() > 0.5 * height_m.abs() {
        return Err(StepHeightError::Stair { difference_m, height_m });
    }
    let between = |at: usize| 0.5 * (profile[at - 1][0] + profile[at][0]);
    Ok([between(pieces[1].whole.start), between(pieces[1].whole.end)])
}

/// Returns the height of the last part over the first one, and of the middle one over the mean of both, with a common
/// inclination, metres.
fn levels(profile: &[[f64; 2]], pieces: &[Piece]) -> Option<(f64, f64)> {
    let (from, to) = (profile[0][0], profile[profile.len() - 1][0]);
    let equations = pieces.iter().enumerate().flat_map(|(part, piece)| {
        let is = move |wanted: usize| if part == wanted { 1.0 } else { 0.0 };
        let points = profile[piece.inner.clone()].iter();
        points.map(move |[x, z]| Equation {
            row: [1.0, (x - from) / (to - from), is(1), is(2)].into(),
            value: *z,
        })
    });
    let x = robust::solve(&equations.collect::<Vec<_>>())?.x;
    Some((x[3], x[2] - 0.5 * x[3]))
}

/// Returns median position and height of every column, ascending along the row.
fn median_profile(surface: &Surface) -> Vec<[f64; 2]> {
    let mut profile = Vec::with_capacity(surface.width);
    for column in 0..surface.width {
        let points = surface.points.iter().skip(column).step_by(surface.width);
        let points: Vec<_> = points.filter(|point| is_measured(point)).collect();
        let [x, z] = [|p: &Point3<f64>| p.x, |p: &Point3<f64>| p.z]
            .map(|of| median(&mut points.iter().map(|point| of(point)).collect::<Vec<_>>()));
        profile.extend(x.zip(z).map(|(x, z)| [x, z]));
    }
    profile.sort_by(|a, b| a[0].total_cmp(&b[0]));
    profile
}

#[cfg(test)]
mod tests;
