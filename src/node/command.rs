//! Commands to a running camera, carried out between two frames.

use std::sync::{Mutex, PoisonError, mpsc::SyncSender};

use crate::scanner::params::Params;

/// A request to the worker, which replies after carrying it out.
#[derive(Debug)]
pub enum Command {
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanRequest {
    /// Identity of the part; may be empty.
    pub part_id: String,
    /// Length at which the scan ends, metres, above 0; `None`: it ends when stopped.
    pub length_m: Option<f64>,
}

/// The answer to a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// True if the command was carried out.
    pub success: bool,
    /// The action taken, or the reason for refusal.
    pub message: String,
    /// The scan concerned, where there is one.
    pub scan_id: Option<[u8; 16]>,
}

/// Channel for the answer. The caller may have stopped waiting.
pub type Reply = SyncSender<Answer>;

/// Settings of a camera that can change at run time.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The measurement.
    pub params: Params,
    /// Hash of the camera's parameters.
    pub parameters_sha256: String,
    /// True if input images are forwarded with the results, to be recorded.
    pub sends_images: bool,
}

/// Holds the latest value until it is taken: several changes between two frames are applied as one.
#[derive(Debug)]
pub struct Mailbox<T>(Mutex<Option<T>>);

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Mailbox<T> {
    /// Replaces the value.
    pub fn put(&self, value: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    }

    /// Takes the value.
    pub fn take(&self) -> Option<T> {
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
