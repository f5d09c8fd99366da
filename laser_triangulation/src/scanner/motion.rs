//! Positions of frames along the scan.
//!
//! [`Motion`] computes them for a constant motion; [`track`] and [`frames`] interpolate samples of an axis or of poses;
//! [`locator`] turns them into places in the scan.

pub mod track;
pub mod reading;
pub mod counter;
pub mod frames;
mod travel;
pub mod standstill;
pub mod locator;
pub mod placement;

use nalgebra::Isometry3;

use super::axis::RawPosition;
use super::params::{MotionParams, MotionSource};

/// Reasons to doubt a position: bits, as in `FrameTrace.encoder_status`.
pub mod doubt {
    /// The samples before and after lie further apart than the axis can move.
    pub const GAP: u8 = 1;
    /// The axis moved against the scan direction.
    pub const REVERSED: u8 = 2;
    /// The samples before and after lie too far apart in time, or there are none.
    pub const STALE: u8 = 4;
    /// There is no sample after it: the motion before it was extrapolated.
    pub const EXTRAPOLATED: u8 = 8;
}

/// Position of the axis in the middle of a frame's exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Position along the scan, before the scale of the axis. For a measured pose: metres from the first frame of the scan.
    pub value: RawPosition,
    /// Encoder counts; 0 without an encoder.
    pub counts: i64,
    /// Bits of [`doubt`]; 0: none.
    pub doubts: u8,
    /// True if a sample was taken at exactly that time.
    pub is_exact: bool,
    /// The sensor's pose in the part's frame, metres, if poses are measured.
    pub part_from_sensor: Option<Isometry3<f64>>,
}

impl Position {
    /// A position without doubts, counts or pose.
    pub const fn at(value: RawPosition) -> Self {
        Self { value, counts: 0, doubts: 0, is_exact: false, part_from_sensor: None }
    }
}

/// Turns frame numbers and stamps into positions along the scan.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    params: MotionParams,
    /// Number and stamp of the frame at position 0.
    start: Option<(u64, i64)>,
}

impl Motion {
    /// A motion that starts with the first frame.
    pub const fn new(params: MotionParams) -> Self {
        Self { params, start: None }
    }

    /// Position of a frame; `None` if positions are measured. Lost frames move the part too: frame numbers count, not
    /// arrivals.
    pub fn position(&mut self, frame_number: u64, stamp_ns: i64) -> Option<Position> {
        let (first_number, first_stamp_ns) = *self.start.get_or_insert((frame_number, stamp_ns));
        let position = match self.params.source {
            MotionSource::None => 0.0,
            MotionSource::Constant if let Some(step) = self.params.step => {
                frame_number.wrapping_sub(first_number) as i64 as f64 * step
            }
            // Subtracted as integers: seconds since the epoch resolve only 0.2 µs in a float.
            MotionSource::Constant => {
                stamp_ns.saturating_sub(first_stamp_ns) as f64
                    * 1e-9
                    * self.params.velocity.unwrap_or(0.0)
            }
            MotionSource::JointState | MotionSource::Encoder | MotionSource::Tf => return None,
        };
        Some(Position::at(RawPosition(position)))
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

    fn constant(step: Option<f64>, velocity: Option<f64>) -> Motion {
        let source = MotionSource::Constant;
        Motion::new(MotionParams { source, step, velocity, ..MotionParams::default() })
    }

    fn raw_position(motion: &mut Motion, frame_number: u64, stamp_ns: i64) -> f64 {
        motion.position(frame_number, stamp_ns).unwrap().value.0
    }

    #[test]
    fn lost_frames_move_the_part_too() {
        let mut motion = constant(Some(0.001), None);
        let positions = [7, 8, 11].map(|number| raw_position(&mut motion, number, 0));
        assert_eq!(positions, [0.0, 0.001, 0.004]);
    }

    #[test]
    fn stamps_since_the_epoch_keep_nanoseconds() {
        let mut motion = constant(None, Some(0.1));
        let start_ns = 1_800_000_000_000_000_000;
        assert_eq!(raw_position(&mut motion, 0, start_ns), 0.0);
        assert!((raw_position(&mut motion, 1, start_ns + 1) - 1e-10).abs() < 1e-24);
    }

    #[test]
    fn stamps_that_jump_do_not_overflow() {
        let mut motion = constant(None, Some(1.0));
        assert_eq!(raw_position(&mut motion, 0, i64::MIN), 0.0);
        assert!(raw_position(&mut motion, 1, i64::MAX).is_finite());
    }

    #[test]
    fn measured_positions_are_not_computed() {
        for source in [MotionSource::JointState, MotionSource::Encoder, MotionSource::Tf] {
            let mut motion = Motion::new(MotionParams { source, ..MotionParams::default() });
            assert_eq!(motion.position(3, 5), None);
        }
    }
}
