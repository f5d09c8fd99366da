//! Commands to a running camera, carried out between two frames.

use std::{
    sync::{Mutex, PoisonError, mpsc::SyncSender},
    time::Duration,
};

use super::scan_watch::ScanWatch;
use crate::scanner::params::Params;

/// A request to the worker, which replies after carrying it out.
#[derive(Debug)]
pub(crate) enum Command {
    /// Ends the open scan and begins a new one with the next frame.
    StartScan(ScanRequest, Reply),
    /// Ends the open scan with its last slice and its height map; then frames give profiles only.
    StopScan(Reply),
    /// Discards the open scan and begins a new one with the next frame.
    Reset(Reply),
    /// Measures the frames that wait, then ends the open scan and the session.
    Drain(Reply),
}

/// The scan to start.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScanRequest {
    /// Identity of the part; may be empty.
    pub(crate) part_id: String,
    /// Length at which the scan ends, metres, above 0; without any limit, it ends when stopped.
    pub(crate) length_m: Option<f64>,
    /// Number of frames at which it ends; needs a watch.
    pub(crate) frames: Option<u64>,
    /// Time after the request at which it ends.
    pub(crate) duration: Option<Duration>,
    /// Told of its progress and its end.
    pub(crate) watch: Option<ScanWatch>,
}

/// The answer to a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    /// True if the command was carried out.
    pub(crate) success: bool,
    /// The action taken, or the reason for refusal.
    pub(crate) message: String,
    /// The scan concerned, where there is one.
    pub(crate) scan_id: Option<[u8; 16]>,
}

/// Channel for the answer. The caller may have stopped waiting.
pub(crate) type Reply = SyncSender<Answer>;

/// Settings of a camera that can change at run time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    /// The measurement.
    pub(crate) params: Params,
    /// Hash of the camera's parameters.
    pub(crate) parameters_sha256: String,
    /// True if input images are forwarded with the results, to be recorded.
    pub(crate) sends_images: bool,
}

/// Holds the latest value until it is taken: several changes between two frames are applied as one.
#[derive(Debug)]
pub(crate) struct Mailbox<T>(Mutex<Option<T>>);

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Mailbox<T> {
    /// Replaces the value.
    pub(crate) fn put(&self, value: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    }

    /// Takes the value.
    pub(crate) fn take(&self) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_latest_value_is_kept() {
        let mailbox = Mailbox::default();
        assert_eq!(mailbox.take(), None);
        mailbox.put(1);
        mailbox.put(2);
        assert_eq!((mailbox.take(), mailbox.take()), (Some(2), None));
    }
}
