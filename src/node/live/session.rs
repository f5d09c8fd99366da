//! The cameras of a configured node, which measure while the node is active.

use std::time::Instant;

use super::{
    camera::{Camera, Measuring, REPLY_TIMEOUT},
    error::LiveError,
    recording,
    setup::{Context, sends_images},
};
use crate::{
    node::{
        command::{Command, Settings},
        recording::Description,
        run::RunError,
        statistics::Summary,
    },
    ros::{node_params::NodeParams, parameters::Parameters},
};

/// A configured node.
pub(super) struct Session {
    cameras: Vec<Camera>,
    threads: Vec<Measuring>,
}

/// Summary of a camera.
pub(crate) struct CameraSummary {
    /// Its name; empty for the only camera.
    pub(crate) name: String,
    /// Its frames, or the reason that it ended early.
    pub(crate) summary: Result<Summary, RunError>,
}

impl CameraSummary {
    /// Creates an empty summary.
    pub(super) fn new(name: &str) -> Self {
        Self { name: name.to_owned(), summary: Ok(Summary::default()) }
    }

    /// Adds a subsequent session; keeps the first error.
    pub(super) fn add(&mut self, later: Self) {
        match (&mut self.summary, later.summary) {
            (Ok(sum), Ok(later)) => sum.add(&later),
            (Ok(_), failed) => self.summary = failed,
            (Err(_), _) => {}
        }
    }
}

impl Session {
    /// Starts every camera.
    pub(super) fn configure(
        context: &Context,
        params: &NodeParams,
        values: &Parameters,
    ) -> Result<Self, LiveError> {
        let mut session = Self { cameras: Vec::new(), threads: Vec::new() };
        let tf = context.static_tf(params.cameras.len())?;
        for number in 0..params.cameras.len() {
            match context.camera(params, values, number, &tf) {
                Ok((camera, thread)) => {
                    session.cameras.push(camera);
                    session.threads.push(thread);
                }
                Err(error) => {
                    session.end();
                    return Err(error);
                }
            }
        }
        Ok(session)
    }

    /// Subscribes to the images of every camera, or of none.
    pub(super) fn activate(&self) -> Result<(), LiveError> {
        for camera in &self.cameras {
            if let Err(error) = camera.listen() {
                self.deactivate();
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Ends the subscriptions, measures the images that arrived before, and ends every open scan.
    pub(super) fn deactivate(&self) {
        self.cameras.iter().for_each(Camera::stop_listening);
        let drain_reply: Vec<_> =
            self.cameras.iter().map(|camera| camera.order(Command::Drain)).collect();
        let deadline = Instant::now() + REPLY_TIMEOUT;
        for (camera, ordered) in self.cameras.iter().zip(drain_reply) {
            if ordered.answer(deadline).is_none() {
                tracing::warn!("camera {:?} is still measuring earlier frames", camera.name);
            }
        }
    }

    /// Applies new parameters from the next frames on.
    pub(super) fn set(&self, params: &NodeParams, values: &Parameters) {
        for (camera, camera_params) in self.cameras.iter().zip(&params.cameras) {
            camera.set(Settings {
                params: camera_params.scanner_for(&camera.part_frame),
                sends_images: sends_images(params),
                parameters_sha256: values.camera_sha256(&camera_params.name),
            });
            camera.recording.set_params(recording::chosen(&params.recording));
            camera.recording.describe(Description {
                parameters: values.camera_yaml(&camera.name),
                parameters_sha256: values.camera_sha256(&camera.name),
                ..camera.description.clone()
            });
        }
    }

    /// The cameras.
    pub(super) fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// True if a camera has ended by itself, which happens only after an error.
    pub(super) fn has_failed(&self) -> bool {
        self.threads.iter().any(Measuring::is_finished)
    }

    /// Ends the session after all queued frames are measured and all results are written.
    pub(super) fn end(self) -> Vec<CameraSummary> {
        self.cameras.iter().for_each(Camera::close);
        let end = |(camera, thread): (Camera, Measuring)| {
            // The panic itself is in the log.
            let ended = thread.join().unwrap_or_else(|_panic| Err(RunError::Panicked));
            let status = camera.recording.status();
            let summary = ended.map(|summary| recording::concluded(summary, &status));
            CameraSummary { name: camera.name, summary }
        };
        self.cameras.into_iter().zip(self.threads).map(end).collect()
    }
}
