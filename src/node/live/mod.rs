//! The live node: cameras on the middleware, with the standard interfaces of a ROS node.
//!
//! Every camera has its own worker behind a queue that drops the oldest image. It is the same worker as in a replay,
//! with the middleware and the recorder as sinks. `node` holds the state shared by services, parameters and the
//! lifecycle.

pub(crate) mod error;
pub(crate) mod report;
mod feed;
mod publications;
mod notes;
mod observer;
mod recording;
mod camera;
mod setup;
pub(crate) mod session;
mod node;
mod services;

use std::{
    sync::{Arc, Weak},
    thread,
    time::Duration,
};

use crate::{
    node::{
        clock::RosClock,
        lifecycle::{
            Managed,
            machine::State,
            server::{ChangeError, Lifecycle, LifecycleServer},
        },
        parameter_server::{OnChange, ParameterHandle, ParameterServer, ParameterStore},
        replay::NODE_NAME,
        rosout::{Rosout, RosoutSlot},
        stop::Stop,
    },
    ros::{
        arguments::RosArguments,
        middleware::{JoinOptions, Middleware},
        names::NodeNames,
        node_params::NodeParams,
        parameters::Parameters,
        transport::{NodeIdentity, Server, Transport},
    },
};
use error::LiveError;
use node::NodeState;
use report::Watcher;
use session::CameraSummary;
use setup::Context;

/// Period at which the node checks for a shutdown or the end of a camera.
const WATCH_PERIOD: Duration = Duration::from_millis(100);

/// The node to run.
#[derive(Clone, Debug)]
pub(crate) struct LiveRequest {
    /// Its transport.
    pub(crate) middleware: Middleware,
    /// True if the node is its own Zenoh router.
    pub(crate) is_router: bool,
    /// Names, remaps and parameters.
    pub(crate) ros: RosArguments,
}

/// A node on the network.
pub(crate) struct LiveNode {
    shared: Arc<NodeState>,
    lifecycle: Lifecycle,
    // Dropped before the transport, so that no request reaches a partly dropped node.
    servers: Servers,
}

struct Servers {
    _services: Vec<Box<dyn Server>>,
    parameters: ParameterServer,
    _lifecycle: LifecycleServer,
    _rosout: Rosout,
}

impl LiveNode {
    /// Reads the parameters, joins the network and, if `autostart` is set, starts measuring. `variable` reads the
    /// environment.
    ///
    /// # Errors
    /// The first invalid name, parameter or file, or the middleware or the system rejects a resource.
    pub(crate) fn start(
        request: &LiveRequest,
        rosout: RosoutSlot,
        variable: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, LiveError> {
        Self::start_through(request, rosout, variable, &|transport| transport)
    }

    /// As [`start`](Self::start), but on the transport that `through` returns for the middleware.
    ///
    /// # Errors
    /// The first invalid name, parameter or file, or the middleware or the system rejects a resource.
    pub(crate) fn start_through(
        request: &LiveRequest,
        rosout: RosoutSlot,
        variable: &dyn Fn(&str) -> Option<String>,
        through: &dyn Fn(Arc<dyn Transport>) -> Arc<dyn Transport>,
    ) -> Result<Self, LiveError> {
        let names = NodeNames::new(NODE_NAME, &request.ros.remaps)?;
        let values = Parameters::load(&names, &request.ros)?;
        let service_mapping = NodeParams::new(&values)?.service_mapping;
        let identity =
            NodeIdentity { name: names.name().to_owned(), namespace: names.namespace().to_owned() };
        let options = JoinOptions { service_mapping, is_router: request.is_router };
        let transport = request.middleware.join(&identity, options, variable)?;
        let transport = through(transport);
        Self::on(&transport, &names, values, rosout)
    }

    /// Creates the node on a joined middleware.
    fn on(
        transport: &Arc<dyn Transport>,
        names: &NodeNames,
        values: Parameters,
        rosout: RosoutSlot,
    ) -> Result<Self, LiveError> {
        let params = NodeParams::new(&values)?;
        let clock = RosClock::default();
        let rosout = Rosout::start(&**transport, names, rosout)?;
        let autostart = params.autostart;
        let cameras = values.cameras().to_vec();
        let context = Context::new(Arc::clone(transport), names.clone(), clock.clone());
        context.choose_time(&params)?;
        let shared = Arc::new(NodeState::new(context, values.clone())?);
        let node = Arc::downgrade(&shared);

        let store = Arc::new(ParameterStore::new(values, on_change(node.clone()))?);
        let time = clock.clone();
        let parameters = ParameterServer::start(&**transport, names, store, move || time.now_ns())?;
        let managed: Arc<dyn Managed> = Arc::new(node::Handle(node.clone()));
        let lifecycle_server = LifecycleServer::start(&**transport, names, managed, clock.clone())?;
        let lifecycle = lifecycle_server.lifecycle();
        let services = services::offer(&**transport, names, &node, &cameras)?;
        tracing::info!("{} is on {}", names.fully_qualified(), transport.name());
        if autostart && let Err(error) = lifecycle.autostart() {
            shared.cleanup();
            return Err(error.into());
        }
        let servers = Servers {
            _services: services,
            parameters,
            _lifecycle: lifecycle_server,
            _rosout: rosout,
        };
        Ok(Self { shared, lifecycle, servers })
    }

    /// Returns the parameters for other parts of this process.
    pub(crate) fn parameters(&self) -> ParameterHandle {
        self.servers.parameters.handle()
    }

    /// Returns a view of the cameras for use while [`run`](Self::run) measures.
    pub(crate) fn watcher(&self) -> Watcher {
        Watcher(Arc::downgrade(&self.shared))
    }

    /// Measures until `stop` is raised, the node is shut down from outside, or a camera fails. Writes all results
    /// before it returns; the summary of a camera contains its error.
    pub(crate) fn run(self, stop: &Stop) -> Vec<CameraSummary> {
        while !stop.wait(WATCH_PERIOD) {
            if self.lifecycle.state() == State::Finalized || self.shared.has_failed() {
                break;
            }
        }
        self.shut_down();
        self.shared.take_summaries()
    }

    /// Shuts down after a running transition, which may wait for a slow disk.
    fn shut_down(&self) {
        loop {
            match self.lifecycle.shutdown() {
                Ok(_) => return,
                Err(ChangeError::Busy(_)) => thread::sleep(WATCH_PERIOD),
                Err(error) => return tracing::error!("{error}"),
            }
        }
    }
}

fn on_change(node: Weak<NodeState>) -> OnChange {
    Box::new(move |_, values| match node.upgrade() {
        Some(node) => node.set(values),
        None => Err("the node is shutting down".to_owned()),
    })
}

#[cfg(test)]
mod tests;
