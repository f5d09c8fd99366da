//! What the calibration of a recording adds to the uncertainty of a figure.

use crate::{
    cli::results::Results,
    metrology::{calibration_error::perturbations, surface::Surface},
    scanner::{calibration::Calibration, params::StripeDirection},
};

/// One standard deviation of each figure by the calibration alone, or why it is not known: everything is measured again
/// with the calibration one standard deviation off along each of its principal axes.
pub(super) fn share<const N: usize>(
    results: &Results,
    surfaces: &[Surface],
    measure: impl Fn(&[Surface]) -> anyhow::Result<[f64; N]>,
) -> Result<[f64; N], String> {
    let text = results.calibration().ok_or("the recording carries no calibration")?;
    let calibration = Calibration::from_yaml(&text).map_err(|error| error.to_string())?;
    let direction =
        if results.is_vertical() { StripeDirection::Vertical } else { StripeDirection::Horizontal };
    let all = perturbations(&calibration, direction)?;
    let of = |surfaces: &[Surface]| measure(surfaces).map_err(|error| error.to_string());
    let nominal = of(surfaces)?;
    let mut squares = [0.0; N];
    for perturbation in all {
        let moved: Vec<_> = surfaces.iter().map(|surface| perturbation.apply(surface)).collect();
        for (square, (value, before)) in squares.iter_mut().zip(of(&moved)?.iter().zip(&nominal)) {
            *square += (value - before).powi(2);
        }
    }
    Ok(squares.map(f64::sqrt))
}
