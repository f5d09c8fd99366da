//! Compares the reported positions of the axis with those that the pictures show.

use thiserror::Error;

use crate::statistics::{median, sigma_about_zero};

/// Number of robust standard deviations beyond which a picture is suspicious.
const SUSPICIOUS_SIGMAS: f64 = 5.0;
/// Relative deviation of the scale below which the stated unit is accepted.
const SAME_UNIT: f64 = 0.01;

/// Number of pictures whose pairwise distances are used.
const MAX_PAIRED: usize = 400;

/// A picture and its positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Position {
    /// Position reported by the joint or encoder, in its unit.
    pub(crate) stated: f64,
    /// Position observed in the picture, radians or metres.
    pub(crate) shown: f64,
}

/// The relation of reported and observed positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// Observed motion per reported unit; negative if the directions are opposite.
    pub scale: f64,
    /// One standard deviation of the scale.
    pub scale_sigma: f64,
    /// Observed minus expected position of each picture, radians or metres.
    pub off: Vec<f64>,
    /// Pictures that lag or lead.
    pub suspicious: Vec<usize>,
    /// Robust standard deviation of the others, radians or metres.
    pub sigma: f64,
}

/// The reason why positions cannot be compared.
#[derive(Debug, Error, PartialEq)]
pub enum PositionError {
    /// The reported positions do not change.
    #[error(
        "the stated positions do not change: the axis stood still, or the joint is another one"
    )]
    Still,
    /// Reported and observed positions are unrelated.
    #[error(
        "the stated positions explain the pictures only to {off} of the distance moved: the joint is another one, or most \
         pictures lag"
    )]
    Unrelated {
        /// Median deviation as a share of the whole movement.
        off: String,
    },
}

/// Compares the positions robustly: up to a third of the pictures may lag.
///
/// # Errors
/// Reported positions that do not change, or are unrelated to the pictures.
pub(super) fn compare(positions: &[Position]) -> Result<Agreement, PositionError> {
    let mut slopes = Vec::new();
    let ends = |values: &dyn Fn(&Position) -> f64| {
        let ends = positions
            .iter()
            .map(values)
            .fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
        ends.1 - ends.0
    };
    let (stated_range, shown_range) = (ends(&|p| p.stated), ends(&|p| p.shown));
    // A few hundred out of thousands of pictures suffice to determine the slope.
    let some: Vec<_> =
        positions.iter().step_by(positions.len().div_ceil(MAX_PAIRED).max(1)).collect();
    for (i, one) in some.iter().enumerate() {
        for other in &some[i + 1..] {
            // Short distances carry little information.
            if (other.stated - one.stated).abs() > 0.2 * stated_range {
                slopes.push((other.shown - one.shown) / (other.stated - one.stated));
            }
        }
    }
    // Theil's estimate of the slope.
    let scale = median(&mut slopes).filter(|s| s.is_finite()).ok_or(PositionError::Still)?;
    let mut offsets: Vec<_> = positions.iter().map(|p| p.shown - scale * p.stated).collect();
    let offset = median(&mut offsets).ok_or(PositionError::Still)?;
    let off: Vec<_> = positions.iter().map(|p| p.shown - scale * p.stated - offset).collect();
    let mut sizes: Vec<_> = off.iter().map(|off| off.abs()).collect();
    let sigma = sigma_about_zero(&mut sizes).ok_or(PositionError::Still)?;
    if sigma > 0.1 * shown_range {
        let off = format!("{:.0} %", 100.0 * sigma / shown_range);
        return Err(PositionError::Unrelated { off });
    }
    // Deviations below a ten thousandth of the movement are not reported.
    let limit = (SUSPICIOUS_SIGMAS * sigma).max(1e-4 * shown_range);
    let suspicious: Vec<_> = (0..off.len()).filter(|&i| off[i].abs() > limit).collect();
    let good = || (0..off.len()).filter(|i| !suspicious.contains(i)).map(|i| positions[i].stated);
    let count = good().count() as f64;
    let mean = good().sum::<f64>() / count;
    let spread = good().map(|stated| (stated - mean).powi(2)).sum::<f64>();
    Ok(Agreement { scale, scale_sigma: sigma / spread.sqrt(), off, suspicious, sigma })
}

impl Agreement {
    /// Returns the scale for the file: exactly 1 if the stated unit is radians or metres within the measurement
    /// uncertainty.
    pub(crate) fn scale_to_write(&self) -> f64 {
        let size = self.scale.abs();
        if (size - 1.0).abs() < SAME_UNIT { 1.0 } else { size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turning(lags: impl Fn(usize) -> f64) -> Vec<Position> {
        let at = |i: usize| {
            let stated = 0.157 * i as f64;
            Position {
                stated,
                shown: -0.998 * stated + 0.3 + lags(i) + 1e-4 * (7.0 * i as f64).sin(),
            }
        };
        (0..40).map(at).collect()
    }

    #[test]
    fn lagging_pictures_are_found_and_do_not_bias_the_scale() {
        let found = compare(&turning(|i| if (1..6).contains(&i) { 0.02 } else { 0.0 })).unwrap();
        assert_eq!(found.suspicious, [1, 2, 3, 4, 5]);
        assert!((found.scale + 0.998).abs() < 1e-4, "{found:?}");
        assert!((found.off[3] - 0.02).abs() < 1e-3);
        assert!((found.scale_to_write() - 1.0).abs() < 1e-15);
        assert_eq!(compare(&turning(|_| 0.0)).unwrap().suspicious, [0; 0]);
    }

    #[test]
    fn an_unrelated_joint_is_rejected() {
        let still: Vec<_> =
            turning(|_| 0.0).iter().map(|p| Position { stated: 1.0, ..*p }).collect();
        assert_eq!(compare(&still), Err(PositionError::Still));
        let random = |i: usize| f64::from((i as u32).wrapping_mul(2_654_435_761) >> 20) / 409.6;
        let other = (0..40).map(|i| Position { stated: random(i), shown: i as f64 });
        let error = compare(&other.collect::<Vec<_>>()).unwrap_err();
        assert!(matches!(error, PositionError::Unrelated { .. }), "{error}");
    }
}
