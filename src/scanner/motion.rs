//! Where along the scan a profile was taken.

use super::params::{MotionParams, MotionSource};

/// Turns frame numbers and stamps into positions along the scan, metres.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    params: MotionParams,
    /// Number and stamp of the frame at position 0.
    start: Option<(u64, i64)>,
}

impl Motion {
    /// Motion that starts with the first frame it is asked about.
    pub const fn new(params: MotionParams) -> Self {
        Self { params, start: None }
    }

    /// Position of a frame, metres. Frames that were lost have moved the part too: numbers count, not arrivals.
    pub fn position_m(&mut self, frame_number: u64, stamp_ns: i64) -> f64 {
        let (first_number, first_stamp_ns) = *self.start.get_or_insert((frame_number, stamp_ns));
        match self.params.source {
            MotionSource::None => 0.0,
            MotionSource::Constant if self.params.step_m != 0.0 => {
                frame_number.wrapping_sub(first_number) as i64 as f64 * self.params.step_m
            }
            // Subtracted as integers: seconds since the epoch in a float resolve only 0.2 µs.
            MotionSource::Constant => {
                stamp_ns.saturating_sub(first_stamp_ns) as f64 * 1e-9 * self.params.velocity_m_s
            }
        }
    }

    /// Starts again at 0 with the next frame.
    pub fn restart(&mut self) {
        self.start = None;
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "0 and whole steps are exact")]
mod tests {
    use super::*;

    fn constant(step_m: f64, velocity_m_s: f64) -> Motion {
        Motion::new(MotionParams { source: MotionSource::Constant, step_m, velocity_m_s })
    }

    #[test]
    fn lost_frames_move_the_part_too() {
        let mut motion = constant(0.001, 0.0);
        assert_eq!([7, 8, 11].map(|number| motion.position_m(number, 0)), [0.0, 0.001, 0.004]);
    }

    #[test]
    fn the_year_does_not_matter() {
        let mut motion = constant(0.0, 0.1);
        let start_ns = 1_800_000_000_000_000_000;
        assert_eq!(motion.position_m(0, start_ns), 0.0);
        assert!((motion.position_m(1, start_ns + 1) - 1e-10).abs() < 1e-24);
    }

    #[test]
    fn stamps_that_jump_do_not_overflow() {
        let mut motion = constant(0.0, 1.0);
        assert_eq!(motion.position_m(0, i64::MIN), 0.0);
        assert!(motion.position_m(1, i64::MAX).is_finite());
    }
}
