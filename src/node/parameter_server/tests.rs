mod rclpy;

use std::{collections::BTreeMap, sync::atomic::AtomicBool, thread};

use proptest::prelude::*;

use super::*;
use crate::{
    msg::{
        qos::QosProfile,
        rcl_interfaces::{
            DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
            GetParameterTypesResponse, GetParametersRequest, GetParametersResponse,
            ListParametersRequest, ListParametersResponse, Parameter, ParameterEvent,
            SetParametersAtomicallyRequest, SetParametersAtomicallyResponse, SetParametersRequest,
            SetParametersResponse, SetParametersResult, Text, parameter_type,
        },
    },
    ros::{
        loopback::Loopback,
        node_params::NodeParams,
        parameters::Parameters,
        transport::{Arrival, Fault, Subscription, TopicEndpoint},
    },
};

const NOW_NS: i64 = 1_577_836_800_000_000_001;
const NODE: &str = "/laser_profiler";

/// A node with its services and its published events.
struct Node {
    network: Loopback,
    server: ParameterServer,
    store: Arc<ParameterStore>,
    events: Arc<Mutex<Vec<Vec<u8>>>>,
    _subscription: Box<dyn Subscription>,
}

/// Creates a node with this `on_change`.
fn node(values: Parameters, on_change: OnChange) -> Node {
    let network = Loopback::default();
    let events = Arc::new(Mutex::new(Vec::new()));
    let received = Arc::clone(&events);
    let topic = TopicEndpoint {
        name: "/parameter_events".into(),
        kind: ParameterEvent::TYPE,
        qos: QosProfile::reliable(1000),
    };
    let on_event =
        move |arrival: Result<Arrival, Fault>| received.lock().unwrap().push(arrival.unwrap().data);
    let subscription = network.subscribe(&topic, usize::MAX, Box::new(on_event)).unwrap();
    let store = Arc::new(ParameterStore::new(values, on_change).unwrap());
    let names = NodeNames::new("laser_profiler", &[]).unwrap();
    let server = ParameterServer::start(&network, &names, Arc::clone(&store), || NOW_NS).unwrap();
    Node { network, server, store, events, _subscription: subscription }
}

fn default_node() -> Node {
    node(Parameters::default(), Box::new(|_, _| Ok(())))
}

impl Node {
    fn raw(&self, service: &str, request: &[u8]) -> Option<Vec<u8>> {
        self.network.call(&format!("{NODE}/{service}"), request)
    }

    fn call(&self, service: &str, request: &impl Message) -> Vec<u8> {
        call(&self.network, service, request)
    }

    fn set(&self, parameters: Vec<Parameter<'_>>) -> Vec<(bool, String)> {
        let response = self.call("set_parameters", &SetParametersRequest { parameters });
        let response: SetParametersResponse<'_> = cdr::decode(&response).unwrap();
        response.results.into_iter().map(outcome).collect()
    }

    fn set_atomically(&self, parameters: Vec<Parameter<'_>>) -> (bool, String) {
        let request = SetParametersAtomicallyRequest { parameters };
        let response = self.call("set_parameters_atomically", &request);
        let response: SetParametersAtomicallyResponse<'_> = cdr::decode(&response).unwrap();
        outcome(response.result)
    }

    fn get(&self, name: &str) -> Option<Value> {
        let response =
            self.call("get_parameters", &GetParametersRequest { names: vec![name.into()] });
        let response: GetParametersResponse<'_> = cdr::decode(&response).unwrap();
        assert_eq!(response.values.len(), 1);
        convert::value(&response.values[0]).ok()
    }

    fn num_events(&self) -> usize {
        self.events.lock().unwrap().len()
    }
}

fn call(network: &Loopback, service: &str, request: &impl Message) -> Vec<u8> {
    network.call(&format!("{NODE}/{service}"), &encode(request).unwrap()).unwrap()
}

fn outcome(result: SetParametersResult<'_>) -> (bool, String) {
    (result.successful, result.reason.into_owned())
}

fn text(value: &str) -> Value {
    Value::Text(value.to_owned())
}

fn parameter<'a>(name: &'a str, value: &'a Value) -> Parameter<'a> {
    convert::parameter_message(name, value)
}

#[test]
fn parameters_are_listed_described_and_published() {
    let node = default_node();
    let request = ListParametersRequest { prefixes: vec!["roi".into()], depth: 0 };
    let response = node.call("list_parameters", &request);
    let response: ListParametersResponse<'_> = cdr::decode(&response).unwrap();
    let names = ["roi.height", "roi.width", "roi.x_offset", "roi.y_offset"].map(Text::from);
    assert_eq!(response.result.names, names);
    assert_eq!(response.result.prefixes, ["roi".into()]);

    let names = ["motion.step", "extraction.method", "cameras", "slice.profiles", "nothing"];
    let request = DescribeParametersRequest { names: names.map(Text::from).into() };
    let response = node.call("describe_parameters", &request);
    let response: DescribeParametersResponse<'_> = cdr::decode(&response).unwrap();
    let [step, method, cameras, slice, nothing] = response.descriptors.as_slice() else { panic!() };
    let range = &step.floating_point_range[0];
    assert!((range.from_value + 1.0).abs() + (range.to_value - 1.0).abs() + range.step < 1e-12);
    assert!(step.description.ends_with("[m or rad per frame]"), "{}", step.description);
    assert!(method.additional_constraints.starts_with("one of gray_gravity, "));
    assert!(cameras.read_only && !cameras.dynamic_typing && !slice.read_only);
    assert_eq!(cameras.kind, parameter_type::STRING_ARRAY);
    assert_eq!((slice.integer_range[0].from_value, slice.integer_range[0].to_value), (1, 10_000));
    assert_eq!((nothing.kind, &*nothing.name), (parameter_type::NOT_SET, ""));

    let request = GetParameterTypesRequest { names: names.map(Text::from).into() };
    let response = node.call("get_parameter_types", &request);
    let response: GetParameterTypesResponse<'_> = cdr::decode(&response).unwrap();
    assert_eq!(*response.types, [3, 4, 9, 2, 0]);
    assert_eq!(node.get("slice.profiles"), Some(Value::Integer(100)));
    assert_eq!(node.get("cameras"), Some(Value::TextList(Vec::new())));
    assert_eq!(node.get("nothing"), None);

    let events = node.events.lock().unwrap();
    let event: ParameterEvent<'_> = cdr::decode(&events[0]).unwrap();
    assert_eq!((events.len(), event.stamp.to_ns(), &*event.node), (1, NOW_NS, NODE));
    assert_eq!(event.new_parameters.len(), Parameters::default().iter().count());
}

#[test]
fn a_change_applies_when_accepted_and_is_published() {
    let changes = Arc::new(Mutex::new(Vec::new()));
    let log = Arc::clone(&changes);
    let on_change = move |params: &NodeParams, values: &Parameters| {
        let threshold = params.cameras[0].scanner.extraction.segment_threshold;
        if threshold > 200.0 {
            return Err("the camera is too dark".to_owned());
        }
        log.lock().unwrap().push((threshold.to_string(), values.camera_sha256("")));
        Ok(())
    };
    let node = node(Parameters::default(), Box::new(on_change));
    let (name, before) = ("extraction.segment_threshold", Parameters::default().camera_sha256(""));
    assert_eq!(node.set(vec![parameter(name, &Value::Float(50.0))]), [(true, String::new())]);
    assert_eq!(node.get(name), Some(Value::Float(50.0)));
    assert_eq!(node.set(vec![parameter(name, &Value::Float(50.0))]), [(true, String::new())]);
    let refused = node.set(vec![parameter(name, &Value::Float(201.0))]);
    assert_eq!(refused, [(false, "the camera is too dark".to_owned())]);
    assert_eq!(node.get(name), Some(Value::Float(50.0)));
    let changes = changes.lock().unwrap();
    assert_eq!((changes.len(), &*changes[0].0), (1, "50"), "the second one changes nothing");
    assert_ne!(changes[0].1, before);

    let events = node.events.lock().unwrap();
    assert_eq!(events.len(), 3, "at the start and for each that was set");
    let event: ParameterEvent<'_> = cdr::decode(&events[1]).unwrap();
    assert_eq!(event.changed_parameters, [parameter(name, &Value::Float(50.0))]);
    assert!(event.new_parameters.is_empty() && event.deleted_parameters.is_empty());
}

#[test]
fn refusals_give_their_reason() {
    let node = default_node();
    let long = "x".repeat(10_000);
    let integer = Value::Integer(1);
    let cases = [
        ("slice.profiles", Value::Integer(0), "slice.profiles is 0, but must be an integer from 1"),
        ("extraction.segment_threshold", Value::Integer(35), "write 35.0"),
        ("extraction.method", text("best"), "one of gray_gravity"),
        ("extraction.read_noise", Value::Float(f64::NAN), "from 0.0 to 100.0"),
        ("calibration_file", text(&long), "at most 4096 bytes"),
        ("autostart", Value::Bool(false), "read-only"),
        ("cameras", Value::TextList(vec!["left".into()]), "read-only"),
        ("slice.profile", integer.clone(), "slice.profiles"),
        ("left.slice.profiles", integer.clone(), "write slice.profiles"),
        ("qos_overrides./a.publisher.depth", integer.clone(), "when starting the node"),
        (&long, integer.clone(), "10000 bytes"),
        ("slice.profiles", Value::Integer(6000), "scan.max_profiles"),
    ];
    for (name, value, words) in &cases {
        let (is_set, reason) = node.set_atomically(vec![parameter(name, value)]);
        assert!(!is_set && reason.contains(words), "{name}: {reason}");
        assert!(reason.len() < 400, "{name}: {} bytes", reason.len());
    }
    for (kind, words) in [(0, "always has a value"), (8, "array"), (200, "type 200")] {
        let double_array_value = vec![1.0];
        let value = rcl::ParameterValue { kind, double_array_value, ..Default::default() };
        let parameter = Parameter { name: "slice.profiles".into(), value };
        let (is_set, reason) = node.set(vec![parameter]).remove(0);
        assert!(!is_set && reason.contains(words), "{reason}");
    }
    assert_eq!((node.num_events(), node.server.num_malformed()), (1, 0));
    assert!(node.store.read(|values| *values == Parameters::default()));
}

#[test]
fn interdependent_values_can_be_set_atomically() {
    let node = default_node();
    let (slice, scan) = (Value::Integer(6000), Value::Integer(7000));
    let both = || vec![parameter("slice.profiles", &slice), parameter("scan.max_profiles", &scan)];
    let each = node.set(both());
    assert!(!each[0].0 && each[1].0, "{each:?}");
    let node = default_node();
    assert_eq!(node.set_atomically(both()), (true, String::new()));
    let bad = Value::Float(1.0);
    let (is_set, _) = node.set_atomically(vec![
        parameter("slice.profiles", &Value::Integer(5)),
        parameter("full_scale", &bad),
    ]);
    assert!(!is_set);
    assert_eq!(node.get("slice.profiles"), Some(Value::Integer(6000)));
}

#[test]
fn malformed_requests_are_counted_and_get_no_answer() {
    let node = default_node();
    let parameters = vec![parameter("slice.profiles", &Value::Integer(7))];
    let good = encode(&SetParametersRequest { parameters }).unwrap();
    let mut lies = good.clone();
    lies[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
    let names = vec![Text::from("a"); MAX_ITEMS + 1];
    let many = encode(&GetParametersRequest { names }).unwrap();
    let cases = [
        ("set_parameters", &lies[..]),
        ("set_parameters", &good[..good.len() - 9]),
        ("set_parameters_atomically", &lies),
        ("list_parameters", &[]),
        ("describe_parameters", &lies),
        ("get_parameters", &many),
        ("get_parameter_types", &many),
    ];
    for (number, (service, request)) in (1..).zip(cases) {
        assert_eq!(node.raw(service, request), None, "{service}");
        assert_eq!(node.server.num_malformed(), number);
    }
    assert_eq!(node.get("slice.profiles"), Some(Value::Integer(100)));
    assert!(node.raw("set_parameters", &good).is_some());
}

#[test]
fn services_end_with_the_server() {
    let node = default_node();
    assert_eq!(node.network.services().len(), 6);
    drop(node.server);
    assert!(node.network.services().is_empty());
}

#[test]
fn ten_thousand_sets_half_of_them_wrong_lose_nothing() {
    let node = default_node();
    let network = &node.network;
    let get = GetParametersRequest { names: vec!["slice.profiles".into()] };
    let is_over = AtomicBool::new(false);
    let (num_set, num_read) = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut num_read = 0;
            while !is_over.load(Ordering::Relaxed) {
                let response = call(network, "get_parameters", &get);
                let response: GetParametersResponse<'_> = cdr::decode(&response).unwrap();
                assert!((1..=5000).contains(&response.values[0].integer_value));
                num_read += 1;
            }
            num_read
        });
        let set = |number: i64| {
            let value = Value::Integer(if number % 2 == 0 { 1 + number / 2 } else { -number });
            node.set(vec![parameter("slice.profiles", &value)]).remove(0).0
        };
        let num_set = (0..10_000).filter(|number| set(*number)).count();
        is_over.store(true, Ordering::Relaxed);
        (num_set, reader.join().unwrap())
    });
    assert_eq!((num_set, node.num_events()), (5000, 5001));
    assert_eq!(node.get("slice.profiles"), Some(Value::Integer(5000)));
    assert!(num_read > 0);
}

/// The expected rules for a change: names and allowed values.
fn is_allowed(name: &str, value: &Value) -> bool {
    match (name, value) {
        ("slice.profiles", Value::Integer(value)) => (1..=10_000).contains(value),
        ("scan.max_profiles", Value::Integer(value)) => (1..=1_000_000).contains(value),
        ("extraction.read_noise", Value::Float(value)) => (0.0..=100.0).contains(value),
        ("channel", Value::Text(word)) => word == "red" || word == "auto",
        ("recording.enabled", Value::Bool(_)) => true,
        // Read-only: it may be set to the value that it has.
        ("autostart", Value::Bool(value)) => *value,
        _ => false,
    }
}

fn changes() -> impl Strategy<Value = (&'static str, Value)> {
    let names = prop::sample::select(vec![
        "slice.profiles",
        "scan.max_profiles",
        "extraction.read_noise",
        "channel",
        "recording.enabled",
        "autostart",
        "nothing",
    ]);
    let value = prop_oneof![
        3 => (-2..12_000_i64).prop_map(Value::Integer),
        2 => (-20.0..120.0).prop_map(Value::Float),
        2 => prop::sample::select(vec!["red", "auto", "pink"]).prop_map(text),
        1 => any::<bool>().prop_map(Value::Bool),
    ];
    (names, value)
}

proptest! {
    /// For any requests, the store equals a map that applies valid batches and ignores others.
    #[test]
    fn the_store_equals_a_model(
        batches in prop::collection::vec(prop::collection::vec(changes(), 1..4), 1..30),
    ) {
        let store = ParameterStore::new(Parameters::default(), Box::new(|_, _| Ok(()))).unwrap();
        let all = |values: &Parameters| -> BTreeMap<String, Value> {
            values.iter().map(|d| (d.name().to_owned(), d.value().clone())).collect()
        };
        let mut model = all(&Parameters::default());
        for batch in batches {
            let mut changed = model.clone();
            changed.extend(batch.iter().map(|(name, value)| ((*name).to_owned(), value.clone())));
            let profiles = |name: &str| match changed[name] {
                Value::Integer(value) => value,
                _ => 0,
            };
            let is_good = batch.iter().all(|(name, value)| is_allowed(name, value))
                && profiles("slice.profiles") <= profiles("scan.max_profiles");
            if is_good {
                model = changed;
            }
            prop_assert_eq!(store.set_atomically(&batch).is_ok(), is_good);
            prop_assert_eq!(&store.read(all), &model);
        }
    }
}
