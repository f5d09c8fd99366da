//! Detects positions that arrive once per frame with a constant lag. If the axis stands still during the exposure, that
//! lag is not motion.

pub(crate) use crate::scanner::motion::track::{Measured, Track};

/// Number of consecutive frames that prove a constant lag.
const NUM_ALIKE: u32 = 10;

/// The common lag of the last frames.
#[derive(Debug, Default)]
pub(super) struct ConstantLag {
    /// Time of the last frame and of the sample before it.
    last: Option<(i64, i64)>,
    num_alike: u32,
    has_reported: bool,
}

impl ConstantLag {
    /// Processes the time of the next frame; returns the advice once.
    pub(super) fn note<T: Measured>(&mut self, time_ns: i64, track: &Track<T>) -> Option<String> {
        let age_ns = track.age_ns(time_ns)?;
        let sample_ns = time_ns.saturating_sub(age_ns);
        let (last_time_ns, last_sample_ns) = self.last.replace((time_ns, sample_ns))?;
        let period_ns = time_ns.saturating_sub(last_time_ns);
        let step_ns = sample_ns.saturating_sub(last_sample_ns);
        // Tolerance of a thousandth of the period, for jitter of the stamps.
        let is_steady = period_ns.abs_diff(step_ns) <= period_ns.unsigned_abs() / 1000;
        let is_only_one = track.age_ns(sample_ns) == Some(step_ns);
        let is_alike = step_ns > 0 && is_steady && is_only_one;
        self.num_alike = if is_alike { self.num_alike + 1 } else { 0 };
        if self.num_alike < NUM_ALIKE || std::mem::replace(&mut self.has_reported, true) {
            return None;
        }
        let age_s = age_ns as f64 * 1e-9;
        Some(format!(
            "every frame has its own position, stamped {age_s:.4} s before it: if the axis stands still during the exposure, \
             set motion.exposure_offset to {:.4}, otherwise frames are placed too far along the axis",
            -age_s
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::{
        axis::{AxisTravel, RawPosition},
        motion::{reading::Reading, track::Limits},
    };

    const MS: i64 = 1_000_000;

    /// Advice on frames each 100 ms, with positions each `period_ms` that begin `lag_ms` before the first.
    fn advice(period_ms: i64, lag_ms: i64) -> Vec<String> {
        let mut track = Track::new(Limits { max_gap_ns: None, max_step: None }, 1000);
        for number in 0..3000 / period_ms {
            let stamp_ns = (1000 - lag_ms + number * period_ms) * MS;
            track
                .push(
                    stamp_ns,
                    stamp_ns,
                    Reading {
                        position: RawPosition(0.0),
                        travel: AxisTravel::Metres(0.0),
                        counts: 0,
                    },
                )
                .unwrap();
        }
        let mut lag = ConstantLag::default();
        (0..20).filter_map(|frame| lag.note((1000 + frame * 100) * MS, &track)).collect()
    }

    #[test]
    fn the_lag_is_reported_once_if_each_frame_has_its_own_position() {
        let found = advice(100, 20);
        assert!(
            found.len() == 1 && found[0].contains("motion.exposure_offset to -0.0200"),
            "{found:?}"
        );
        assert!(advice(10, 5).is_empty(), "a fast encoder in step with the camera");
        assert!(advice(70, 20).is_empty(), "a clock of its own");
    }
}
