//! Deviation of points from an ideal form.

/// Deviations from a form, as acceptance tests state them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Width of the narrowest band with 95 % of the points, metres: `D95 %` of ISO 10360-13:2021.
    pub d95_m: f64,
    /// One standard deviation of it, metres.
    pub d95_sigma_m: f64,
    /// Distance between the two extreme points, metres; grows with the number of points.
    pub peak_to_valley_m: f64,
}

/// Returns the form deviations of residuals, in metres; `effective` of the residuals are independent. `None` for fewer
/// than 20.
#[must_use]
pub(crate) fn form(residuals: &[f64], effective: f64) -> Option<Form> {
    let mut sorted: Vec<f64> = residuals.iter().copied().filter(|r| r.is_finite()).collect();
    let num = sorted.len();
    if num < 20 {
        return None;
    }
    sorted.sort_by(f64::total_cmp);
    let inside = (0.95 * num as f64).ceil() as usize;
    let starts = 0..=num - inside;
    let width = |start: &usize| sorted[start + inside - 1] - sorted[*start];
    let start = starts.min_by(|a, b| width(a).total_cmp(&width(b)))?;
    Some(Form {
        d95_m: width(&start),
        d95_sigma_m: sigma_of_band(&sorted, start, inside, effective),
        peak_to_valley_m: sorted[num - 1] - sorted[0],
    })
}

/// Returns one standard deviation of the width of the narrowest band with a share p of the points, `√(p(1-p)/n) / f`:
/// at the narrowest position both borders have the same density f, and shifting the band changes nothing (Grübel 1988).
fn sigma_of_band(sorted: &[f64], start: usize, inside: usize, effective: f64) -> f64 {
    let num = sorted.len();
    let reach = (num / 50).max(2);
    // Reciprocal of the density at an order statistic, from neighbouring order statistics.
    let spacing = |at: usize| {
        let (low, high) = (at.saturating_sub(reach), (at + reach).min(num - 1));
        (sorted[high] - sorted[low]) * num as f64 / (high - low) as f64
    };
    let density = 0.5 * (1.0 / spacing(start) + 1.0 / spacing(start + inside - 1));
    let share = inside as f64 / num as f64;
    (share * (1.0 - share) / effective.max(1.0)).sqrt() / density
}
