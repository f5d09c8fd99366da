//! Measures a recording without storing results, for a viewer.

use crate::{
    bag::BagReader,
    node::{input::ImageTopic, topics, worker::Worker},
    ros::{names::NodeNames, transport::TopicEndpoint},
};

use super::{Replay, ReplayError};

/// A new worker and the topics of one camera.
pub(crate) struct Stage {
    /// Name of the camera; empty if it is the only one.
    pub(crate) camera: String,
    /// Topic of the images.
    pub(crate) images: ImageTopic,
    /// Topics of the results, in the order of [`Output`](topics::Output).
    pub(crate) topics: Vec<TopicEndpoint>,
    /// The worker that measures.
    pub(crate) worker: Worker,
}

impl Replay {
    /// Returns new workers, one per camera, with the current parameters.
    ///
    /// # Errors
    /// A remap rule gives a topic an invalid name, or the calibration lacks the axis of the motion.
    pub(crate) fn stages(&self) -> Result<Vec<Stage>, ReplayError> {
        let stage = |camera: &super::CameraReplay| {
            let name = camera.name().to_owned();
            let topics = topics::published(&self.names, &name, camera.calibration())?;
            let images = camera.image_topic.clone();
            Ok(Stage { camera: name, images, topics, worker: camera.worker(self)? })
        };
        self.cameras.iter().map(stage).collect()
    }

    /// Returns the topics of all cameras that are read in addition to the images.
    pub(crate) fn side_topics(&self) -> Vec<String> {
        self.cameras.iter().flat_map(super::CameraReplay::side_topics).collect()
    }

    /// The recordings.
    pub(crate) fn bags(&self) -> &[BagReader] {
        &self.bags
    }

    /// The node's names and remaps.
    pub(crate) const fn names(&self) -> &NodeNames {
        &self.names
    }
}
