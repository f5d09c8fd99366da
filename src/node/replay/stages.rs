//! Measures a recording without storing results, for a viewer.

use crate::{
    bag::BagReader,
    node::{input::ImageTopic, topics, worker::Worker},
    ros::{names::NodeNames, transport::TopicEndpoint},
};

use super::{Replay, ReplayError};

/// The unused worker and metadata of one camera.
pub(crate) struct Stage {
    /// Its name among several; empty: the only one.
    pub(crate) camera: String,
    /// The topic of its images.
    pub(crate) images: ImageTopic,
    /// The topics of its results, in the order of [`Output`](topics::Output).
    pub(crate) topics: Vec<TopicEndpoint>,
    /// The worker that measures.
    pub(crate) worker: Worker,
}

impl Replay {
    /// New workers, one a camera, by the parameters in force.
    ///
    /// # Errors
    /// A remap rule that gives a topic a name that ROS does not allow, or a calibration without the axis that is moved.
    pub(crate) fn stages(&self) -> Result<Vec<Stage>, ReplayError> {
        let stage = |camera: &super::CameraReplay| {
            let name = camera.name().to_owned();
            let topics = topics::published(&self.names, &name, camera.calibration())?;
            let images = camera.image_topic.clone();
            Ok(Stage { camera: name, images, topics, worker: camera.worker(self)? })
        };
        self.cameras.iter().map(stage).collect()
    }

    /// The topics that are taken besides the images, of all cameras.
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
