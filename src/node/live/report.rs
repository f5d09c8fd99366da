//! Reports of the cameras for a user interface in this process.

use std::sync::Weak;

use super::{camera::Camera, node::NodeState};
use crate::node::{board::Reported, live_recording};

/// The last report of a camera, with the current state of its recorder.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraReport {
    /// Its name; empty for the only camera.
    pub(crate) camera: String,
    /// Its frames.
    pub(crate) reported: Reported,
    /// True if a bag is being recorded.
    pub(crate) is_recording: bool,
    /// Free space of the recording's disk, bytes; `None` if nothing is recorded or the space is unknown.
    pub(crate) free_bytes: Option<u64>,
}

/// A view of a node for another thread. It does not keep the node alive.
#[derive(Clone)]
pub(crate) struct Watcher(pub(super) Weak<NodeState>);

impl Watcher {
    /// Returns one report per camera; none while the node is unconfigured or after it ends. May wait for a slow disk.
    pub(crate) fn reports(&self) -> Vec<CameraReport> {
        let Some(node) = self.0.upgrade() else { return Vec::new() };
        node.cameras().iter().map(report).collect()
    }
}

fn report(camera: &Camera) -> CameraReport {
    let status = camera.recording.status();
    let bags = [&status.results, &status.images];
    let directory =
        bags.into_iter().filter(|bag| bag.is_recording).find_map(|bag| bag.directory.as_deref());
    CameraReport {
        camera: camera.name.clone(),
        reported: camera.board.read(),
        is_recording: status.is_recording(),
        free_bytes: directory.and_then(|directory| live_recording::free_bytes(directory).ok()),
    }
}
