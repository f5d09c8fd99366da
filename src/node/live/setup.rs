//! A camera from its parameters: topics, worker and sinks.

use std::sync::Arc;

use super::{
    camera::{Camera, Images, Measuring},
    error::LiveError,
    notes,
    publications::Publications,
};
use crate::{
    msg::{
        qos::QosProfile,
        schema::Message,
        sensor_msgs::{CompressedImage, Image},
    },
    node::{
        calibration_file,
        clock::RosClock,
        input,
        queue::WhenFull,
        recording::Description,
        results::Results,
        run::INPUT_BOUND,
        sink::{Outlet, Purpose, SINK_BOUND, Takes},
        status::{Reporter, session_id},
        topics,
        worker::{
            Worker, WorkerOptions,
            live::{Notes, NowNs},
        },
    },
    ros::{
        camera_params::CameraParams,
        names::NodeNames,
        node_params::{ImageTransport, NodeParams},
        parameters::Parameters,
        qos_overrides::Side,
        transport::{TopicEndpoint, Transport},
    },
    scanner::{calibration::Calibration, params::Params, pipeline::Pipeline},
};

/// What an image message has besides its pixels, bytes, generously.
const MESSAGE_MARGIN_BYTES: usize = 64 << 10;
/// Images that the middleware may hold back for a slow worker.
const IMAGE_DEPTH: u64 = 5;

/// What the cameras of a node share.
pub(super) struct Context {
    transport: Arc<dyn Transport>,
    names: NodeNames,
    clock: RosClock,
    now_ns: NowNs,
}

impl Context {
    pub(super) fn new(transport: Arc<dyn Transport>, names: NodeNames, clock: RosClock) -> Self {
        let told = clock.clone();
        Self { transport, names, clock, now_ns: Arc::new(move || told.now_ns()) }
    }

    /// Chooses the source of time.
    pub(super) fn use_sim_time(&self, wanted: bool) -> Result<(), String> {
        let chosen = self.clock.use_sim_time(&*self.transport, &self.names, wanted);
        chosen.map_err(|error| error.to_string())
    }

    /// Starts a camera.
    pub(super) fn camera(
        &self,
        params: &NodeParams,
        values: &Parameters,
        camera: &CameraParams,
    ) -> Result<(Camera, Measuring), LiveError> {
        let calibration =
            camera.calibration_file.as_deref().map(calibration_file::load).transpose()?;
        let (calibration, text) = calibration.unzip();
        let endpoint = self.images(params, camera)?;
        let mut outputs = topics::published(&self.names, &camera.name, calibration.as_ref())?;
        for output in &mut outputs {
            output.qos = params.qos_overrides.apply(&output.name, Side::Publisher, output.qos);
        }
        let description = Description {
            parameters: values.camera_yaml(&camera.name),
            parameters_sha256: values.camera_sha256(&camera.name),
            input_topic: endpoint.name.clone(),
            calibration: text,
            ..Description::default()
        };
        let frame_id = calibration.as_ref().map_or("", Calibration::frame_id).to_owned();
        let worker = self.worker(camera, calibration, &description);
        let limit_bytes = camera.max_frame_bytes as usize + MESSAGE_MARGIN_BYTES;
        let images = Arc::new(Images::new(Arc::clone(&self.transport), endpoint, limit_bytes));
        let outlets = vec![self.publications(&outputs)?];
        let notes = self.notes(Arc::clone(&images));
        let clocks = (Arc::clone(&self.now_ns), notes);
        Ok(Camera::start((&camera.name, frame_id), images, worker, clocks, outlets, outputs.len())?)
    }

    /// The measurement, with slices that the middleware carries.
    pub(super) fn scanner(&self, camera: &CameraParams, frame_id: &str) -> Params {
        camera.scanner_within(self.transport.max_reliable_bytes(), frame_id)
    }

    /// The image topic, best effort, so that it matches every publisher.
    fn images(
        &self,
        params: &NodeParams,
        camera: &CameraParams,
    ) -> Result<TopicEndpoint, LiveError> {
        let base = input::image_topic_of(&camera.name, &self.names)?;
        let (name, kind) = match camera.image_transport.unwrap_or(ImageTransport::Raw) {
            ImageTransport::Raw => (base, Image::TYPE),
            ImageTransport::Compressed => (format!("{base}/compressed"), CompressedImage::TYPE),
        };
        let qos = QosProfile::best_effort(IMAGE_DEPTH);
        let qos = params.qos_overrides.apply(&name, Side::Subscription, qos);
        Ok(TopicEndpoint { name, kind, qos })
    }

    fn worker(
        &self,
        camera: &CameraParams,
        calibration: Option<Calibration>,
        description: &Description,
    ) -> Worker {
        let frame_id = calibration.as_ref().map_or("", Calibration::frame_id);
        let scanner = self.scanner(camera, frame_id);
        let sha256 = &description.parameters_sha256;
        let results = Results::new(&scanner, calibration.as_ref(), sha256);
        // A live session is told from every other by when it began.
        let begun = format!("{sha256}{}", (self.now_ns)());
        let reporter = Reporter {
            node: self.names.fully_qualified(),
            topic: description.input_topic.clone(),
            queue_capacity: INPUT_BOUND.items as u32,
            session_id: session_id(&description.input_topic, &begun),
        };
        let options = WorkerOptions {
            transport: camera.image_transport.unwrap_or(ImageTransport::Raw),
            max_frame_bytes: camera.max_frame_bytes,
            sends_images: false,
        };
        Worker::new(options, Pipeline::new(scanner, calibration), results, reporter)
    }

    fn publications(&self, outputs: &[TopicEndpoint]) -> Result<Outlet, LiveError> {
        let now_ns = Arc::clone(&self.now_ns);
        let sink = Publications::advertise(&*self.transport, outputs, now_ns)?;
        Ok(Outlet {
            sink: Box::new(sink),
            takes: Takes::Results,
            purpose: Purpose::Publish,
            bound: SINK_BOUND,
            when_full: WhenFull::DropOldest,
            is_essential: false,
            idle_period: None,
        })
    }

    fn notes(&self, images: Arc<Images>) -> Notes {
        Arc::new(move || match images.num_publishers() {
            Some(num) => notes::on_publishers(&*images.transport, &images.endpoint, num),
            None => Vec::new(),
        })
    }
}
