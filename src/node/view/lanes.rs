//! Every camera's way from an image to viewers: its worker, driven by hand, and a sink that serves what it publishes.

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

/// The path from a camera's images to viewers; all except the channels is recreated after every jump.
pub(super) struct Camera {
    /// Its pictures.
    pub(super) view: Arc<CameraView>,
    /// Its results, by the number of the topic.
    channels: Vec<(String, Arc<Channel>)>,
}

impl Camera {
    pub(super) fn new(view: Arc<CameraView>) -> Self {
        Self { view, channels: Vec::new() }
    }

    /// Serves the topics of its results that are not served yet: with a calibration there are more.
    pub(super) fn serve(&mut self, server: &Server, stage: &Stage) -> Result<(), ViewError> {
        self.channels.truncate(stage.topics.len());
        for topic in &stage.topics[self.channels.len()..] {
            self.channels.push((topic.name.clone(), serve(server, topic)?));
        }
        Ok(())
    }

    /// True if it publishes that output.
    pub(super) const fn has(&self, output: Output) -> bool {
        self.channels.len() > output as usize
    }

    /// True if it publishes on that topic.
    pub(super) fn publishes(&self, topic: &str) -> bool {
        self.channels.iter().any(|(name, _)| name == topic)
    }

    /// Where its results go.
    pub(super) fn outlet(&self) -> Outlet {
        let channels = self.channels.iter().map(|(_, channel)| Arc::clone(channel)).collect();
        Outlet {
            sink: Box::new(ViewSink { channels, camera: Arc::clone(&self.view) }),
            takes_images: false,
            purpose: Purpose::Publish,
            // It never waits: what a viewer cannot take is dropped by the server.
            way: Way::Direct,
            is_essential: false,
        }
    }
}

/// Viewers as a sink.
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

/// A camera that measures.
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

/// The cameras that measure.
pub(super) struct Lanes<'a> {
    lanes: Vec<Lane<'a>>,
    /// Closed: buffers are simply freed.
    spare: Queue<Vec<u8>>,
}

impl<'a> Lanes<'a> {
    pub(super) fn new(lanes: Vec<Lane<'a>>) -> Self {
        let spare = Queue::new(Bound { items: 1, bytes: 0 }, WhenFull::DropOldest);
        spare.close();
        Self { lanes, spare }
    }

    /// True if nothing is measured.
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

    /// True if frames may wait for other messages.
    pub(super) fn has_side_topics(&self) -> bool {
        self.lanes.iter().any(|lane| !lane.worker.position_topics().is_empty())
    }

    /// Processes messages about positions and cameras.
    pub(super) fn take_side(&mut self, message: &RawMessage) {
        for lane in &mut self.lanes {
            if lane.worker.position_topics().contains(&message.topic.name) {
                let input = Input::Position(message.clone());
                tell(lane.worker.step(input, &self.spare, &mut lane.out));
            }
        }
    }

    /// Shows an image, unless the last one was less than `min_gap` ago, and measures it.
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
        tell(lane.worker.step(input, &self.spare, &mut lane.out));
    }

    /// Measures what still waits, and ends open scans.
    pub(super) fn finish(&mut self) {
        for lane in &mut self.lanes {
            tell(lane.worker.finish(&self.spare, &mut lane.out));
        }
    }
}

/// A result without bytes is missing from the picture; what comes after it is shown.
fn tell(taken: Result<(), PublishError>) {
    if let Err(error) = taken {
        tracing::warn!("a result is not shown: {error}");
    }
}
