//! What people and machines ask of a running camera, carried out between two frames.

use std::sync::{Mutex, PoisonError, mpsc::SyncSender};

use crate::scanner::params::Params;

/// A request to the worker; the answer follows when it is carried out.
#[derive(Debug)]
pub enum Command {
    /// Ends the open scan and begins a new one with the next frame.
    StartScan(ScanRequest, Reply),
    /// Ends the open scan with its last slice and its height map; then frames give profiles only.
    StopScan(Reply),
    /// Throws the open scan away and begins a new one with the next frame.
    Reset(Reply),
    /// Measures what waits, then ends the open scan and the session.
    Drain(Reply),
}

/// Which scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanRequest {
    /// What is scanned; may be empty.
    pub part_id: String,
    /// Length at which it ends, metres; 0: when it is stopped.
    pub length_m: f64,
}

/// What came of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Whether it was carried out.
    pub success: bool,
    /// What was done, or why not.
    pub message: String,
    /// The scan it speaks of, where there is one.
    pub scan_id: Option<[u8; 16]>,
}

/// Where the answer goes. Nobody may be waiting for it any more.
pub type Reply = SyncSender<Answer>;

/// What a camera measures by, as parameters change.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The measurement.
    pub params: Params,
    /// Hash of the camera's parameters.
    pub parameters_sha256: String,
    /// Whether input images are sent on with the results, to be recorded.
    pub sends_images: bool,
}

/// Holds the latest of something until somebody takes it: a thousand changes between two frames are one.
#[derive(Debug)]
pub struct Mailbox<T>(Mutex<Option<T>>);

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Mailbox<T> {
    /// Puts `value` in the place of what is there.
    pub fn put(&self, value: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    }

    /// Takes what is there.
    pub fn take(&self) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_latest_counts() {
        let mailbox = Mailbox::default();
        assert_eq!(mailbox.take(), None);
        mailbox.put(1);
        mailbox.put(2);
        assert_eq!((mailbox.take(), mailbox.take()), (Some(2), None));
    }
}
