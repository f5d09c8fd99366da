//! The share of the calibration in the uncertainty of a measurement.

use super::{Results, Scanned};
use crate::{
    metrology::{
        calibration_error::{needs_positions, perturbations},
        surface::Surface,
    },
    scanner::calibration::Calibration,
};

/// Returns one standard deviation of each figure due to the calibration alone.
///
/// Repeats the measurement with the calibration shifted by one standard deviation along each of its principal axes, and adds
/// the changes in quadrature. `measure` receives one surface for each of `scanned`.
///
/// # Errors
/// The reason why the share is unknown: no calibration in the bag or none with a covariance, profiles placed by poses,
/// positions that are not recorded.
pub(crate) fn calibration_share<const N: usize>(
    results: &Results,
    scanned: &[&Scanned],
    measure: impl Fn(&[Surface]) -> anyhow::Result<[f64; N]>,
) -> Result<[f64; N], String> {
    let provenance = results.provenance();
    let text = provenance.calibration.as_ref().ok_or("the recording carries no calibration")?;
    let calibration = Calibration::from_yaml(text).map_err(|error| error.to_string())?;
    if provenance.is_posed() {
        return Err("profiles were placed by poses, through which it is not propagated".to_owned());
    }
    let all = perturbations(&calibration, results.stripe_direction()?)?;
    let positions = positions(results, &calibration, scanned)?;
    let of = |surfaces: &[Surface]| measure(surfaces).map_err(|error| error.to_string());
    let surfaces: Vec<_> = scanned.iter().map(|scanned| scanned.surface.clone()).collect();
    let nominal = of(&surfaces)?;
    let mut squares = [0.0; N];
    for perturbation in all {
        let both = surfaces.iter().zip(&positions);
        let moved: Vec<_> = both.map(|(surface, at)| perturbation.apply(surface, at)).collect();
        for (square, (value, before)) in squares.iter_mut().zip(of(&moved)?.iter().zip(&nominal)) {
            *square += (value - before).powi(2);
        }
    }
    Ok(squares.map(f64::sqrt))
}

/// Returns the position of each row of each surface; empty if the calibration does not need them.
pub(super) fn positions(
    results: &Results,
    calibration: &Calibration,
    scanned: &[&Scanned],
) -> Result<Vec<Vec<f64>>, String> {
    if !needs_positions(calibration) {
        return Ok(vec![Vec::new(); scanned.len()]);
    }
    let positions = results.positions()?;
    let of = |scanned: &&Scanned| {
        let rows = scanned.profile_numbers.iter().map(|row| positions.get(*row).copied());
        rows.collect::<Option<Vec<_>>>().ok_or_else(|| {
            format!(
                "{} positions are stated for {} profiles",
                positions.len(),
                scanned.counts.profiles
            )
        })
    };
    scanned.iter().map(of).collect()
}
