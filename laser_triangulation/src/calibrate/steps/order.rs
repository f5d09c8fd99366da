//! Checks that the stripe moves steadily with the height.

use super::{HeightReference, Plateau, PlateauCheck, REVERSED, StepsError};

/// Checks that the heights by the map lie in the order of the stated ones, within noise and gauge uncertainty.
///
/// # Errors
/// Two neighbouring heights in reverse order.
pub(super) fn check(checks: &[PlateauCheck], reference: HeightReference) -> Result<(), StepsError> {
    let group = |check: &PlateauCheck| match reference {
        HeightReference::Common => 0,
        HeightReference::EachPicture => check.plateau.picture,
    };
    let stated_m = |check: &PlateauCheck| check.plateau.height.height_m;
    let mut sorted: Vec<_> = checks.iter().collect();
    sorted.sort_by(|a, b| group(a).cmp(&group(b)).then(stated_m(a).total_cmp(&stated_m(b))));
    let variance_m2 = |check: &PlateauCheck| {
        check.noise_m.powi(2) + check.plateau.height.sigma_m.unwrap_or(0.0).powi(2)
    };
    for pair in sorted.windows(2) {
        let [lower, upper] = [pair[0], pair[1]];
        let is_step = group(lower) == group(upper) && stated_m(lower) < stated_m(upper);
        let limit_m = REVERSED * (variance_m2(lower) + variance_m2(upper)).sqrt();
        if is_step && lower.measured_m >= upper.measured_m + limit_m {
            return Err(reversed(&lower.plateau, &upper.plateau));
        }
    }
    Ok(())
}

/// Returns the error of heights that lie in another order than their positions, for those that fit no map at all.
pub(super) fn of_positions(plateaus: &[Plateau]) -> Option<StepsError> {
    let mut sorted: Vec<_> = plateaus.iter().collect();
    sorted.sort_by(|a, b| a.height.height_m.total_cmp(&b.height.height_m));
    let (first, last) = (sorted.first()?, sorted.last()?);
    let sense = (last.across_px - first.across_px).signum();
    sorted.windows(2).find_map(|pair| {
        let [lower, upper] = [pair[0], pair[1]];
        let is_step = lower.height.height_m < upper.height.height_m;
        let is_reversed = (upper.across_px - lower.across_px) * sense <= 0.0;
        (is_step && is_reversed).then(|| reversed(lower, upper))
    })
}

const fn reversed(lower: &Plateau, upper: &Plateau) -> StepsError {
    StepsError::Order {
        lower_m: lower.height.height_m,
        lower_px: lower.across_px,
        upper_m: upper.height.height_m,
        upper_px: upper.across_px,
    }
}
