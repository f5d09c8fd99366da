//! The lifecycle on the network: five services and `~/transition_event`, and a handle for this process.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use thiserror::Error;

use super::{
    Failure, Managed,
    machine::{Ending, Impossible, Machine, State, TRANSITIONS, Transition, Wanted},
};
use crate::{
    msg::{
        cdr,
        lifecycle_msgs::{self as msgs, ChangeStateRequest, ChangeStateResponse, TransitionEvent},
        qos::QosProfile,
    },
    node::{
        clock::RosClock,
        endpoints::{self, answer},
    },
    ros::{
        names::NodeNames,
        transport::{OnRequest, Publication, Server, Transport, TransportError},
    },
};

/// The reason that a transition failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(crate) enum ChangeError {
    /// It cannot begin in this state.
    #[error(transparent)]
    Impossible(#[from] Impossible),
    /// Another one is running.
    #[error("another transition is running ({}): try again when it has ended", .0.label())]
    Busy(State),
    /// The callback failed.
    #[error("{label} failed, the node is {}: {failure}", .state.label())]
    Failed {
        /// The transition.
        label: &'static str,
        /// The current state.
        state: State,
        /// The reason.
        failure: Failure,
    },
}

/// Changes and publishes the state of the node. Clones share it.
#[derive(Clone)]
pub(crate) struct Lifecycle(Arc<LifecycleState>);

struct LifecycleState {
    machine: Mutex<Machine>,
    managed: Arc<dyn Managed>,
    clock: RosClock,
    /// Locked while a transition runs, so that transitions run one at a time and their events are in order.
    events: Mutex<Box<dyn Publication>>,
}

impl Lifecycle {
    /// The current state.
    pub(crate) fn state(&self) -> State {
        lock(&self.0.machine).state()
    }

    /// Changes the state and returns when the transition is complete.
    ///
    /// # Errors
    /// The transition cannot begin, or its callback failed.
    pub(crate) fn change(&self, wanted: Wanted<'_>) -> Result<State, ChangeError> {
        let mut events = match self.0.events.try_lock() {
            Ok(events) => events,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return Err(ChangeError::Busy(self.state())),
        };
        let started = lock(&self.0.machine).begin(wanted)?;
        self.publish(&mut **events, started);
        let done = self.call(started.goal);
        self.end(&mut **events, &done);
        let state = self.state();
        match done {
            Ok(()) => Ok(state),
            Err(failure) => Err(ChangeError::Failed { label: started.label, state, failure }),
        }
    }

    /// Configures and activates the node, for systems without a lifecycle manager.
    ///
    /// # Errors
    /// A callback failed; the state shows which one.
    pub(crate) fn autostart(&self) -> Result<State, ChangeError> {
        self.change(Wanted::Label("configure"))?;
        self.change(Wanted::Label("activate"))
    }

    /// Shuts down; does nothing if the node is already finalized.
    ///
    /// # Errors
    /// Data was lost, or another transition is running.
    pub(crate) fn shutdown(&self) -> Result<State, ChangeError> {
        match self.state() {
            State::Finalized => Ok(State::Finalized),
            _ => self.change(Wanted::Label("shutdown")),
        }
    }

    fn call(&self, state: State) -> Result<(), Failure> {
        let managed = &self.0.managed;
        match state {
            State::Configuring => managed.configure(),
            State::Activating => managed.activate(),
            State::Deactivating => managed.deactivate(),
            State::CleaningUp => managed.cleanup(),
            // `ShuttingDown`, the only other goal of a transition that can be requested.
            _ => managed.shutdown(),
        }
    }

    fn end(&self, events: &mut dyn Publication, done: &Result<(), Failure>) {
        let ending = if done.is_ok() { Ending::Success } else { Ending::Failure };
        let ended = lock(&self.0.machine).end(ending);
        if let Some(transition) = ended {
            self.publish(events, transition);
        }
    }

    fn publish(&self, events: &mut dyn Publication, transition: Transition) {
        let now_ns = self.0.clock.now_ns();
        let described = described(transition);
        let event = TransitionEvent {
            timestamp: now_ns.try_into().unwrap_or(0),
            transition: described.transition,
            start_state: described.start_state,
            goal_state: described.goal_state,
        };
        if let Err(error) = endpoints::send(events, &event, now_ns) {
            tracing::warn!("transition_event: {error}");
        }
    }

    fn answer_change(&self, request: &[u8]) -> Option<Vec<u8>> {
        let request = match cdr::decode::<ChangeStateRequest<'_>>(request) {
            Ok(request) => request.transition,
            Err(error) => {
                tracing::warn!("change_state: {error}");
                return None;
            }
        };
        let wanted = if request.label.is_empty() {
            Wanted::Id(request.id)
        } else {
            Wanted::Label(&request.label)
        };
        let changed = self.change(wanted);
        if let Err(error) = &changed {
            tracing::error!("change_state: {error}");
        }
        answer(&ChangeStateResponse { success: changed.is_ok() })
    }
}

fn lock(machine: &Mutex<Machine>) -> MutexGuard<'_, Machine> {
    machine.lock().unwrap_or_else(PoisonError::into_inner)
}

fn described_state(state: State) -> msgs::State<'static> {
    msgs::State { id: state.id(), label: state.label().into() }
}

fn described(transition: Transition) -> msgs::TransitionDescription<'static> {
    msgs::TransitionDescription {
        transition: msgs::Transition { id: transition.id, label: transition.label.into() },
        start_state: described_state(transition.start),
        goal_state: described_state(transition.goal),
    }
}

/// The lifecycle's services. Dropping it removes them from the graph; [`Lifecycle`] still works.
pub(crate) struct LifecycleServer {
    // Dropped before the handle, so that no service is the last owner of the publisher.
    _servers: Vec<Box<dyn Server>>,
    lifecycle: Lifecycle,
}

impl LifecycleServer {
    /// Creates the services and the topic of an unconfigured node.
    ///
    /// # Errors
    /// The middleware rejects one of them.
    pub(crate) fn start(
        transport: &dyn Transport,
        names: &NodeNames,
        managed: Arc<dyn Managed>,
        clock: RosClock,
    ) -> Result<Self, TransportError> {
        let qos = QosProfile::reliable(10);
        let events = endpoints::advertise::<TransitionEvent<'_>>(
            transport,
            names,
            "~/transition_event",
            qos,
        )?;
        let (machine, events) = (Mutex::default(), Mutex::new(events));
        let lifecycle = Lifecycle(Arc::new(LifecycleState { machine, managed, clock, events }));
        let services: [(_, _, OnRequest); 5] = [
            ("~/change_state", &msgs::CHANGE_STATE, {
                let lifecycle = lifecycle.clone();
                Box::new(move |request| lifecycle.answer_change(request))
            }),
            ("~/get_state", &msgs::GET_STATE, {
                let lifecycle = lifecycle.clone();
                // These requests are empty: their bytes carry no information.
                Box::new(move |_| {
                    let current_state = described_state(lifecycle.state());
                    answer(&msgs::GetStateResponse { current_state })
                })
            }),
            (
                "~/get_available_states",
                &msgs::GET_AVAILABLE_STATES,
                Box::new(|_| {
                    let available_states = State::ALL.map(described_state).into();
                    answer(&msgs::GetAvailableStatesResponse { available_states })
                }),
            ),
            ("~/get_available_transitions", &msgs::GET_AVAILABLE_TRANSITIONS, {
                let lifecycle = lifecycle.clone();
                Box::new(move |_| {
                    let available: Vec<_> = lock(&lifecycle.0.machine).available().collect();
                    answer_transitions(available)
                })
            }),
            (
                "~/get_transition_graph",
                &msgs::GET_AVAILABLE_TRANSITIONS,
                Box::new(|_| answer_transitions(TRANSITIONS.to_vec())),
            ),
        ];
        let offer =
            |(name, kind, on_request)| endpoints::serve(transport, names, name, kind, on_request);
        let servers = services.into_iter().map(offer).collect::<Result<_, _>>()?;
        Ok(Self { _servers: servers, lifecycle })
    }

    /// Returns a handle for this process.
    pub(crate) fn lifecycle(&self) -> Lifecycle {
        self.lifecycle.clone()
    }
}

fn answer_transitions(transitions: Vec<Transition>) -> Option<Vec<u8>> {
    let available_transitions = transitions.into_iter().map(described).collect();
    answer(&msgs::GetAvailableTransitionsResponse { available_transitions })
}
