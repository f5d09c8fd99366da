//! Positions of frames along the axis at their exposure, from messages about the axis.
//!
//! A replay and a live node give the same positions: the samples used depend only on stamps and times of reception, not
//! on thread timing.

mod decode;
mod constant_lag;
pub(super) mod missing_axis;
pub(crate) mod inbox;
pub(crate) mod topics;
pub(super) mod waiting;

use thiserror::Error;

use crate::{
    bag::RawMessage,
    ros::camera_params::{CameraParams, Moved},
    scanner::{
        axis::{Axis, AxisKind, RawPosition},
        calibration::Calibration,
        motion::{
            Position,
            counter::Counter,
            frames::{FramePair, FrameTree, NotFound},
            reading::Reading,
            track::{Limits, MAX_SAMPLES, Track},
        },
        params::{AxisChoice, MotionParams, MotionSource},
    },
};
use constant_lag::ConstantLag;

/// Minimum time that a frame waits for the next sample, nanoseconds: covers network jitter.
const MIN_TIMEOUT_NS: i64 = 1_000_000_000;
/// Maximum number of names in a log message.
const MAX_NAMED: usize = 20;

/// Contradiction between motion parameters and calibration.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(crate) enum AxisError {
    /// Parameter and calibration disagree.
    #[error(
        "motion.axis is {chosen}, but the calibration's axis is {calibrated}: set auto, or calibrate that axis"
    )]
    Kind {
        /// The parameter.
        chosen: &'static str,
        /// The calibration.
        calibrated: &'static str,
    },
    /// A revolute axis needs a calibrated axis.
    #[error(
        "motion.axis is revolute, but the calibration has no axis: find it with laser_profiler calibrate axis, or set \
         motion.source to none for profiles without a scan"
    )]
    NoAxis,
    /// The frame of the camera is unknown.
    #[error(
        "motion.source is tf, but the calibration has no camera frame to look up: set motion.sensor_frame to its \
         frame_id, {0}, and publish where that is"
    )]
    NoCamera(String),
}

/// Samples of the axis, by stamp.
enum Known {
    /// A joint or an encoder.
    Axis(Track<Reading>),
    /// Poses of frames.
    Frames(FrameTree),
}

/// Positions of one camera's frames.
pub(crate) struct Positions {
    params: MotionParams,
    moved: Moved,
    kind: AxisKind,
    /// The calibrated axis.
    axis: Option<Axis>,
    known: Known,
    counter: Counter,
    /// Scale of the first encoder sample, metres per count.
    scale: Option<f64>,
    /// Frame of the images.
    camera_frame: String,
    /// Names of the joints received.
    joints: Vec<String>,
    lag: ConstantLag,
    /// The last frame measured without a later sample: middle of its exposure and time of reception, nanoseconds.
    given_up: Option<(i64, i64)>,
    num_refused: u64,
    has_warned_missing: bool,
    has_warned_late: bool,
}

/// Returns the kind of axis that positions refer to.
///
/// # Errors
/// Parameter and calibration disagree, or a revolute axis is not calibrated.
pub(crate) fn axis_kind(
    params: &MotionParams,
    calibration: Option<&Calibration>,
) -> Result<AxisKind, AxisError> {
    let name = |kind| match kind {
        AxisKind::Prismatic => "prismatic",
        AxisKind::Revolute => "revolute",
    };
    let calibrated = calibration.and_then(Calibration::axis).map(|axis| axis.kind);
    let chosen = match params.axis {
        AxisChoice::Auto => return Ok(calibrated.unwrap_or(AxisKind::Prismatic)),
        AxisChoice::Prismatic => AxisKind::Prismatic,
        AxisChoice::Revolute => AxisKind::Revolute,
    };
    match calibrated {
        Some(kind) if kind != chosen => {
            Err(AxisError::Kind { chosen: name(chosen), calibrated: name(kind) })
        }
        None if chosen == AxisKind::Revolute && calibration.is_some() => Err(AxisError::NoAxis),
        _ => Ok(chosen),
    }
}

/// Creates the store for a camera; `None` if its positions are not measured.
///
/// # Errors
/// As [`axis_kind`]; or the source is tf and the calibration has no camera frame.
pub(crate) fn of_camera(
    camera: &CameraParams,
    calibration: Option<&Calibration>,
) -> Result<Option<Positions>, AxisError> {
    let params = &camera.scanner.motion;
    let kind = axis_kind(params, calibration)?;
    let direction = camera.scanner.stripe_direction;
    if let Some(calibration) = calibration
        && params.source == MotionSource::Tf
        && calibration.camera_from_laser(direction).is_none()
        && !camera.tracks_laser(Some(calibration))
    {
        return Err(AxisError::NoCamera(calibration.frame_id().to_owned()));
    }
    let positions = Positions::new(params, &camera.moved, kind);
    let axis = calibration.and_then(Calibration::axis).copied();
    Ok(positions.map(|positions| Positions { axis, ..positions }))
}

impl Positions {
    /// Creates a store without samples for an uncalibrated axis; `None` if positions are not measured.
    pub(crate) fn new(params: &MotionParams, moved: &Moved, kind: AxisKind) -> Option<Self> {
        let known = match params.source {
            MotionSource::None | MotionSource::Constant => return None,
            MotionSource::JointState | MotionSource::Encoder => {
                Known::Axis(Track::new(limits(params), MAX_SAMPLES))
            }
            MotionSource::Tf => Known::Frames(FrameTree::new(limits(params))),
        };
        Some(Self {
            params: *params,
            moved: moved.clone(),
            kind,
            axis: None,
            known,
            counter: Counter::new(params.encoder_bits),
            scale: None,
            camera_frame: String::new(),
            joints: Vec::new(),
            lag: ConstantLag::default(),
            given_up: None,
            num_refused: 0,
            has_warned_missing: false,
            has_warned_late: false,
        })
    }

    /// Applies new parameters. Discards samples of a joint or encoder, whose meaning may have changed.
    pub(crate) fn reconfigure(&mut self, params: &MotionParams) {
        if self.params == *params {
            return;
        }
        self.params = *params;
        match &mut self.known {
            Known::Axis(track) => {
                *track = Track::new(limits(params), MAX_SAMPLES);
                self.counter = Counter::new(params.encoder_bits);
                self.scale = None;
            }
            Known::Frames(tree) => tree.set_limits(limits(params)),
        }
    }

    /// Discards all samples before another recording, whose times are unrelated.
    pub(crate) fn restart(&mut self) {
        match &mut self.known {
            Known::Axis(track) => track.clear(),
            Known::Frames(tree) => tree.forget_moving(),
        }
        self.counter.restart();
        self.scale = None;
        self.lag = ConstantLag::default();
        self.given_up = None;
    }

    /// Maximum number of waiting frames.
    pub(crate) const fn max_wait_frames(&self) -> usize {
        self.params.max_wait_frames as usize
    }

    /// Messages and samples that could not be used.
    pub(crate) const fn num_refused(&self) -> u64 {
        self.num_refused
    }

    /// Sets the frame of the images.
    pub(crate) fn set_camera_frame(&mut self, frame_id: &str) {
        if self.camera_frame != frame_id {
            frame_id.clone_into(&mut self.camera_frame);
        }
    }

    /// Processes a message about the axis. Counts messages that cannot be used, and warns about the first.
    pub(crate) fn take(&mut self, message: &RawMessage) {
        let taken = match self.params.source {
            MotionSource::JointState => self.take_joint(message),
            MotionSource::Encoder => self.take_encoder(message),
            _ => self.take_frames(message),
        };
        if let Err(refusal) = taken {
            self.refuse(&message.topic.name, &refusal);
        }
    }

    /// Counts messages that were lost before they were processed.
    pub(crate) fn count_lost(&mut self, num_lost: u64, why: &str) {
        if num_lost > 0 {
            if self.num_refused == 0 {
                tracing::warn!("positions lost: {why}; further ones are only counted");
            }
            self.num_refused += num_lost;
        }
    }

    fn refuse(&mut self, topic: &str, refusal: &str) {
        self.num_refused += 1;
        // Only the first is logged as a warning; diagnostics count the rest.
        if self.num_refused == 1 {
            tracing::warn!("{topic}: position refused: {refusal}; further ones are only counted");
        } else {
            tracing::debug!("{topic}: position refused: {refusal}");
        }
    }

    /// True if no later message can change the position of a frame of that stamp.
    pub(crate) fn has_reached(&self, stamp_ns: i64) -> bool {
        let time_ns = self.exposed_ns(stamp_ns);
        match &self.known {
            Known::Axis(track) => track.has_reached(time_ns),
            Known::Frames(tree) => tree.has_reached(self.frames(), time_ns),
        }
    }

    /// Time after reception at which a frame stops waiting, nanoseconds; `None`: only when the queue is full.
    pub(crate) fn timeout_ns(&self) -> Option<i64> {
        let gap_ns = match &self.known {
            Known::Axis(track) => track.gap_ns(),
            Known::Frames(tree) => tree.gap_ns(self.frames()),
        };
        gap_ns.map(|gap_ns| gap_ns.max(MIN_TIMEOUT_NS))
    }

    /// Returns the position of a frame with that stamp, received at `received_ns`; `None` if it is unknown.
    pub(crate) fn at(&mut self, stamp_ns: i64, received_ns: i64) -> Option<Position> {
        let time_ns = self.exposed_ns(stamp_ns);
        let timeout_ns = self.timeout_ns().unwrap_or(i64::MAX);
        let until_ns = received_ns.saturating_add(timeout_ns);
        if !self.has_reached(stamp_ns) {
            self.given_up = Some((time_ns, received_ns));
        }
        let found = match &self.known {
            Known::Axis(track) => {
                let found = track.at(time_ns, until_ns);
                if found.is_some_and(|found| !found.is_exact)
                    && let Some(advice) = self.lag.note(time_ns, track)
                {
                    tracing::warn!("{advice}");
                }
                found.map(|found| Position {
                    value: found.value.position,
                    counts: found.value.counts,
                    doubts: found.doubts,
                    is_exact: found.is_exact,
                    part_from_sensor: None,
                })
            }
            Known::Frames(tree) => match tree.at(self.frames(), time_ns, until_ns) {
                Ok(found) => Some(Position {
                    doubts: found.doubts,
                    is_exact: found.is_exact,
                    part_from_sensor: Some(found.value),
                    ..Position::at(RawPosition(0.0))
                }),
                Err(reason) => {
                    self.warn_missing(Some(reason));
                    return None;
                }
            },
        };
        if found.is_none() {
            self.warn_missing(None);
        }
        found
    }

    /// Warns once if a sample arrived too late for the frame that waited for it.
    fn note_arrival(&mut self, stamp_ns: i64, received_ns: i64) {
        let Some((time_ns, frame_ns)) = self.given_up.filter(|(time_ns, _)| *time_ns <= stamp_ns)
        else {
            return;
        };
        self.given_up = None;
        if !std::mem::replace(&mut self.has_warned_late, true) {
            let lag_s = received_ns.saturating_sub(frame_ns) as f64 * 1e-9;
            tracing::warn!(
                "positions lag the images: the one for {time_ns} ns arrived {lag_s:.3} s after its frame, which did not wait that \
                 long; raise motion.max_wait or motion.max_gap, or publish positions more often; not reported again"
            );
        }
    }

    fn exposed_ns(&self, stamp_ns: i64) -> i64 {
        stamp_ns.saturating_add((self.params.exposure_offset_s * 1e9).round() as i64)
    }

    /// Returns the target and source frames.
    fn frames(&self) -> FramePair<'_> {
        let Moved { part_frame, sensor_frame, .. } = &self.moved;
        let sensor = if sensor_frame.is_empty() { &self.camera_frame } else { sensor_frame };
        FramePair { target: part_frame, source: sensor }
    }

    /// Warns once that a frame has no position, with the reason.
    fn warn_missing(&mut self, reason: Option<NotFound>) {
        if std::mem::replace(&mut self.has_warned_missing, true) {
            return;
        }
        let FramePair { target: part, source: sensor } = self.frames();
        let why = match (&self.known, reason) {
            (Known::Frames(tree), Some(reason)) => {
                let seen = tree.names();
                match reason {
                    NotFound::NoTarget => {
                        format!("motion.part_frame {part:?} is not in tf; received were {seen}")
                    }
                    NotFound::NoSource => {
                        format!("frame {sensor:?} is not in tf; received were {seen}")
                    }
                    NotFound::Apart => {
                        format!(
                            "tf does not connect {sensor:?} with {part:?}; received were {seen}"
                        )
                    }
                    NotFound::Loop => format!(
                        "tf has a cycle above {sensor:?} or {part:?}: a frame is its own ancestor"
                    ),
                    NotFound::NoPose => {
                        format!("the pose of {sensor:?} in {part:?} is not known at its stamp")
                    }
                }
            }
            (Known::Axis(track), _) if track.last().is_none() => self.why_no_sample(),
            _ => "its stamp is before the first sample or too long after the last".to_owned(),
        };
        tracing::warn!(
            "a frame has no position: {why}; its profile is published but is not part of the scan; further ones are only counted"
        );
    }

    fn why_no_sample(&self) -> String {
        match (self.params.source, self.joints.is_empty()) {
            (MotionSource::JointState, false) => format!(
                "motion.joint is {:?}, but the joints received are {}",
                self.moved.joint,
                self.joints.join(", ")
            ),
            _ => "no usable sample has arrived".to_owned(),
        }
    }
}

fn limits(params: &MotionParams) -> Limits {
    Limits {
        max_gap_ns: params
            .max_gap_s
            .map(|gap_s| (gap_s * 1e9).round() as i64)
            .filter(|gap_ns| *gap_ns > 0),
        max_step: params.max_step,
    }
}

#[cfg(test)]
mod tests;
