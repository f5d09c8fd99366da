//! Reading and checking a scenario's values: shared by every kind of scenario and by each of its parts.

use std::fmt::Display;

use serde::de::DeserializeOwned;
use thiserror::Error;

/// Largest number of entries in any list of a scenario.
pub(super) const MAX_ENTRIES: usize = 1000;

/// The reason why a text is not a scenario.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// Not YAML, an unknown key, a missing key or a value of the wrong type.
    #[error("{0}")]
    Yaml(Box<serde_saphyr::Error>),
    /// A value out of range.
    #[error("{key} is {value}: allowed is {allowed}")]
    Range {
        /// Path of the value, as in `camera.width_px`.
        key: String,
        /// The value.
        value: String,
        /// The allowed range or values.
        allowed: String,
    },
}

/// Reads a scenario of any kind without checking its values.
pub(super) fn parsed<T: DeserializeOwned>(text: &str) -> Result<T, ScenarioError> {
    // A few parts may be alike; each reference could repeat a long text.
    let options = serde_saphyr::options! { budget: serde_saphyr::budget! { max_aliases: 100 } };
    serde_saphyr::from_str_with_options(text, options)
        .map_err(|error| ScenarioError::Yaml(Box::new(error)))
}

/// Rejects frames at times that ROS cannot represent.
pub(super) fn check_times(frame_rate_hz: f64, start_time_ns: i64) -> Result<(), ScenarioError> {
    check_range("frame_rate_hz", frame_rate_hz, 0.01, 1e5)?;
    // ROS counts seconds in 31 bits, until 2038; the longest scenario takes 10⁸ of them.
    check_range("start_time_ns", start_time_ns as f64, 0.0, 2e18)
}

/// Rejects a value outside `min ..= max`, NaN included.
pub(super) fn check_range(key: &str, value: f64, min: f64, max: f64) -> Result<(), ScenarioError> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(range_error(key, value, format!("{min} to {max}")))
}

/// Rejects a list of more than [`MAX_ENTRIES`] entries.
pub(super) fn check_entries<T>(key: &str, list: &[T]) -> Result<(), ScenarioError> {
    if list.len() <= MAX_ENTRIES {
        return Ok(());
    }
    Err(range_error(key, format!("{} entries", list.len()), format!("at most {MAX_ENTRIES}")))
}

/// Returns the error for an invalid value.
pub(super) fn range_error(key: &str, value: impl Display, allowed: String) -> ScenarioError {
    ScenarioError::Range { key: key.to_owned(), value: value.to_string(), allowed }
}
