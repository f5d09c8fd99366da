use std::sync::{Arc, Mutex};

use super::{
    Failure, Managed,
    machine::{State, TRANSITIONS, Wanted},
    server::{ChangeError, Lifecycle, LifecycleServer},
};
use crate::{
    msg::{
        cdr,
        lifecycle_msgs::{
            ChangeStateRequest, ChangeStateResponse, GetAvailableStatesResponse,
            GetAvailableTransitionsResponse, GetStateRequest, GetStateResponse, Transition,
            TransitionEvent,
        },
        qos::QosProfile,
        schema::Message,
    },
    node::{clock::RosClock, endpoints},
    ros::{
        loopback::Loopback,
        names::NodeNames,
        transport::{Arrival, Subscription, Transport},
    },
};

/// A node that records its callbacks, and fails once where requested.
#[derive(Default)]
struct Noted {
    calls: Mutex<Vec<&'static str>>,
    failure: Mutex<Option<(&'static str, Failure)>>,
}

impl Noted {
    fn call(&self, name: &'static str) -> Result<(), Failure> {
        self.calls.lock().unwrap().push(name);
        let failure = self.failure.lock().unwrap().take_if(|(at, _)| *at == name);
        failure.map_or(Ok(()), |(_, failure)| Err(failure))
    }

    fn fail(&self, at: &'static str, failure: Failure) {
        *self.failure.lock().unwrap() = Some((at, failure));
    }
}

impl Managed for Noted {
    fn configure(&self) -> Result<(), Failure> {
        self.call("configure")
    }
    fn activate(&self) -> Result<(), Failure> {
        self.call("activate")
    }
    fn deactivate(&self) -> Result<(), Failure> {
        self.call("deactivate")
    }
    fn cleanup(&self) -> Result<(), Failure> {
        self.call("cleanup")
    }
    fn shutdown(&self) -> Result<(), Failure> {
        self.call("shutdown")
    }
}

struct Rig {
    network: Loopback,
    node: Arc<Noted>,
    server: LifecycleServer,
    lifecycle: Lifecycle,
    events: Arc<Mutex<Vec<String>>>,
    _subscription: Box<dyn Subscription>,
}

impl Rig {
    fn new() -> Self {
        let network = Loopback::default();
        let names = NodeNames::new("laser_profiler", &[]).unwrap();
        let events = Arc::new(Mutex::new(Vec::new()));
        let received = Arc::clone(&events);
        let on_arrival = Box::new(move |arrival: Result<Arrival, _>| {
            let bytes = arrival.unwrap().data;
            let event: TransitionEvent<'_> = cdr::decode(&bytes).unwrap();
            assert!(event.timestamp > 0);
            received.lock().unwrap().push(format!(
                "{} {}>{}",
                event.transition.id, event.start_state.label, event.goal_state.label
            ));
        });
        let (name, qos) = ("~/transition_event", QosProfile::reliable(10));
        let topic = endpoints::topic_of::<TransitionEvent<'_>>(&names, name, qos).unwrap();
        let subscription = network.subscribe(&topic, 1000, on_arrival).unwrap();
        let node = Arc::new(Noted::default());
        let managed: Arc<dyn Managed> = Arc::<Noted>::clone(&node);
        let server =
            LifecycleServer::start(&network, &names, managed, RosClock::default()).unwrap();
        let lifecycle = server.lifecycle();
        Self { network, node, server, lifecycle, events, _subscription: subscription }
    }

    fn call<M: Message>(&self, service: &str, request: &M) -> Vec<u8> {
        let mut bytes = Vec::new();
        cdr::encode(request, &mut bytes).unwrap();
        self.network.call(&format!("/laser_profiler/{service}"), &bytes).unwrap()
    }

    fn change(&self, id: u8, label: &str) -> bool {
        let transition = Transition { id, label: label.into() };
        let bytes = self.call("change_state", &ChangeStateRequest { transition });
        cdr::decode::<ChangeStateResponse>(&bytes).unwrap().success
    }

    fn state(&self) -> String {
        let bytes = self.call("get_state", &GetStateRequest::default());
        let state = cdr::decode::<GetStateResponse<'_>>(&bytes).unwrap().current_state;
        assert_eq!(state.id, self.lifecycle.state().id());
        state.label.into_owned()
    }

    fn transitions(&self, service: &str) -> Vec<(u8, String)> {
        let bytes = self.call(service, &GetStateRequest::default());
        let response: GetAvailableTransitionsResponse<'_> = cdr::decode(&bytes).unwrap();
        let transitions = response.available_transitions.into_iter();
        transitions.map(|t| (t.transition.id, t.transition.label.into_owned())).collect()
    }

    fn calls(&self) -> Vec<&'static str> {
        std::mem::take(&mut *self.node.calls.lock().unwrap())
    }

    fn events(&self) -> Vec<String> {
        std::mem::take(&mut *self.events.lock().unwrap())
    }
}

#[test]
fn a_manager_takes_the_node_through_all_states() {
    let rig = Rig::new();
    assert_eq!(rig.state(), "unconfigured");
    // By id, by label, and by a label with a wrong id: the label takes precedence, as in rclcpp.
    for (id, label, state) in [
        (1, "", "inactive"),
        (0, "activate", "active"),
        (1, "deactivate", "inactive"),
        (2, "cleanup", "unconfigured"),
        (5, "", "finalized"),
    ] {
        assert!(rig.change(id, label), "{id} {label}");
        assert_eq!(rig.state(), state);
    }
    assert_eq!(rig.calls(), ["configure", "activate", "deactivate", "cleanup", "shutdown"]);
    assert_eq!(
        rig.events(),
        [
            "1 unconfigured>configuring",
            "10 configuring>inactive",
            "3 inactive>activating",
            "30 activating>active",
            "4 active>deactivating",
            "40 deactivating>inactive",
            "2 inactive>cleaningup",
            "20 cleaningup>unconfigured",
            "5 unconfigured>shuttingdown",
            "50 shuttingdown>finalized",
        ]
    );
    assert!(!rig.change(1, "") && !rig.change(0, "shutdown"), "finalized is final");
    assert_eq!(rig.lifecycle.shutdown(), Ok(State::Finalized));
    assert!(rig.calls().is_empty() && rig.events().is_empty());
}

#[test]
fn an_impossible_transition_changes_nothing_and_the_error_lists_possible_ones() {
    let rig = Rig::new();
    for (id, label) in [(0, ""), (3, ""), (6, ""), (10, ""), (200, ""), (0, "activate"), (1, "x")] {
        assert!(!rig.change(id, label), "{id} {label}");
    }
    assert_eq!(rig.state(), "unconfigured");
    assert!(rig.calls().is_empty() && rig.events().is_empty());
    let error = rig.lifecycle.change(Wanted::Id(3)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "transition activate (3) cannot begin in state unconfigured: allowed: configure, shutdown"
    );
}

#[test]
fn a_refusal_returns_to_the_previous_state() {
    let rig = Rig::new();
    rig.node.fail("configure", Failure("no calibration".into()));
    assert!(!rig.change(1, ""));
    assert_eq!(rig.state(), "unconfigured");
    assert_eq!(rig.events(), ["1 unconfigured>configuring", "11 configuring>unconfigured"]);

    assert_eq!(rig.lifecycle.autostart(), Ok(State::Active));
    rig.node.fail("deactivate", Failure("scan is running".into()));
    let error = rig.lifecycle.change(Wanted::Label("deactivate")).unwrap_err();
    assert_eq!(error.to_string(), "deactivate failed, the node is active: scan is running");
    assert_eq!(rig.lifecycle.shutdown(), Ok(State::Finalized));
}

#[test]
fn a_shutdown_that_loses_data_ends_the_node() {
    let rig = Rig::new();
    rig.node.fail("shutdown", Failure("the bag was not closed".into()));
    let error = rig.lifecycle.shutdown().unwrap_err();
    assert!(matches!(error, ChangeError::Failed { state: State::Finalized, .. }), "{error}");
}

#[test]
fn states_and_transitions_are_published() {
    let rig = Rig::new();
    let bytes = rig.call("get_available_states", &GetStateRequest::default());
    let states = cdr::decode::<GetAvailableStatesResponse<'_>>(&bytes).unwrap().available_states;
    assert_eq!(states.iter().map(|state| state.id).collect::<Vec<_>>(), State::ALL.map(State::id));
    let available = |rig: &Rig| rig.transitions("get_available_transitions");
    assert_eq!(available(&rig), [(1, "configure".to_owned()), (5, "shutdown".to_owned())]);
    rig.lifecycle.change(Wanted::Id(1)).unwrap();
    let ids: Vec<_> = available(&rig).into_iter().map(|(id, _)| id).collect();
    assert_eq!(ids, [2, 3, 6]);
    assert_eq!(rig.transitions("get_transition_graph").len(), TRANSITIONS.len());
}

#[test]
fn a_malformed_request_gets_no_answer_and_an_empty_one_needs_no_bytes() {
    let rig = Rig::new();
    for bytes in [&[][..], &[0, 1, 0, 0], &[0, 1, 0, 0, 1, 0, 0, 0, 0xff, 0xff, 0xff, 0xff]] {
        assert!(rig.network.call("/laser_profiler/change_state", bytes).is_none());
        assert!(rig.network.call("/laser_profiler/get_state", bytes).is_some());
    }
    assert_eq!(rig.state(), "unconfigured");
    let Rig { network, server, .. } = rig;
    assert_eq!(network.services().len(), 5);
    drop(server);
    assert!(network.services().is_empty());
}

/// A node whose callback requests another transition, as if it were stopped during its start.
struct Impatient(Mutex<Option<Lifecycle>>, Mutex<Vec<ChangeError>>);

impl Managed for Impatient {
    fn configure(&self) -> Result<(), Failure> {
        let lifecycle = self.0.lock().unwrap().clone().unwrap();
        assert_eq!(lifecycle.state(), State::Configuring);
        self.1.lock().unwrap().push(lifecycle.shutdown().unwrap_err());
        Ok(())
    }
    fn activate(&self) -> Result<(), Failure> {
        Ok(())
    }
    fn deactivate(&self) -> Result<(), Failure> {
        Ok(())
    }
    fn cleanup(&self) -> Result<(), Failure> {
        Ok(())
    }
    fn shutdown(&self) -> Result<(), Failure> {
        Ok(())
    }
}

#[test]
fn one_change_at_a_time() {
    let network = Loopback::default();
    let names = NodeNames::new("laser_profiler", &[]).unwrap();
    let node = Arc::new(Impatient(Mutex::default(), Mutex::default()));
    let managed: Arc<dyn Managed> = Arc::<Impatient>::clone(&node);
    let server = LifecycleServer::start(&network, &names, managed, RosClock::default()).unwrap();
    *node.0.lock().unwrap() = Some(server.lifecycle());
    assert_eq!(server.lifecycle().autostart(), Ok(State::Active));
    assert_eq!(*node.1.lock().unwrap(), [ChangeError::Busy(State::Configuring)]);
    // Breaks the reference cycle: the node holds a handle on itself.
    *node.0.lock().unwrap() = None;
}

#[test]
fn states_and_transitions_are_those_of_rcl() {
    for (index, transition) in TRANSITIONS.iter().enumerate() {
        assert!(TRANSITIONS[..index].iter().all(|earlier| earlier.id != transition.id));
        assert!(
            transition.start.is_primary() != transition.goal.is_primary() || is_error(transition)
        );
    }
    // Every state except the last has a transition; every transition state has three.
    for state in State::ALL {
        let ways = TRANSITIONS.iter().filter(|transition| transition.start == state).count();
        match state {
            State::Unknown | State::Finalized => assert_eq!(ways, 0),
            state if state.is_primary() => assert!(ways >= 2),
            _ => assert_eq!(ways, 3, "{}", state.label()),
        }
    }
}

fn is_error(transition: &super::machine::Transition) -> bool {
    transition.goal == State::ErrorProcessing
}
