//! The progress of a requested scan, for a thread that waits for its end.

use std::{
    sync::{Arc, Condvar, Mutex, PoisonError},
    time::Duration,
};

/// The reason that a requested scan ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScanEnd {
    /// At its length.
    Length,
    /// At its number of frames.
    Frames,
    /// At its duration.
    Duration,
    /// By a request to stop it.
    Stopped,
    /// By a request for another scan.
    Replaced,
    /// By a request to discard it.
    Discarded,
    /// The stream was interrupted: the node was deactivated, a clock was set back, or the geometry changed.
    Interrupted,
    /// The camera's worker ended.
    NodeEnded,
}

/// Progress of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ScanProgress {
    /// Frames measured and placed.
    pub(crate) accepted: u64,
    /// Frames that never arrived.
    pub(crate) missing: u64,
    /// Frames that arrived and were not used.
    pub(crate) rejected: u64,
    /// Points of all profiles.
    pub(crate) points: u64,
    /// Distance from the first frame, metres; `None`: unknown.
    pub(crate) travelled_m: Option<f64>,
    /// Position of the last frame as the axis states it; `None`: unknown.
    pub(crate) position: Option<f64>,
    /// `None` while it runs.
    pub(crate) ended: Option<ScanEnd>,
}

/// Shared between the worker and who waits. Clones share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScanWatch(Arc<(Mutex<ScanProgress>, Condvar)>);

impl ScanWatch {
    /// Changes the progress, unless the scan has ended.
    pub(crate) fn update(&self, change: impl FnOnce(&mut ScanProgress)) {
        let progress = &mut *self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        if progress.ended.is_none() {
            change(progress);
        }
    }

    /// Notes the end and wakes who waits. Only the first end counts.
    pub(crate) fn end(&self, why: ScanEnd) {
        self.update(|progress| progress.ended = Some(why));
        self.0.1.notify_all();
    }

    /// True once the scan has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.wait(Duration::ZERO).ended.is_some()
    }

    /// Waits for the end or for `duration`, and returns the progress.
    pub(crate) fn wait(&self, duration: Duration) -> ScanProgress {
        let guard = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.0.1.wait_timeout_while(guard, duration, |it| it.ended.is_none());
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_end_wakes_who_waits_and_stays() {
        let watch = ScanWatch::default();
        watch.update(|progress| progress.accepted = 3);
        assert_eq!(watch.wait(Duration::ZERO).ended, None);
        let ending = watch.clone();
        let thread = std::thread::spawn(move || ending.end(ScanEnd::Frames));
        let progress = watch.wait(Duration::from_hours(1));
        assert_eq!((progress.accepted, progress.ended), (3, Some(ScanEnd::Frames)));
        thread.join().unwrap();
        watch.end(ScanEnd::NodeEnded);
        watch.update(|progress| progress.accepted = 4);
        assert_eq!(watch.wait(Duration::ZERO), progress, "what ended stays as it was");
    }
}
