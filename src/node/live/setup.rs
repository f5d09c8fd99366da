//! Creates a camera from its parameters: topics, worker and sinks.

use std::sync::{
    Arc, Mutex,
    atomic::{AtomicU64, Ordering},
};

use super::{
    camera::{Camera, Environment, Identity, Images, Measuring},
    error::LiveError,
    notes,
    observer::Observer,
    publications::Publications,
    recording,
};
use crate::{
    msg::{
        qos::QosProfile,
        schema::Message,
        sensor_msgs::{CameraInfo, CompressedImage, Image},
    },
    node::{
        ambient_file, calibration_file,
        clock::{RosClock, TimeSource, system_ns},
        input,
        live_recording::RecordingControl,
        positions,
        queue::WhenFull,
        recording::Description,
        results::Results,
        run::INPUT_BOUND,
        sink::{Outlet, Purpose, SINK_BOUND, Way},
        static_tf::StaticTf,
        status::{Note, Reporter, session_id},
        topics,
        watch::Watch,
        worker::{
            Worker, WorkerOptions,
            online::{Recorded, Survey},
        },
    },
    ros::{
        camera_params::CameraParams,
        names::NodeNames,
        node_params::{ImageTransport, NodeParams},
        parameters::{ParameterError, Parameters},
        qos_overrides::Side,
        transport::{TopicEndpoint, Transport, TransportError},
        value::Value,
    },
    scanner::{calibration::Calibration, pipeline::Pipeline},
};

/// Upper bound of an image message without its pixels, bytes.
const MESSAGE_MARGIN_BYTES: usize = 64 << 10;
/// Images that the middleware may queue for a slow worker.
const IMAGE_DEPTH: u64 = 5;

/// Transport, names and clock, shared by the cameras of a node.
pub(super) struct Context {
    transport: Arc<dyn Transport>,
    names: NodeNames,
    clock: RosClock,
    watch: Watch,
}

impl Context {
    pub(super) fn new(transport: Arc<dyn Transport>, names: NodeNames, clock: RosClock) -> Self {
        Self { transport, names, clock, watch: Watch::default() }
    }

    /// Notes panics of the threads of the cameras.
    #[must_use]
    pub(super) fn watched_by(self, watch: Watch) -> Self {
        Self { watch, ..self }
    }

    /// Chooses the source of time.
    pub(super) fn choose_time(&self, params: &NodeParams) -> Result<(), TransportError> {
        let source = if params.use_sim_time { TimeSource::Sim } else { TimeSource::System };
        self.clock.set_source(&*self.transport, &self.names, source)
    }

    /// Starts a camera.
    pub(super) fn camera(
        &self,
        params: &NodeParams,
        values: &Parameters,
        number: usize,
        tf: &Arc<Mutex<StaticTf>>,
    ) -> Result<(Camera, Measuring), LiveError> {
        let camera = &params.cameras[number];
        let calibration =
            camera.calibration_file.as_deref().map(calibration_file::load).transpose()?;
        let (calibration, text) = calibration.unzip();
        let endpoints = self.images(params, camera)?;
        let mut outputs = topics::published(&self.names, &camera.name, calibration.as_ref())?;
        for output in &mut outputs {
            output.qos = params.qos_overrides.apply(&output.name, Side::Publisher, output.qos);
        }
        let description = Description {
            parameters: values.camera_yaml(&camera.name),
            parameters_sha256: values.camera_sha256(&camera.name),
            input_topic: endpoints[0].name.clone(),
            calibration: text,
            ..Description::default()
        };
        let part_frame = camera.part_frame(calibration.as_ref());
        let positions = self.positions(params, camera)?;
        let direction = camera.scanner.stripe_direction;
        positions::missing_axis::warn(&camera.scanner.motion, calibration.as_ref());
        let (tf, clock) = (Arc::clone(tf), self.clock.clone());
        let observer = Observer::new(number, calibration.clone(), direction, tf, clock);
        let position_topics = topics::recorded(&positions);
        let names = position_topics.iter().map(|topic| topic.name.clone()).collect();
        let worker = self
            .worker(params, camera, calibration.as_ref(), &description)?
            .with_positions(positions::of_camera(camera, calibration.as_ref())?, names);
        let limit_bytes = camera.max_frame_bytes as usize + MESSAGE_MARGIN_BYTES;
        let transport = Arc::clone(&self.transport);
        let images = Arc::new(Images::new(transport, endpoints, positions, limit_bytes, observer));
        let mut inputs = topics::recorded(std::slice::from_ref(&images.endpoint));
        inputs.extend(position_topics);
        let (recorder, recording) = recording::recorder(
            &camera.name,
            &params.recording,
            description.clone(),
            recording::topics(topics::recorded(&outputs), inputs),
            &self.watch,
        );
        // The recorder comes first: every published message has been recorded.
        let outlets = vec![recorder, self.publications(&camera.name, &outputs)?];
        let (seen, watch) = (Arc::clone(&images), self.watch.clone());
        let num_restarts = AtomicU64::new(0);
        let survey = NodeSurvey { images: seen, recording: recording.clone(), watch, num_restarts };
        let survey: Box<dyn Survey> = Box::new(survey);
        let (clock, watch) = (self.clock.clone(), self.watch.clone());
        let surroundings = Environment { clock, survey, outlets, num_topics: outputs.len(), watch };
        let name = camera.name.clone();
        let identity = Identity { name, part_frame, recording, description };
        Ok(Camera::start(identity, images, worker, surroundings)?)
    }

    /// The effective values, raw and typed. Where `points.max_bytes` is 0, the limit of the middleware takes its place.
    pub(super) fn effective(
        &self,
        mut values: Parameters,
    ) -> Result<(Parameters, NodeParams), ParameterError> {
        let params = NodeParams::new(&values)?;
        let Some(max_bytes) = self.transport.max_reliable_bytes() else {
            return Ok((values, params));
        };
        let max_bytes = i64::try_from(max_bytes).unwrap_or(i64::MAX);
        for camera in params.cameras.iter().filter(|camera| camera.points_max_bytes.is_none()) {
            let name = camera.full_name("points.max_bytes");
            values.set(&name, Value::Integer(max_bytes), self.transport.name())?;
        }
        let params = NodeParams::new(&values)?;
        Ok((values, params))
    }

    /// The topics of the images and of their descriptions, best effort, so that they match every publisher.
    fn images(
        &self,
        params: &NodeParams,
        camera: &CameraParams,
    ) -> Result<[TopicEndpoint; 2], LiveError> {
        let base = input::image_topic_of(&camera.name, &self.names)?;
        let info = match self.names.remapped(&topics::of_camera(&camera.name, "camera_info"))? {
            Some(info) => info,
            // The convention of `image_transport`: next to the images.
            None => {
                format!("{}/camera_info", base.rsplit_once('/').map_or("", |(parent, _)| parent))
            }
        };
        let (images, kind) = match camera.image_transport {
            ImageTransport::Raw => (base, Image::TYPE),
            ImageTransport::Compressed => (format!("{base}/compressed"), CompressedImage::TYPE),
        };
        let endpoint = |name: String, kind| {
            let qos = QosProfile::best_effort(IMAGE_DEPTH);
            let qos = params.qos_overrides.apply(&name, Side::Subscription, qos);
            TopicEndpoint { name, kind, qos }
        };
        Ok([endpoint(images, kind), endpoint(info, CameraInfo::TYPE)])
    }

    /// The topics with the positions of frames.
    fn positions(
        &self,
        params: &NodeParams,
        camera: &CameraParams,
    ) -> Result<Vec<TopicEndpoint>, LiveError> {
        let source = camera.scanner.motion.source;
        let mut endpoints = positions::topics::endpoints(source, &self.names, &camera.name)?;
        for endpoint in &mut endpoints {
            let side = Side::Subscription;
            endpoint.qos = params.qos_overrides.apply(&endpoint.name, side, endpoint.qos);
        }
        Ok(endpoints)
    }

    /// The publisher of the poses of the laser planes.
    pub(super) fn static_tf(&self, num_cameras: usize) -> Result<Arc<Mutex<StaticTf>>, LiveError> {
        let tf = StaticTf::start(&*self.transport, &self.names, num_cameras)?;
        Ok(Arc::new(Mutex::new(tf)))
    }

    fn worker(
        &self,
        params: &NodeParams,
        camera: &CameraParams,
        calibration: Option<&Calibration>,
        description: &Description,
    ) -> Result<Worker, LiveError> {
        let part_frame = camera.part_frame(calibration);
        let scanner = camera.scanner_for(&part_frame);
        let sha256 = &description.parameters_sha256;
        let results = Results::new(&scanner, calibration, sha256).with_part_frame(part_frame);
        // The start time distinguishes a live session from every other one.
        let seed = format!("{sha256}{}", system_ns());
        let reporter = Reporter {
            node: self.names.fully_qualified(),
            camera: camera.name.clone(),
            topic: description.input_topic.clone(),
            queue_capacity: INPUT_BOUND.items as u32,
            session_id: session_id(&description.input_topic, &seed),
        };
        let options = WorkerOptions {
            transport: camera.image_transport,
            max_frame_bytes: camera.max_frame_bytes,
            sends_images: sends_images(params),
        };
        let mut pipeline =
            Pipeline::new(scanner, calibration.cloned()).with_ambient(ambient_file::load(camera)?);
        if camera.tracks_laser(calibration) {
            pipeline = pipeline.with_laser_tracked();
        }
        Ok(Worker::new(options, pipeline, results, reporter)
            .with_camera_info(calibration.cloned(), None))
    }

    fn publications(&self, camera: &str, outputs: &[TopicEndpoint]) -> Result<Outlet, LiveError> {
        let sink = Publications::advertise(&*self.transport, outputs)?;
        let name = format!("the publisher of camera {camera:?}");
        Ok(Outlet {
            sink: self.watch.sink(name, Box::new(sink)),
            takes_images: false,
            purpose: Purpose::Publish,
            way: Way::Queued(SINK_BOUND, WhenFull::DropOldest),
            is_essential: false,
        })
    }
}

/// The node's answers to the questions of a camera's worker.
struct NodeSurvey {
    images: Arc<Images>,
    recording: RecordingControl,
    watch: Watch,
    /// Replacements of the middleware process that have been reported.
    num_restarts: AtomicU64,
}

impl Survey for NodeSurvey {
    fn notes(&self) -> Vec<Note> {
        let mut notes = recording::notes(&self.recording.status());
        notes.extend(self.watch.panicked().map(notes::on_panic));
        let health = self.images.transport.health();
        let before = self.num_restarts.swap(health.num_restarts, Ordering::Relaxed);
        notes.extend(notes::on_health(&health, before));
        if let Some(num_publishers) = self.images.num_publishers() {
            let Images { transport, endpoint, observer, .. } = &*self.images;
            notes.extend(notes::on_publishers(&**transport, endpoint, num_publishers));
            notes.extend(observer.notes());
            notes.extend(notes::on_positions(&**transport, &self.images.unmatched_positions()));
        }
        notes
    }

    fn recorded(&self) -> Recorded {
        let status = self.recording.status();
        Recorded { dropped: recording::num_dropped(&status), bytes: recording::num_bytes(&status) }
    }
}

/// True if input images are forwarded to the recorder.
pub(super) const fn sends_images(params: &NodeParams) -> bool {
    params.recording.images
}
