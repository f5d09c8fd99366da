//! The path from each camera's images to viewers: a worker that is called directly, and a sink that serves its results.

use std::{sync::Arc, time::Duration};

use crate::{
    bag::RawMessage,
    foxglove::{Channel, Server, ViewError},
    node::{
        fan_out::FanOut,
        publisher::{PublishError, Publisher},
        queue::{Bound, Queue, WhenFull},
        replay::Stage,
        sink::{Outgoing, Outlet, Purpose, Sink, SinkError, Way},
        source::{Input, PublisherId},
        topics::Output,
        worker::Worker,
    },
    ros::node_params::ImageTransport,
};

use super::{
    camera::{CameraImage, CameraView},
    serve,
};

/// The viewer channels of a camera. They are kept after a seek; the workers are recreated.
pub(super) struct Camera {
    /// Display of the images.
    pub(super) view: Arc<CameraView>,
    /// Names and channels of the result topics, by topic number.
    channels: Vec<(String, Arc<Channel>)>,
}

impl Camera {
    pub(super) fn new(view: Arc<CameraView>) -> Self {
        Self { view, channels: Vec::new() }
    }

    /// Serves the result topics that are not served yet; a calibration adds some.
    pub(super) fn serve(&mut self, server: &Server, stage: &Stage) -> Result<(), ViewError> {
        self.channels.truncate(stage.topics.len());
        for topic in &stage.topics[self.channels.len()..] {
            self.channels.push((topic.name.clone(), serve(server, topic)?));
        }
        Ok(())
    }

    /// True if the camera publishes that output.
    pub(super) const fn has(&self, output: Output) -> bool {
        self.channels.len() > output as usize
    }

    /// True if the camera publishes on that topic.
    pub(super) fn publishes(&self, topic: &str) -> bool {
        self.channels.iter().any(|(name, _)| name == topic)
    }

    /// Returns the outlet of the results.
    pub(super) fn outlet(&self) -> Outlet {
        let channels = self.channels.iter().map(|(_, channel)| Arc::clone(channel)).collect();
        Outlet {
            sink: Box::new(ViewSink { channels, camera: Arc::clone(&self.view) }),
            takes_images: false,
            purpose: Purpose::Publish,
            // It never waits: the server drops messages for slow viewers.
            way: Way::Direct,
            is_essential: false,
        }
    }
}

/// Sink that sends results to viewers.
struct ViewSink {
    channels: Vec<Arc<Channel>>,
    camera: Arc<CameraView>,
}

impl Sink for ViewSink {
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        let Some(channel) = self.channels.get(message.topic) else { return Ok(()) };
        if message.topic == Output::Annotations as usize {
            self.camera.annotate(&message.data, message.log_time_ns);
        }
        channel.send(&message.data, message.log_time_ns);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        Ok(())
    }
}

/// One measured camera.
pub(super) struct Lane<'a> {
    images: String,
    transport: ImageTransport,
    worker: Worker,
    out: Publisher<'a>,
    view: Arc<CameraView>,
    has_image: bool,
}

impl<'a> Lane<'a> {
    pub(super) fn new(stage: Stage, camera: &Camera, fan_out: &'a FanOut<'a>) -> Self {
        Self {
            images: stage.images.name,
            transport: stage.images.transport,
            worker: stage.worker,
            out: Publisher::new(fan_out, stage.topics.len()),
            view: Arc::clone(&camera.view),
            has_image: false,
        }
    }
}

/// The measured cameras.
pub(super) struct Lanes<'a> {
    lanes: Vec<Lane<'a>>,
    /// Closed, so that buffers are freed instead of reused.
    spare: Queue<Vec<u8>>,
}

impl<'a> Lanes<'a> {
    pub(super) fn new(lanes: Vec<Lane<'a>>) -> Self {
        let spare = Queue::new(Bound { items: 1, bytes: 0 }, WhenFull::DropOldest);
        spare.close();
        Self { lanes, spare }
    }

    /// True if no camera is measured.
    pub(super) fn is_empty(&self) -> bool {
        self.lanes.is_empty()
    }

    /// True if every camera has received an image.
    pub(super) fn have_images(&self) -> bool {
        self.lanes.iter().all(|lane| lane.has_image)
    }

    /// True if a camera measures the messages on that topic.
    pub(super) fn is_image(&self, topic: &str) -> bool {
        self.lanes.iter().any(|lane| lane.images == topic)
    }

    /// True if frames may wait for messages on other topics.
    pub(super) fn has_side_topics(&self) -> bool {
        self.lanes.iter().any(|lane| !lane.worker.position_topics().is_empty())
    }

    /// Processes a message with positions or camera information.
    pub(super) fn take_side(&mut self, message: &RawMessage) {
        for lane in &mut self.lanes {
            if lane.worker.position_topics().contains(&message.topic.name) {
                let input = Input::Position(message.clone());
                report(lane.worker.step(input, &self.spare, &mut lane.out));
            }
        }
    }

    /// Measures an image, and shows it unless the last one was shown less than `min_gap` ago.
    pub(super) fn take_image(&mut self, message: RawMessage, min_gap: Duration) {
        let Some(lane) = self.lanes.iter_mut().find(|lane| lane.images == message.topic.name)
        else {
            return;
        };
        lane.has_image = true;
        let image = CameraImage {
            data: &message.data,
            transport: lane.transport,
            time_ns: message.log_time_ns,
        };
        if lane.view.choose(&image, min_gap) {
            lane.view.show(&image);
        }
        let input = Input::Message(message, PublisherId::default());
        report(lane.worker.step(input, &self.spare, &mut lane.out));
    }

    /// Measures waiting frames and ends open scans.
    pub(super) fn finish(&mut self) {
        for lane in &mut self.lanes {
            report(lane.worker.finish(&self.spare, &mut lane.out));
        }
    }
}

/// Logs a result that could not be encoded; later results are shown.
fn report(taken: Result<(), PublishError>) {
    if let Err(error) = taken {
        tracing::warn!("a result is not shown: {error}");
    }
}
