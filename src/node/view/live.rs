//! The view of a live node.

use std::{
    net::SocketAddr,
    sync::{
        Arc, Weak,
        mpsc::{Receiver, sync_channel},
    },
    thread,
    time::Duration,
};

use thiserror::Error;

use crate::{
    foxglove::{ConnectionGraph, Server, Settings, ViewError},
    msg::{schema::Message, sensor_msgs::CompressedImage},
    node::{
        input, live::LiveRequest, parameter_server::ParameterHandle, replay::NODE_NAME,
        topics::of_camera,
    },
    ros::{
        camera_params::CameraParams,
        names::{NameError, NodeNames},
        node_params::{ImageTransport, NodeParams},
        parameters::{ParameterError, Parameters},
        transport::{OnArrival, TopicEndpoint, Transport},
    },
};

use super::{
    Images, ViewRequest,
    camera::{CameraImage, CameraView, PREVIEW_GAP},
    desk::NodeDesk,
    transport::Viewed,
};

/// Period of updates of the connection graph.
const GRAPH_PERIOD: Duration = Duration::from_secs(1);
/// Images queued for display. An image that arrives while the queue is full is not shown.
const IMAGES_WAITING: usize = 1;

/// Error of starting the view of a live node.
#[derive(Debug, Error)]
pub(crate) enum LiveViewError {
    /// A name or remap rule is invalid.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter or parameter file is invalid.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The server cannot start.
    #[error(transparent)]
    View(#[from] ViewError),
}

impl LiveViewError {
    /// True if the request is wrong.
    pub(crate) const fn is_usage(&self) -> bool {
        match self {
            Self::Name(_) | Self::Parameter(_) => true,
            Self::View(error) => error.is_usage(),
        }
    }
}

/// A server that shows a live node until it is dropped.
pub(crate) struct LiveView {
    server: Arc<Server>,
    desk: Arc<NodeDesk>,
    cameras: Arc<[LiveCamera]>,
}

impl LiveView {
    /// Starts a server for the node of that request.
    ///
    /// # Errors
    /// A parameter or name is invalid, or the server cannot start.
    pub(crate) fn start(request: &LiveRequest, view: &ViewRequest) -> Result<Self, LiveViewError> {
        let names = NodeNames::new(NODE_NAME, &request.ros.remaps)?;
        let values = Parameters::load(&names, &request.ros)?;
        Self::of(&names, &values, view)
    }

    /// Starts a server for a node with these parameter values.
    ///
    /// # Errors
    /// The values contradict one another, a name is invalid, or the server cannot start.
    pub(crate) fn of(
        names: &NodeNames,
        values: &Parameters,
        view: &ViewRequest,
    ) -> Result<Self, LiveViewError> {
        let params = NodeParams::new(values)?;
        let desk = Arc::new(NodeDesk::default());
        let settings = Settings { name: names.fully_qualified(), time_range_ns: None };
        let handler = Arc::clone(&desk);
        let server = Arc::new(Server::start(&view.entrance, &settings, handler)?);
        let camera = |camera: &CameraParams| LiveCamera::new(&server, names, camera, view.images);
        let cameras = params.cameras.iter().map(camera).collect::<Result<_, LiveViewError>>()?;
        Ok(Self { server, desk, cameras })
    }

    /// Returns a middleware for the node that also serves its traffic to viewers.
    pub(crate) fn through(&self, inner: Arc<dyn Transport>) -> Arc<dyn Transport> {
        let (watched, server) = (Arc::downgrade(&inner), Arc::downgrade(&self.server));
        let thread = thread::Builder::new().name("view graph".to_owned());
        if let Err(error) = thread.spawn(move || publish_graph(&watched, &server)) {
            tracing::warn!("viewers receive no connection graph: {error}");
        }
        let (server, cameras) = (Arc::clone(&self.server), Arc::clone(&self.cameras));
        Arc::new(Viewed { inner, server, cameras })
    }

    /// Lets viewers read and set the node's parameters.
    pub(crate) fn set_parameters_of(&self, parameters: ParameterHandle) {
        self.desk.set_parameters_of(Arc::new(parameters));
    }

    /// Address of the server.
    pub(crate) fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Number of messages sent to viewers.
    pub(crate) fn num_sent(&self) -> u64 {
        self.server.num_sent()
    }
}

/// The viewer channels of a live camera.
pub(super) struct LiveCamera {
    /// Topics of the images, raw and compressed.
    images: [String; 2],
    /// Topic of the centrelines as annotations.
    pub(super) annotations: String,
    pub(super) view: Arc<CameraView>,
}

impl LiveCamera {
    fn new(
        server: &Server,
        names: &NodeNames,
        camera: &CameraParams,
        images: Images,
    ) -> Result<Self, LiveViewError> {
        let raw = input::image_topic_of(&camera.name, names)?;
        let compressed = format!("{raw}/compressed");
        let annotations = names.resolve(&of_camera(&camera.name, "~/annotations"))?;
        let limit = camera.max_frame_bytes;
        let view = Arc::new(CameraView::open(server, names, &camera.name, limit, images)?);
        Ok(Self { images: [raw, compressed], annotations, view })
    }

    /// True if the camera's images arrive on that topic.
    pub(super) fn takes(&self, topic: &str) -> bool {
        self.images.iter().any(|name| name == topic)
    }

    /// Wraps a subscription callback so that viewers see the images. A separate thread prepares them, so that the
    /// camera never waits.
    pub(super) fn tap(&self, topic: &TopicEndpoint, mut on_arrival: OnArrival) -> OnArrival {
        let is_packed = topic.kind.name == CompressedImage::TYPE.name;
        let transport = if is_packed { ImageTransport::Compressed } else { ImageTransport::Raw };
        let (sender, waiting) = sync_channel(IMAGES_WAITING);
        let view = Arc::clone(&self.view);
        let thread = thread::Builder::new().name("view images".to_owned());
        if let Err(error) = thread.spawn(move || show_all(&waiting, transport, &view)) {
            tracing::warn!("{} is not viewed: {error}", topic.name);
            return on_arrival;
        }
        let view = Arc::clone(&self.view);
        Box::new(move |arrival| {
            if let Ok(arrival) = &arrival {
                let time_ns = arrival.receive_time_ns;
                let image = CameraImage { data: &arrival.data, transport, time_ns };
                if view.choose(&image, PREVIEW_GAP) {
                    // If the queue is full, this image is not shown.
                    _ = sender.try_send((arrival.data.clone(), time_ns));
                }
            }
            on_arrival(arrival);
        })
    }
}

fn show_all(waiting: &Receiver<(Vec<u8>, i64)>, transport: ImageTransport, view: &CameraView) {
    for (data, time_ns) in waiting {
        view.show(&CameraImage { data: &data, transport, time_ns });
    }
}

/// Publishes the connection graph while viewers subscribe to it, until the middleware or the server is dropped.
fn publish_graph(transport: &Weak<dyn Transport>, server: &Weak<Server>) {
    loop {
        thread::sleep(GRAPH_PERIOD);
        let (Some(transport), Some(server)) = (transport.upgrade(), server.upgrade()) else {
            return;
        };
        if server.is_graph_wanted() {
            server.publish_graph(graph(&*transport));
        }
    }
}

fn graph(transport: &dyn Transport) -> ConnectionGraph {
    let mut graph = ConnectionGraph::default();
    // A middleware reports the number of peers, not their identity.
    let ids = |kind: &str, num: usize| (1..=num).map(|id| format!("{kind} {id}")).collect();
    for topic in transport.topics() {
        let publishers = ids("publisher", topic.num_publishers);
        let subscribers = ids("subscriber", topic.num_subscribers);
        graph.add(topic.name, publishers, subscribers);
    }
    graph
}
