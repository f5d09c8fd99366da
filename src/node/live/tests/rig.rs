//! A node on the loopback, what it sends, and who speaks to it.

use std::{
    borrow::Cow,
    fs,
    path::PathBuf,
    sync::{Arc, Condvar, Mutex},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use serde::Deserialize;
use tempfile::TempDir;

use crate::{
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::{StartScanRequest, StartScanResponse},
        lifecycle_msgs::{ChangeStateRequest, ChangeStateResponse, Transition},
        qos::QosProfile,
        rcl_interfaces as rcl,
        schema::{Message, MessageType},
        sensor_msgs::Image,
        std_msgs::Header,
        std_srvs::{SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse},
    },
    node::{
        live::{LiveNode, error::LiveError, session::CameraSummary},
        rosout::RosoutSlot,
        stop::Stop,
        topics,
    },
    ros::{
        loopback::Loopback,
        names::NodeNames,
        parameters::Parameters,
        transport::{Arrival, Fault, OnArrival, Subscription, TopicEndpoint, Transport},
        value::Value,
    },
    scanner::calibration::Calibration,
};

/// 2020-01-01, so that times have their real size.
pub(super) const START_NS: i64 = 1_577_836_800_000_000_000;
pub(super) const MS: i64 = 1_000_000;
/// However slow the machine is.
const PATIENCE: Duration = Duration::from_secs(60);

pub(super) const CALIBRATION: &str = "type: vertical_incidence\nframe_id: laser\nimage_distance_m: 0.05\nobject_distance_m: 0.5\n\
     beta_rad: 0.6\npixel_pitch_m: 5.0e-6\nbase_row_px: 16.0\ncenter_column_px: 32.0\nheight_sign: -1\n";

/// An image with a stripe.
#[derive(Clone, Copy)]
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) row: u32,
    pub(super) encoding: &'static str,
}

impl Default for Picture {
    fn default() -> Self {
        Self { width: 64, height: 32, row: 10, encoding: "mono8" }
    }
}

impl Picture {
    /// As a message.
    pub(super) fn message(&self, stamp_ns: i64) -> Vec<u8> {
        let level = |row: u32| match row.abs_diff(self.row) {
            0 => 200,
            1 => 160,
            2 => 90,
            _ => 5,
        };
        let num_channels = if self.encoding == "rgb8" { 3 } else { 1 };
        let step = self.width * num_channels;
        let pixels: Vec<u8> =
            (0..self.height).flat_map(|row| vec![level(row); step as usize]).collect();
        let image = Image {
            header: Header { stamp: Time::from_ns(stamp_ns), frame_id: "optical".into() },
            height: self.height,
            width: self.width,
            encoding: self.encoding.into(),
            is_bigendian: 0,
            step,
            data: &pixels,
        };
        encoded(&image)
    }
}

pub(super) fn encoded(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes).unwrap();
    bytes
}

/// A message as it was heard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Heard {
    pub(super) topic: String,
    pub(super) data: Vec<u8>,
}

impl Heard {
    pub(super) fn decode<'de, M: Message + Deserialize<'de>>(&'de self) -> M {
        cdr::decode(&self.data).unwrap()
    }
}

/// Keeps what it hears, in order.
#[derive(Clone, Default)]
pub(super) struct Ear(Arc<(Mutex<Vec<Heard>>, Condvar)>);

impl Ear {
    fn on_arrival(&self, topic: &str) -> OnArrival {
        let (kept, topic) = (Arc::clone(&self.0), topic.to_owned());
        Box::new(move |arrival| {
            let data = arrival.unwrap().data;
            kept.0.lock().unwrap().push(Heard { topic: topic.clone(), data });
            kept.1.notify_all();
        })
    }

    /// Waits until what was heard is as it should be.
    pub(super) fn wait(&self, what: &str, mut is_so: impl FnMut(&[Heard]) -> bool) -> Vec<Heard> {
        let guard = self.0.0.lock().unwrap();
        let (guard, timeout) =
            self.0.1.wait_timeout_while(guard, PATIENCE, |heard| !is_so(heard)).unwrap();
        assert!(!timeout.timed_out(), "not heard in time: {what}; heard {}", guard.len());
        guard.clone()
    }

    /// Waits for that many messages of a topic, and returns them.
    pub(super) fn wait_for(&self, topic: &str, num: usize) -> Vec<Heard> {
        let heard = self.wait(&format!("{num} of {topic}"), |heard| {
            heard.iter().filter(|message| message.topic == topic).count() >= num
        });
        heard.into_iter().filter(|message| message.topic == topic).collect()
    }

    /// Waits for a message that says something, the last one first.
    pub(super) fn wait_until<'a, T>(
        &self,
        what: &str,
        topic: &str,
        mut read: impl FnMut(&Heard) -> Option<T>,
    ) -> T {
        let mut found = None;
        self.wait(what, |heard| {
            let of_topic = heard.iter().rev().filter(|message| message.topic == topic);
            found = of_topic.take(1).find_map(&mut read);
            found.is_some()
        });
        found.unwrap()
    }

    /// What was heard of a topic so far.
    pub(super) fn heard(&self, topic: &str) -> Vec<Heard> {
        let heard = self.0.0.lock().unwrap();
        heard.iter().filter(|message| message.topic == topic).cloned().collect()
    }
}

/// A camera driver.
pub(super) struct TestCamera {
    network: Loopback,
    topic: String,
    pub(super) picture: Picture,
    pub(super) publisher: [u8; 16],
    pub(super) sequence: i64,
    /// Time of the last frame, after the start.
    pub(super) at_ms: i64,
}

impl TestCamera {
    /// The next frame, 10 ms after the one before.
    pub(super) fn shoot(&mut self) {
        self.at_ms += 10;
        self.sequence += 1;
        self.send(self.picture.message(START_NS + self.at_ms * MS));
    }

    pub(super) fn shoot_times(&mut self, num: usize) {
        (0..num).for_each(|_| self.shoot());
    }

    /// Any bytes as a frame.
    pub(super) fn send(&self, data: Vec<u8>) {
        self.deliver(Ok(Arrival {
            data,
            publisher: self.publisher,
            sequence: Some(self.sequence),
            source_time_ns: START_NS + self.at_ms * MS,
            receive_time_ns: START_NS + self.at_ms * MS + 1,
        }));
    }

    pub(super) fn deliver(&self, arrival: Result<Arrival, Fault>) {
        self.network.deliver(&self.topic, &arrival);
    }
}

/// A node that runs, and its network.
pub(super) struct Rig {
    pub(super) network: Loopback,
    pub(super) ear: Ear,
    pub(super) place: TempDir,
    stop: Stop,
    thread: Option<JoinHandle<Vec<CameraSummary>>>,
    _subscriptions: Vec<Box<dyn Subscription>>,
}

/// What a node is made of.
pub(super) struct Setup {
    pub(super) network: Loopback,
    pub(super) place: TempDir,
    pub(super) values: Parameters,
    pub(super) slot: RosoutSlot,
}

impl Setup {
    /// For small pictures, calibrated, a millimetre a frame.
    pub(super) fn new() -> Self {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("c.yaml"), CALIBRATION).unwrap();
        let (network, values) = (Loopback::default(), Parameters::default());
        let mut setup = Self { network, place, values, slot: RosoutSlot::default() };
        setup.set_camera("");
        let place = setup.path("bags");
        setup.set("recording.directory", text(place.to_str().unwrap()));
        setup.set("recording.min_free_bytes", Value::Integer(0));
        setup
    }

    /// The values of small pictures for a camera; of several, its name.
    pub(super) fn set_camera(&mut self, camera: &str) {
        let prefix = if camera.is_empty() { String::new() } else { format!("{camera}.") };
        let calibration = self.path("c.yaml");
        let values = [
            ("extraction.min_segment_area", Value::Integer(20)),
            ("slice.profiles", Value::Integer(4)),
            ("motion.source", text("constant")),
            ("motion.step", Value::Float(0.001)),
            ("calibration_file", text(calibration.to_str().unwrap())),
        ];
        for (name, value) in values {
            self.set(&format!("{prefix}{name}"), value);
        }
    }

    pub(super) fn set(&mut self, name: &str, value: Value) {
        self.values.set(name, value, "a test").unwrap();
    }

    pub(super) fn with(mut self, name: &str, value: Value) -> Self {
        self.set(name, value);
        self
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    /// Starts it, or says why it does not.
    pub(super) fn start(self) -> Result<Rig, LiveError> {
        let Self { network, place, values, slot } = self;
        let names = NodeNames::new("laser_profiler", &[]).unwrap();
        let ear = Ear::default();
        let calibration = Calibration::from_yaml(CALIBRATION).unwrap();
        let cameras = values.cameras().iter();
        let outputs = cameras
            .flat_map(|camera| topics::published(&names, camera, Some(&calibration)).unwrap());
        let mut endpoints: Vec<TopicEndpoint> = outputs.collect();
        // Every camera has its own publisher of the diagnostics; one subscription hears all.
        endpoints.dedup_by(|a, b| a.name == b.name);
        let mut is_first = true;
        endpoints.retain(|endpoint| {
            endpoint.name != "/diagnostics" || std::mem::replace(&mut is_first, false)
        });
        let subscribe = |endpoint: &TopicEndpoint| {
            network.subscribe(endpoint, usize::MAX, ear.on_arrival(&endpoint.name)).unwrap()
        };
        let subscriptions = endpoints.iter().map(subscribe).collect();
        let stop = Stop::default();
        let transport: Arc<dyn Transport> = Arc::new(network.clone());
        let node = LiveNode::on(&transport, &names, values, slot)?;
        let stopped = stop.clone();
        let thread = Some(thread::spawn(move || node.run(&stopped)));
        Ok(Rig { network, ear, place, stop, thread, _subscriptions: subscriptions })
    }
}

impl Rig {
    /// A node with the usual values.
    pub(super) fn start() -> Self {
        Setup::new().start().unwrap()
    }

    pub(super) fn camera(&self) -> TestCamera {
        self.camera_on("/image_raw")
    }

    pub(super) fn camera_on(&self, topic: &str) -> TestCamera {
        TestCamera {
            network: self.network.clone(),
            topic: topic.to_owned(),
            picture: Picture::default(),
            publisher: [7; 16],
            sequence: 0,
            at_ms: 0,
        }
    }

    /// Listens on one more topic.
    pub(super) fn listen(
        &self,
        name: &str,
        kind: &'static MessageType,
    ) -> (Ear, Box<dyn Subscription>) {
        let ear = Ear::default();
        let endpoint = TopicEndpoint { name: name.into(), kind, qos: QosProfile::latched(1) };
        let subscription =
            self.network.subscribe(&endpoint, usize::MAX, ear.on_arrival(name)).unwrap();
        (ear, subscription)
    }

    /// Waits for that many results of the only camera.
    pub(super) fn results(&self, name: &str, num: usize) -> Vec<Heard> {
        self.ear.wait_for(&format!("/laser_profiler/{name}"), num)
    }

    /// Ends it as a signal does.
    pub(super) fn end(mut self) -> Vec<CameraSummary> {
        self.stop.raise();
        self.thread.take().unwrap().join().unwrap()
    }

    /// Ends it, and keeps what it has written.
    pub(super) fn end_and_keep(mut self) -> (Vec<CameraSummary>, TempDir) {
        self.stop.raise();
        (self.thread.take().unwrap().join().unwrap(), self.place)
    }

    /// Waits for a node that ends by itself.
    pub(super) fn ended(mut self) -> Vec<CameraSummary> {
        self.thread.take().unwrap().join().unwrap()
    }

    fn call(&self, service: &str, request: &impl Message) -> Vec<u8> {
        let name = format!("/laser_profiler/{service}");
        self.network.call(&name, &encoded(request)).unwrap()
    }

    pub(super) fn trigger(&self, service: &str) -> (bool, String) {
        let bytes = self.call(service, &TriggerRequest::default());
        let response: TriggerResponse<'_> = cdr::decode(&bytes).unwrap();
        (response.success, response.message.into_owned())
    }

    pub(super) fn record(&self, data: bool) -> (bool, String) {
        let bytes = self.call("record", &SetBoolRequest { data });
        let response: SetBoolResponse<'_> = cdr::decode(&bytes).unwrap();
        (response.success, response.message.into_owned())
    }

    /// Success, message and identity.
    pub(super) fn scan(&self, part_id: &str, length: f64) -> (bool, String, [u8; 16]) {
        let request = StartScanRequest { part_id: part_id.into(), length };
        let bytes = self.call("scan", &request);
        let response: StartScanResponse<'_> = cdr::decode(&bytes).unwrap();
        (response.success, response.message.into_owned(), response.scan_id.uuid)
    }

    pub(super) fn change_state(&self, label: &str) -> bool {
        let transition = Transition { id: 0, label: label.into() };
        let bytes = self.call("change_state", &ChangeStateRequest { transition });
        cdr::decode::<ChangeStateResponse>(&bytes).unwrap().success
    }

    /// Why not; `Ok` when it counts.
    pub(super) fn set(&self, name: &str, value: &Value) -> Result<(), String> {
        set(&self.network, name, value)
    }
}

/// Sets a parameter by its service.
pub(super) fn set(network: &Loopback, name: &str, value: &Value) -> Result<(), String> {
    let value = match value {
        Value::Bool(value) => rcl::ParameterValue {
            kind: rcl::parameter_type::BOOL,
            bool_value: *value,
            ..Default::default()
        },
        Value::Integer(value) => rcl::ParameterValue {
            kind: rcl::parameter_type::INTEGER,
            integer_value: *value,
            ..Default::default()
        },
        Value::Float(value) => rcl::ParameterValue {
            kind: rcl::parameter_type::DOUBLE,
            double_value: *value,
            ..Default::default()
        },
        Value::Text(value) => rcl::ParameterValue {
            kind: rcl::parameter_type::STRING,
            string_value: Cow::Borrowed(value),
            ..Default::default()
        },
        Value::TextList(_) => unreachable!("no test sets a list"),
    };
    let parameters = vec![rcl::Parameter { name: name.into(), value }];
    let request = encoded(&rcl::SetParametersRequest { parameters });
    let bytes = network.call("/laser_profiler/set_parameters", &request).unwrap();
    let response: rcl::SetParametersResponse<'_> = cdr::decode(&bytes).unwrap();
    let result = &response.results[0];
    if result.successful { Ok(()) } else { Err(result.reason.clone().into_owned()) }
}

/// Waits for what a thread brings about.
pub(super) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < deadline, "not in time: {what}");
        thread::sleep(Duration::from_millis(2));
    }
}

pub(super) fn text(value: &str) -> Value {
    Value::Text(value.to_owned())
}
