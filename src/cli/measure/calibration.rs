//! What the calibration of a recording adds to the uncertainty of a figure.

use crate::{
    cli::results::{Results, Scanned},
    metrology::{
        calibration_error::{needs_positions, perturbations},
        surface::Surface,
    },
    scanner::{calibration::Calibration, params::StripeDirection},
};

/// One standard deviation of each figure by the calibration alone, or why it is not known: everything is measured again
/// with the calibration one standard deviation off along each of its principal axes.
pub(super) fn share<const N: usize>(
    results: &Results,
    scanned: &[&Scanned],
    measure: impl Fn(&[Surface]) -> anyhow::Result<[f64; N]>,
) -> Result<[f64; N], String> {
    let text = results.calibration().ok_or("the recording carries no calibration")?;
    let calibration = Calibration::from_yaml(&text).map_err(|error| error.to_string())?;
    if results.is_posed() {
        return Err("profiles were placed by poses, through which it is not propagated".to_owned());
    }
    let direction =
        if results.is_vertical() { StripeDirection::Vertical } else { StripeDirection::Horizontal };
    let all = perturbations(&calibration, direction)?;
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

/// The positions of the rows of each surface; none of any where y says enough.
fn positions(
    results: &Results,
    calibration: &Calibration,
    scanned: &[&Scanned],
) -> Result<Vec<Vec<f64>>, String> {
    if !needs_positions(calibration) {
        return Ok(vec![Vec::new(); scanned.len()]);
    }
    let positions = results.positions()?;
    let of = |scanned: &&Scanned| {
        let rows = scanned.rows.iter().map(|row| positions.get(*row).copied());
        rows.collect::<Option<Vec<_>>>().ok_or_else(|| {
            format!(
                "{} positions are stated for {} profiles",
                positions.len(),
                scanned.read.profiles
            )
        })
    };
    scanned.iter().map(of).collect()
}
