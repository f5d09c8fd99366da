//! A node on the loopback, with its publishers and clients.

use std::{
    borrow::Cow,
    fs,
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
};

use tempfile::TempDir;

use super::{
    driver::{Picture, TestCamera, encoded},
    listener::{Listener, Received},
};

use crate::{
    msg::{
        cdr,
        laser_profiler_msgs::{StartScanRequest, StartScanResponse},
        lifecycle_msgs::{
            ChangeStateRequest, ChangeStateResponse, GetStateRequest, GetStateResponse, Transition,
        },
        qos::QosProfile,
        rcl_interfaces as rcl,
        schema::{Message, MessageType},
        std_srvs::{SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse},
    },
    node::{
        live::{LiveNode, error::LiveError, session::CameraSummary},
        parameter_server::ParameterHandle,
        rosout::RosoutSlot,
        stop::Stop,
        topics,
    },
    ros::{
        loopback::Loopback,
        names::NodeNames,
        parameters::Parameters,
        transport::{Subscription, TopicEndpoint, Transport},
        value::Value,
    },
    scanner::calibration::Calibration,
};

pub(super) const CALIBRATION: &str = "type: vertical_incidence\nframe_id: laser\nimage_distance_m: 0.05\nobject_distance_m: 0.5\n\
     beta_rad: 0.6\npixel_pitch_m: 5.0e-6\nbase_row_px: 16.0\ncenter_column_px: 32.0\nheight_sign: -1\n";

/// A running node and its network.
pub(super) struct Rig {
    pub(super) network: Loopback,
    pub(super) listener: Listener,
    pub(super) place: TempDir,
    pub(super) parameters: ParameterHandle,
    stop: Stop,
    thread: Option<JoinHandle<Result<Vec<CameraSummary>, LiveError>>>,
    _subscriptions: Vec<Box<dyn Subscription>>,
}

/// The setup of a node.
pub(super) struct Setup {
    pub(super) network: Loopback,
    pub(super) place: TempDir,
    pub(super) values: Parameters,
    pub(super) slot: RosoutSlot,
    /// The network as the node sees it.
    pub(super) through: Through,
}

type Through = Box<dyn FnOnce(Arc<dyn Transport>) -> Arc<dyn Transport>>;

impl Setup {
    /// Setup for small images with a calibration and one millimetre per frame.
    pub(super) fn new() -> Self {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("c.yaml"), CALIBRATION).unwrap();
        let through: Through = Box::new(|network| network);
        let (network, values) = (Loopback::default(), Parameters::default());
        let mut setup = Self { network, place, values, slot: RosoutSlot::default(), through };
        setup.set_camera("");
        let place = setup.path("bags");
        setup.set("recording.directory", text(place.to_str().unwrap()));
        setup.set("recording.min_free_bytes", Value::Integer(0));
        setup
    }

    /// Sets the values of small images for a camera, whose name is empty if it is the only one.
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

    /// Starts the node, or returns the error.
    pub(super) fn start(self) -> Result<Rig, LiveError> {
        let Self { network, place, values, slot, through } = self;
        let names = NodeNames::new("laser_profiler", &[]).unwrap();
        let listener = Listener::default();
        let calibration = Calibration::from_yaml(CALIBRATION).unwrap();
        let cameras = values.cameras().iter();
        let outputs = cameras
            .flat_map(|camera| topics::published(&names, camera, Some(&calibration)).unwrap());
        let mut endpoints: Vec<TopicEndpoint> = outputs.collect();
        // Every camera has its own publisher of the diagnostics; one subscription receives all.
        endpoints.dedup_by(|a, b| a.name == b.name);
        let mut is_first = true;
        endpoints.retain(|endpoint| {
            endpoint.name != "/diagnostics" || std::mem::replace(&mut is_first, false)
        });
        let subscribe = |endpoint: &TopicEndpoint| {
            network.subscribe(endpoint, usize::MAX, listener.on_arrival(&endpoint.name)).unwrap()
        };
        let subscriptions = endpoints.iter().map(subscribe).collect();
        let stop = Stop::default();
        let transport: Arc<dyn Transport> = through(Arc::new(network.clone()));
        let node = LiveNode::on(&transport, &names, values, slot)?;
        let parameters = node.parameters();
        let stopped = stop.clone();
        let thread = Some(thread::spawn(move || node.run(&stopped)));
        Ok(Rig {
            network,
            listener,
            place,
            parameters,
            stop,
            thread,
            _subscriptions: subscriptions,
        })
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
    ) -> (Listener, Box<dyn Subscription>) {
        let listener = Listener::default();
        let endpoint = TopicEndpoint { name: name.into(), kind, qos: QosProfile::latched(1) };
        let subscription =
            self.network.subscribe(&endpoint, usize::MAX, listener.on_arrival(name)).unwrap();
        (listener, subscription)
    }

    /// Waits for that many results of the only camera.
    pub(super) fn results(&self, name: &str, num: usize) -> Vec<Received> {
        self.listener.wait_for(&format!("/laser_profiler/{name}"), num)
    }

    /// Ends the node as a signal does.
    pub(super) fn end(mut self) -> Vec<CameraSummary> {
        self.stop.raise();
        self.thread.take().unwrap().join().unwrap().unwrap()
    }

    /// Ends the node and keeps its files.
    pub(super) fn end_and_keep(mut self) -> (Vec<CameraSummary>, TempDir) {
        self.stop.raise();
        (self.thread.take().unwrap().join().unwrap().unwrap(), self.place)
    }

    /// Waits for a node that ends by itself.
    pub(super) fn ended(mut self) -> (Result<Vec<CameraSummary>, LiveError>, TempDir) {
        (self.thread.take().unwrap().join().unwrap(), self.place)
    }

    /// True if the node has ended by itself.
    pub(super) fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// The number and name of the node's state.
    pub(super) fn state(&self) -> (u8, String) {
        let bytes = self.call("get_state", &GetStateRequest::default());
        let response: GetStateResponse<'_> = cdr::decode(&bytes).unwrap();
        (response.current_state.id, response.current_state.label.into_owned())
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

    pub(super) fn start_recording(&self) -> (bool, String) {
        self.record(SetBoolRequest { data: true })
    }

    pub(super) fn stop_recording(&self) -> (bool, String) {
        self.record(SetBoolRequest { data: false })
    }

    fn record(&self, request: SetBoolRequest) -> (bool, String) {
        let bytes = self.call("record", &request);
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

    /// Returns `Ok`, or the reason for refusal.
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

pub(super) fn text(value: &str) -> Value {
    Value::Text(value.to_owned())
}
