//! The six parameter services and `/parameter_events`, independent of the middleware.

mod convert;
mod events;
mod list;
mod store;

use std::{
    borrow::Cow,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use serde::Deserialize;
use thiserror::Error;

use crate::{
    msg::{
        cdr::{self, CdrError},
        rcl_interfaces as rcl,
        schema::{Message, ServiceType},
    },
    ros::{
        names::{NameError, NodeNames},
        parameters::{Declared, Parameters},
        transport::{Server, ServiceEndpoint, Transport, TransportError},
        value::Value,
    },
};

use events::Events;
pub(crate) use store::{OnChange, ParameterStore};

/// Maximum number of names or parameters in a request: several times the number of parameters.
const MAX_ITEMS: usize = 2048;

/// Answers a request with a response, both as CDR bytes.
type Answer = fn(&ServerState, &[u8]) -> Result<Vec<u8>, BadRequest>;

const SERVICES: [(&str, &ServiceType, Answer); 6] = [
    ("~/describe_parameters", &rcl::DESCRIBE_PARAMETERS, ServerState::describe),
    ("~/get_parameters", &rcl::GET_PARAMETERS, ServerState::get),
    ("~/get_parameter_types", &rcl::GET_PARAMETER_TYPES, ServerState::get_types),
    ("~/list_parameters", &rcl::LIST_PARAMETERS, ServerState::list),
    ("~/set_parameters", &rcl::SET_PARAMETERS, ServerState::set),
    ("~/set_parameters_atomically", &rcl::SET_PARAMETERS_ATOMICALLY, ServerState::set_atomically),
];

/// The reason that a request gets no response.
#[derive(Debug, Error)]
enum BadRequest {
    #[error(transparent)]
    Cdr(#[from] CdrError),
    #[error("{0} names are more than the {MAX_ITEMS} that a request may have")]
    TooMany(usize),
}

/// Serves the parameters of a node until it is dropped.
pub(crate) struct ParameterServer {
    _servers: Vec<Box<dyn Server>>,
    shared: Arc<ServerState>,
}

impl ParameterServer {
    /// Creates the services of the node and publishes its parameters on `/parameter_events`. `now_ns` returns the
    /// node's time, nanoseconds since the epoch.
    ///
    /// # Errors
    /// The middleware rejects a service or the topic, or a remap rule gives one a name that ROS does not allow.
    pub(crate) fn start(
        transport: &dyn Transport,
        names: &NodeNames,
        store: Arc<ParameterStore>,
        now_ns: impl Fn() -> i64 + Send + Sync + 'static,
    ) -> Result<Self, TransportError> {
        let topic = resolve(names, events::TOPIC)?;
        let (node, now_ns): (_, events::Now) = (names.fully_qualified(), Box::new(now_ns));
        let mut events =
            store.read(|values| Events::new(transport, topic, node, now_ns, values))?;
        store.read(|values| events.publish_all(values));
        let (events, num_malformed) = (Mutex::new(events), AtomicU64::new(0));
        let shared = Arc::new(ServerState { store, events, num_malformed });
        let mut servers = Vec::new();
        for (name, kind, answer) in SERVICES {
            let service = ServiceEndpoint { name: resolve(names, name)?, kind };
            let shared = Arc::clone(&shared);
            let on_request = move |request: &[u8]| shared.answer(answer, request);
            servers.push(transport.serve(&service, Box::new(on_request))?);
        }
        Ok(Self { _servers: servers, shared })
    }

    /// Returns a handle to the parameters for other parts of this process.
    pub(crate) fn handle(&self) -> ParameterHandle {
        ParameterHandle(Arc::clone(&self.shared))
    }

    /// Returns the number of malformed requests, which get no response.
    #[cfg(test)]
    pub(crate) fn num_malformed(&self) -> u64 {
        self.shared.num_malformed.load(Ordering::Relaxed)
    }
}

/// A handle to the served parameters for other parts of this process.
#[derive(Clone)]
pub(crate) struct ParameterHandle(Arc<ServerState>);

impl ParameterHandle {
    /// Calls `look` with the effective values.
    pub(crate) fn read<T>(&self, look: impl FnOnce(&Parameters) -> T) -> T {
        self.0.store.read(look)
    }

    /// Sets one parameter, as the service does, and publishes the change.
    ///
    /// # Errors
    /// The reason for refusal, as text.
    pub(crate) fn set(&self, name: &str, value: Value) -> Result<(), String> {
        self.0.set_all(&[(name, value)])
    }
}

fn resolve(names: &NodeNames, name: &str) -> Result<String, TransportError> {
    let refuse = |error: NameError| TransportError::Endpoint {
        name: name.to_owned(),
        reason: error.to_string(),
    };
    names.resolve(name).map_err(refuse)
}

struct ServerState {
    store: Arc<ParameterStore>,
    /// Locked from a change to its event, so that events have the order of the changes.
    events: Mutex<Events>,
    num_malformed: AtomicU64,
}

impl ServerState {
    fn answer(&self, answer: Answer, request: &[u8]) -> Option<Vec<u8>> {
        match answer(self, request) {
            Ok(response) => Some(response),
            Err(error) => {
                let num = self.num_malformed.fetch_add(1, Ordering::Relaxed) + 1;
                // Logged at powers of two only: a faulty client may send a thousand per second.
                if num.is_power_of_two() {
                    tracing::warn!("{num} malformed parameter requests; the last: {error}");
                }
                None
            }
        }
    }

    fn describe(&self, request: &[u8]) -> Result<Vec<u8>, BadRequest> {
        let request: rcl::DescribeParametersRequest<'_> = decode(request)?;
        let names = bounded(request.names)?;
        self.store.read(|values| {
            let descriptor = |rcl::Text(name): &rcl::Text<'_>| match values.get(name) {
                Some(declared) => convert::descriptor(declared),
                None => rcl::ParameterDescriptor::default(),
            };
            let descriptors = names.iter().map(descriptor).collect();
            encode(&rcl::DescribeParametersResponse { descriptors })
        })
    }

    fn get(&self, request: &[u8]) -> Result<Vec<u8>, BadRequest> {
        let request: rcl::GetParametersRequest<'_> = decode(request)?;
        let names = bounded(request.names)?;
        self.store.read(|all| {
            let value = |rcl::Text(name): &rcl::Text<'_>| {
                all.get(name).map(Declared::value).map(convert::value_message).unwrap_or_default()
            };
            encode(&rcl::GetParametersResponse { values: names.iter().map(value).collect() })
        })
    }

    fn get_types(&self, request: &[u8]) -> Result<Vec<u8>, BadRequest> {
        let request: rcl::GetParameterTypesRequest<'_> = decode(request)?;
        let names = bounded(request.names)?;
        self.store.read(|values| {
            let kind = |rcl::Text(name): &rcl::Text<'_>| match values.get(name) {
                Some(declared) => convert::type_of(declared.value()),
                None => rcl::parameter_type::NOT_SET,
            };
            encode(&rcl::GetParameterTypesResponse { types: names.iter().map(kind).collect() })
        })
    }

    fn list(&self, request: &[u8]) -> Result<Vec<u8>, BadRequest> {
        let request: rcl::ListParametersRequest<'_> = decode(request)?;
        let prefixes = bounded(request.prefixes)?;
        self.store.read(|values| {
            let mut names: Vec<_> = values.iter().map(Declared::name).collect();
            names.sort_unstable();
            let result = list::list(names.into_iter(), &prefixes, request.depth);
            encode(&rcl::ListParametersResponse { result })
        })
    }

    fn set(&self, request: &[u8]) -> Result<Vec<u8>, BadRequest> {
        let request: rcl::SetParametersRequest<'_> = decode(request)?;
        let parameters = bounded(request.parameters)?;
        let results = parameters.iter().map(|one| self.change(std::slice::from_ref(one))).collect();
        encode(&rcl::SetParametersResponse { results })
    }

    fn set_atomically(&self, request: &[u8]) -> Result<Vec<u8>, BadRequest> {
        let request: rcl::SetParametersAtomicallyRequest<'_> = decode(request)?;
        let result = self.change(&bounded(request.parameters)?);
        encode(&rcl::SetParametersAtomicallyResponse { result })
    }

    /// Sets all or none, and publishes the changes.
    fn change(&self, parameters: &[rcl::Parameter<'_>]) -> rcl::SetParametersResult<'static> {
        let convert = |parameter: &'_ rcl::Parameter<'_>| convert::value(&parameter.value);
        let values: Result<Vec<Value>, String> = parameters.iter().map(convert).collect();
        let set = values.and_then(|values| {
            let names = parameters.iter().map(|parameter| &*parameter.name);
            self.set_all(&names.zip(values).collect::<Vec<_>>())
        });
        let successful = set.is_ok();
        let reason = Cow::Owned(set.err().unwrap_or_default());
        rcl::SetParametersResult { successful, reason }
    }

    fn set_all(&self, changes: &[(&str, Value)]) -> Result<(), String> {
        let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        self.store.set_atomically(changes)?;
        // The values in force: a peer may have sent them with another type.
        let in_force = |values: &Parameters| -> Vec<_> {
            let of = |name| values.get(name).map(|declared| (name, declared.value().clone()));
            changes.iter().filter_map(|&(name, _)| of(name)).collect()
        };
        events.publish_changed(&self.store.read(in_force));
        Ok(())
    }
}

fn decode<'de, T: Message + Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, BadRequest> {
    Ok(cdr::decode(bytes)?)
}

fn encode<T: Message>(message: &T) -> Result<Vec<u8>, BadRequest> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes)?;
    Ok(bytes)
}

fn bounded<T>(items: Vec<T>) -> Result<Vec<T>, BadRequest> {
    if items.len() > MAX_ITEMS { Err(BadRequest::TooMany(items.len())) } else { Ok(items) }
}

#[cfg(test)]
mod tests;
