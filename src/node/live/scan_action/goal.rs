//! One goal of a scan: its check, its recording, its feedback and its result.

use std::time::{Duration, Instant};

use super::{ActionState, lock, recordings::Recordings};
use crate::{
    msg::{
        action_msgs::{GoalInfo, status},
        laser_profiler_msgs::scan::{
            FeedbackMessage, GetResultResponse, ScanFeedback, ScanGoal, ScanResult,
        },
        unique_identifier_msgs::Uuid,
    },
    node::{
        command::{Command, ScanRequest},
        live::node::NodeState,
        scan_watch::{ScanEnd, ScanProgress, ScanWatch},
    },
};

/// Period of the feedback.
const FEEDBACK_PERIOD: Duration = Duration::from_millis(100);

/// Checks a goal and returns the scan for the camera's worker.
///
/// # Errors
/// The reason to reject it.
pub(super) fn request(
    node: &NodeState,
    camera: &str,
    goal: &ScanGoal<'_>,
    watch: ScanWatch,
) -> Result<ScanRequest, String> {
    let &ScanGoal { length, frames, max_duration, start_position, .. } = goal;
    if !(length.is_finite() && length >= 0.0) {
        return Err(format!("length is {length} m, but must be 0 (unlimited) or more"));
    }
    let duration = u64::try_from(max_duration.to_ns()).map_err(|_negative| {
        format!("max_duration is {} s, but must be 0 (unlimited) or more", max_duration.sec)
    })?;
    if length == 0.0 && frames == 0 && duration == 0 {
        return Err("it has no limit: set length, frames or max_duration".to_owned());
    }
    if !(start_position.is_nan() || start_position == 0.0) {
        return Err(format!(
            "start_position is {start_position} m, but a scan begins where it is started: set 0 or NaN"
        ));
    }
    let max_profiles = node.scan_max_profiles(camera);
    if frames > max_profiles {
        return Err(format!(
            "frames is {frames}, but a scan ends at scan.max_profiles {max_profiles}"
        ));
    }
    Ok(ScanRequest {
        part_id: goal.part_id.clone().into_owned(),
        length_m: (length > 0.0).then_some(length),
        // Otherwise another scan would follow it.
        frames: Some(if frames > 0 { frames } else { max_profiles }),
        duration: (duration > 0).then_some(Duration::from_nanos(duration)),
        watch: Some(watch),
    })
}

/// A goal that has begun.
pub(super) struct Plan {
    scan_id: Uuid,
    request: ScanRequest,
    since: Instant,
    /// False if only `scan.max_profiles` limits the frames.
    limits_frames: bool,
    recordings: Recordings,
}

impl Plan {
    /// Starts the recording, if one is wanted, then the scan.
    ///
    /// # Errors
    /// The reason to reject the goal.
    pub(super) fn begin(
        node: &NodeState,
        camera: &str,
        request: ScanRequest,
        goal: &ScanGoal<'_>,
    ) -> Result<Self, String> {
        let recordings =
            if goal.record { Recordings::start(node, camera)? } else { Recordings::default() };
        let answer = node.order(camera, |reply| Command::StartScan(request.clone(), reply));
        if !answer.success {
            // A busy worker must not start it later.
            if let Some(watch) = &request.watch {
                watch.end(ScanEnd::Stopped);
            }
            recordings.abandon();
            return Err(answer.message);
        }
        let scan_id = Uuid { uuid: answer.scan_id.unwrap_or_default() };
        let limits_frames = goal.frames > 0;
        Ok(Self { scan_id, request, since: Instant::now(), limits_frames, recordings })
    }

    /// Returns the share of the nearest limit, 0 to 1; NaN if it is unknown.
    fn progress(&self, progress: &ScanProgress) -> f32 {
        let ScanRequest { length_m, frames, duration, .. } = &self.request;
        let length = length_m.zip(progress.travelled_m).map(|(of, at)| at.abs() / of);
        let frames = frames.filter(|_| self.limits_frames);
        let frames = frames.map(|frames| progress.accepted as f64 / frames as f64);
        let time = duration.map(|of| self.since.elapsed().as_secs_f64() / of.as_secs_f64());
        let shares = [length, frames, time].into_iter().flatten();
        shares.reduce(f64::max).map_or(f32::NAN, |share| share.min(1.0) as f32)
    }

    /// Returns the last state of the goal, which was in `state`, and the message of its result.
    fn outcome(&self, end: ScanEnd, state: i8) -> (i8, &'static str) {
        match end {
            ScanEnd::Length => (status::SUCCEEDED, "it reached its length"),
            ScanEnd::Frames if self.limits_frames => {
                (status::SUCCEEDED, "it has all of its frames")
            }
            ScanEnd::Frames => {
                (status::ABORTED, "scan.max_profiles ended it before any of its limits")
            }
            ScanEnd::Duration => (status::SUCCEEDED, "its time is over"),
            ScanEnd::Stopped if state == status::CANCELING => {
                (status::CANCELED, "it was cancelled")
            }
            ScanEnd::Stopped => (status::ABORTED, "~/stop_scan ended it"),
            ScanEnd::Replaced => (status::ABORTED, "another scan was started"),
            ScanEnd::Discarded => (status::ABORTED, "~/reset discarded it"),
            ScanEnd::Interrupted => (
                status::ABORTED,
                "the stream was interrupted: the node was deactivated, time was set back, or the geometry changed",
            ),
            ScanEnd::NodeEnded => (status::ABORTED, "the camera ended: the node was shut down"),
        }
    }
}

/// Sends feedback until the scan ends, then its result.
pub(super) fn follow(shared: &ActionState, info: GoalInfo, watch: &ScanWatch, plan: &Plan) {
    let mut sent = None;
    let (progress, end) = loop {
        let progress = watch.wait(FEEDBACK_PERIOD);
        if sent != Some(progress.accepted) {
            sent = Some(progress.accepted);
            send_feedback(shared, info, plan, &progress);
        }
        if let Some(end) = progress.ended {
            break (progress, end);
        }
    };
    let (mut state, mut why) = plan.outcome(end, shared.goals().state(info.goal_id));
    if state == status::SUCCEEDED && progress.accepted == 0 {
        (state, why) = (status::ABORTED, "no frame was measured: is the camera publishing?");
    }
    let files = plan.recordings.close(|| !shared.goals().is_closed());
    let message = [&[why.to_owned()][..], &files.notes].concat().join("; ");
    let has_gaps = progress.missing + progress.rejected > 0;
    let result = ScanResult {
        result: match state {
            status::SUCCEEDED if has_gaps => ScanResult::SUCCEEDED_WITH_GAPS,
            status::SUCCEEDED => ScanResult::SUCCEEDED,
            // Cancelled, too: it did not reach its end.
            _ => ScanResult::FAILED,
        },
        message: message.into(),
        scan_id: plan.scan_id,
        frames_expected: progress.accepted + progress.missing + progress.rejected,
        frames_accepted: progress.accepted,
        frames_missing: progress.missing,
        frames_rejected: progress.rejected,
        points: progress.points,
        length: progress.travelled_m.map_or(f64::NAN, f64::abs),
        recordings: files.uris.iter().map(|uri| uri.as_str().into()).collect(),
        recordings_sha256: files.hashes.iter().map(|hash| hash.as_str().into()).collect(),
    };
    tracing::info!("~/scan: the goal has ended: {}", result.message);
    shared.finish(info, state, GetResultResponse { status: state, result });
}

fn send_feedback(shared: &ActionState, info: GoalInfo, plan: &Plan, progress: &ScanProgress) {
    let feedback = ScanFeedback {
        frames_accepted: progress.accepted,
        frames_missing: progress.missing,
        position: progress.position.unwrap_or(f64::NAN),
        progress: plan.progress(progress),
    };
    let publication = &mut **lock(&shared.feedback);
    shared.send(publication, &FeedbackMessage { goal_id: info.goal_id, feedback });
}
