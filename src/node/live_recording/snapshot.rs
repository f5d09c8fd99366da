//! Snapshots: the last seconds in bags of their own, written without affecting a running recording.

use std::{path::PathBuf, sync::Arc, time::Instant};

use jiff::Timestamp;

use super::{
    account::Account,
    control::RecorderState,
    error::RecordingError,
    lock, place,
    session::Session,
    status::BagStatus,
    tap::{SnapshotMessages, Stream, Tapped},
    writer,
};
use crate::node::statistics::Failures;

/// The snapshots of the node.
#[derive(Default)]
pub(super) struct Snapshots {
    num_taken: u32,
    /// Sessions of the last snapshot, one per stream with messages.
    sessions: Vec<Arc<Session>>,
    account: Arc<Account>,
    start_error: Option<String>,
}

impl Snapshots {
    pub(super) fn sessions(&self) -> &[Arc<Session>] {
        &self.sessions
    }

    pub(super) fn failures(&self) -> Failures {
        self.account.failures()
    }

    pub(super) fn status(&self) -> BagStatus {
        let mut statuses = self.sessions.iter().map(|session| session.status());
        let mut sum = statuses.next().unwrap_or_default();
        for other in statuses {
            sum.is_ending |= other.is_ending;
            sum.bytes += other.bytes;
            sum.messages += other.messages;
            sum.last_error = sum.last_error.or(other.last_error);
        }
        sum.last_error = self.start_error.clone().or(sum.last_error);
        sum
    }
}

/// Starts writing the content of the ring buffer. Returns the bags, which are written in the background.
pub(super) fn take(shared: &RecorderState) -> Result<Vec<PathBuf>, RecordingError> {
    let _one_at_a_time = lock(&shared.snapshot_orders);
    let taken = write(shared);
    let snapshots = &mut *lock(&shared.snapshots);
    snapshots.start_error = taken.as_ref().err().map(ToString::to_string);
    if let Some(error) = taken.as_ref().err().filter(|error| error.is_failure()) {
        snapshots.account.count_failure(&error.to_string());
    }
    taken
}

fn write(shared: &RecorderState) -> Result<Vec<PathBuf>, RecordingError> {
    let (number, account) = next(&lock(&shared.snapshots))?;
    let params = lock(&shared.settings.params).clone();
    let kept = lock(&shared.tap).snapshot(Instant::now());
    let SnapshotMessages { recent, earlier_latched } = kept.ok_or(RecordingError::SnapshotOff)?;
    if recent.is_empty() {
        let seconds = params.snapshot_seconds.ok_or(RecordingError::SnapshotOff)?;
        return Err(RecordingError::SnapshotEmpty(seconds));
    }
    let base = format!("{}_snapshot_{number}", place::name(&shared.camera, Timestamp::now()));
    let mut sessions = Vec::new();
    for stream in Stream::ALL {
        let of_stream = |messages: &[Tapped]| -> Vec<_> {
            messages.iter().filter(|tapped| tapped.stream == stream).cloned().collect()
        };
        let (recent, earlier) = (of_stream(&recent), of_stream(&earlier_latched));
        if recent.is_empty() {
            continue;
        }
        let bag = shared.create(stream, &params, &base)?;
        let session = Arc::new(Session::of(bag.directory(), recent, &account));
        writer::start(bag, &session, &shared.settings, &earlier)?;
        sessions.push(session);
    }
    let directories = sessions.iter().map(|session| session.directory().into()).collect();
    *lock(&shared.snapshots) =
        Snapshots { num_taken: number, sessions, account, start_error: None };
    Ok(directories)
}

/// Returns the number of the next snapshot, and the losses of all snapshots.
fn next(snapshots: &Snapshots) -> Result<(u32, Arc<Account>), RecordingError> {
    match snapshots.sessions.iter().find(|session| session.status().is_ending) {
        // Two snapshots at a time would take twice the memory.
        Some(session) => Err(RecordingError::StillWriting(session.directory().into())),
        None => Ok((snapshots.num_taken + 1, Arc::clone(&snapshots.account))),
    }
}
