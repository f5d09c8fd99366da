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
mod watched;
mod fault_report;
pub(crate) mod session;
mod node;
mod services;
mod scan_action;

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
            server::{ChangeError, Lifecycle, LifecycleServer},
        },
        parameter_server::{OnChange, ParameterHandle, ParameterServer, ParameterStore},
        replay::NODE_NAME,
        rosout::{Rosout, RosoutSlot},
        stop::Stop,
        watch::Watch,
    },
    ros::{
        arguments::RosArguments,
        middleware::{JoinRequest, Middleware},
        names::NodeNames,
        node_params::NodeParams,
        parameters::Parameters,
        process::{link::WorkerCommand, remote::RemoteTransport},
        transport::{NodeIdentity, Server, Transport},
    },
};
use error::LiveError;
use fault_report::FaultReport;
use node::NodeState;
use report::Watcher;
use scan_action::{ActionContext, ScanAction};
use session::CameraSummary;
use setup::Context;
use watched::Watched;

/// Period at which the node checks for the end of a camera or of another thread.
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
    /// How to start the middleware process.
    pub(crate) worker: WorkerCommand,
}

/// A node on the network.
pub(crate) struct LiveNode {
    shared: Arc<NodeState>,
    lifecycle: Lifecycle,
    watch: Watch,
    fault_report: FaultReport,
    // Dropped before the transport, so that no request reaches a partly dropped node.
    servers: Servers,
}

struct Servers {
    // Before the services of its goals.
    _actions: Vec<ScanAction>,
    _services: Vec<Box<dyn Server>>,
    parameters: ParameterServer,
    _lifecycle: LifecycleServer,
    _rosout: Rosout,
}

impl LiveNode {
    /// Reads the parameters, joins the network and, if `autostart` is set, starts measuring.
    ///
    /// # Errors
    /// The first invalid name, parameter or file, or the middleware or the system rejects a resource.
    pub(crate) fn start(request: &LiveRequest, rosout: RosoutSlot) -> Result<Self, LiveError> {
        Self::start_through(request, rosout, &|transport| transport)
    }

    /// As [`start`](Self::start), but on the transport that `through` returns for the middleware.
    ///
    /// # Errors
    /// The first invalid name, parameter or file, or the middleware or the system rejects a resource.
    pub(crate) fn start_through(
        request: &LiveRequest,
        rosout: RosoutSlot,
        through: &dyn Fn(Arc<dyn Transport>) -> Arc<dyn Transport>,
    ) -> Result<Self, LiveError> {
        let names = NodeNames::new(NODE_NAME, &request.ros.remaps)?;
        let values = Parameters::load(&names, &request.ros)?;
        let params = NodeParams::new(&values)?;
        let join = JoinRequest {
            middleware: request.middleware,
            node: NodeIdentity {
                name: names.name().to_owned(),
                namespace: names.namespace().to_owned(),
            },
            service_mapping: params.service_mapping,
            is_router: request.is_router,
            max_memory_bytes: params.max_middleware_bytes,
        };
        let transport = RemoteTransport::start(request.worker.clone(), join)?;
        let transport = through(Arc::new(transport));
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
        let watch = Watch::default();
        let rosout = Rosout::start(&**transport, names, rosout, watch.clone())?;
        let watched = Watched { transport: Arc::clone(transport), watch: watch.clone() };
        let transport: &Arc<dyn Transport> = &(Arc::new(watched) as Arc<dyn Transport>);
        let autostart = params.autostart;
        let cameras = values.cameras().to_vec();
        let fault_report = FaultReport::advertise(&**transport, names, &params, clock.clone())?;
        let context = Context::new(Arc::clone(transport), names.clone(), clock.clone());
        let context = context.watched_by(watch.clone());
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
        let action = ActionContext { names, node: &node, clock: &clock, watch: &watch };
        let offer = |camera: &String| ScanAction::offer(&**transport, &action, camera);
        let actions = cameras.iter().map(offer).collect::<Result<_, _>>()?;
        tracing::info!("{} is on {}", names.fully_qualified(), transport.name());
        if autostart && let Err(error) = lifecycle.autostart() {
            shared.cleanup();
            return Err(error.into());
        }
        let servers = Servers {
            _actions: actions,
            _services: services,
            parameters,
            _lifecycle: lifecycle_server,
            _rosout: rosout,
        };
        Ok(Self { shared, lifecycle, watch, fault_report, servers })
    }

    /// Returns the parameters for other parts of this process.
    pub(crate) fn parameters(&self) -> ParameterHandle {
        self.servers.parameters.handle()
    }

    /// Returns a view of the cameras for use while [`run`](Self::run) measures.
    pub(crate) fn watcher(&self) -> Watcher {
        Watcher(Arc::downgrade(&self.shared))
    }

    /// Measures until `stop` is raised, or until a camera or another thread fails. A node that is shut down from outside
    /// measures nothing more, but answers until then, as every managed node does. Writes all results before it returns;
    /// the summary of a camera contains its error.
    ///
    /// # Errors
    /// A thread of the node panicked.
    pub(crate) fn run(mut self, stop: &Stop) -> Result<Vec<CameraSummary>, LiveError> {
        let has_failed = || self.watch.panicked().is_some() || self.shared.has_failed();
        while !stop.wait(WATCH_PERIOD) && !has_failed() {}
        self.shut_down();
        let Some(name) = self.watch.panicked() else { return Ok(self.shared.take_summaries()) };
        self.fault_report.on_panic(name);
        Err(LiveError::Panicked(name.to_owned()))
    }

    /// Shuts down after a running transition, which may wait for a slow disk.
    fn shut_down(&self) {
        loop {
            match self.lifecycle.shutdown() {
                Ok(_) => break,
                Err(ChangeError::Busy(_)) => thread::sleep(WATCH_PERIOD),
                Err(error) => {
                    tracing::error!("{error}");
                    break;
                }
            }
        }
        // A transition that panicked never ends: the recordings are closed in any case.
        self.shared.cleanup();
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
