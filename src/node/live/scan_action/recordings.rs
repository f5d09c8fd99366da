//! The recordings that a goal starts, and their files once it has ended.

use std::path::PathBuf;

use super::recorded;
use crate::node::{live::node::NodeState, live_recording::RecordingControl};

/// Recordings of the recorders that were idle.
#[derive(Default)]
pub(super) struct Recordings(Vec<Recording>);

struct Recording {
    recorder: RecordingControl,
    /// Those of the recorder's bags.
    directories: Vec<PathBuf>,
}

/// Closed recordings.
#[derive(Default)]
pub(super) struct Files {
    /// URIs of the files.
    pub(super) uris: Vec<String>,
    /// SHA-256 of each file.
    pub(super) hashes: Vec<String>,
    /// Failures.
    pub(super) notes: Vec<String>,
}

impl Recordings {
    /// Starts the idle recorders of a camera.
    ///
    /// # Errors
    /// The reason that one cannot start; none is left running then.
    pub(super) fn start(node: &NodeState, camera: &str) -> Result<Self, String> {
        let mut started = Vec::new();
        for recorder in node.recorders(camera) {
            if recorder.status().is_recording() {
                continue;
            }
            match recorder.start() {
                Ok(directories) => started.push(Recording { recorder, directories }),
                Err(error) => {
                    // One of its bags may have started.
                    report(recorder.stop().err());
                    Self(started).abandon();
                    return Err(error.to_string());
                }
            }
        }
        Ok(Self(started))
    }

    /// Stops the recordings of a goal that does not begin.
    pub(super) fn abandon(&self) {
        for Recording { recorder, directories } in &self.0 {
            report(recorder.stop_in(directories).err());
        }
    }

    /// Stops the recordings, unless they have ended, and hashes their files while `is_wanted`.
    pub(super) fn close(&self, is_wanted: impl Fn() -> bool) -> Files {
        let mut files = Files::default();
        for Recording { recorder, directories } in &self.0 {
            match recorder.stop_in(directories) {
                Ok(bags) => files.notes.extend(bags.into_iter().filter_map(|bag| bag.last_error)),
                Err(error) => files.notes.push(error.to_string()),
            }
            for directory in directories {
                match recorded::files(directory, &is_wanted) {
                    Ok(found) => found.into_iter().for_each(|file| {
                        files.uris.push(file.uri);
                        files.hashes.push(file.sha256);
                    }),
                    Err(error) => files.notes.push(format!("recordings: {error}")),
                }
            }
        }
        files
    }
}

fn report(error: Option<impl std::fmt::Display>) {
    if let Some(error) = error {
        tracing::warn!("~/scan: {error}");
    }
}
