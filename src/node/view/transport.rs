//! A middleware wrapper that also serves the node's publications, received images and services to viewers.
//!
//! All ROS traffic of a node passes through [`Transport`], so viewers receive the same bytes, and the node is not
//! involved.

use std::sync::{Arc, Mutex, PoisonError};

use crate::{
    bag::Topic,
    foxglove::{Channel, Server, ServiceDescription},
    msg::{foxglove_msgs::ImageAnnotations, rcl_interfaces::ParameterEvent, schema::Message},
    ros::transport::{
        GraphTopic, Health, OnArrival, OnLateRequest, OnRequest, Publication,
        Server as ServiceServer, ServiceEndpoint, Subscription, TopicEndpoint, Transport,
        TransportError,
    },
};

use super::{camera::CameraView, live::LiveCamera, serve};

/// Types of the services offered to viewers. Parameters have a panel of their own, and the lifecycle is controlled with
/// `ros2`.
const SERVED: [&str; 2] = ["std_srvs/srv/Trigger", "std_srvs/srv/SetBool"];

/// A middleware and its viewers.
pub(super) struct Viewed {
    pub(super) inner: Arc<dyn Transport>,
    pub(super) server: Arc<Server>,
    pub(super) cameras: Arc<[LiveCamera]>,
}

impl Viewed {
    /// Serves a topic, or logs the reason that viewers cannot receive it. An error does not prevent ROS publication.
    fn channel(&self, topic: &TopicEndpoint) -> Option<Arc<Channel>> {
        // Those of an action are for its client, and hidden in ROS, too.
        if topic.name.contains("/_action/") {
            return None;
        }
        let served = serve(&self.server, topic);
        served.inspect_err(|error| tracing::warn!("{} is not viewed: {error}", topic.name)).ok()
    }
}

impl Transport for Viewed {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        self.inner.max_reliable_bytes()
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        let inner = self.inner.advertise(topic)?;
        let camera = self.cameras.iter().find(|camera| camera.annotations == topic.name);
        Ok(Box::new(ViewedPublication {
            inner,
            channel: self.channel(topic),
            camera: camera
                .filter(|_| topic.kind.name == ImageAnnotations::TYPE.name)
                .map(|camera| Arc::clone(&camera.view)),
            parameter_viewers: (topic.kind.name == ParameterEvent::TYPE.name)
                .then(|| Arc::clone(&self.server)),
        }))
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let Some(camera) = self.cameras.iter().find(|camera| camera.takes(&topic.name)) else {
            return self.inner.subscribe(topic, limit_bytes, on_arrival);
        };
        let recorded = Topic::new(topic.name.as_str(), topic.kind, topic.qos);
        if let Err(error) = camera.view.serve_full(&self.server, &recorded) {
            tracing::warn!("{} is not viewed: {error}", topic.name);
        }
        let on_arrival = camera.tap(topic, on_arrival);
        self.inner.subscribe(topic, limit_bytes, on_arrival)
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn ServiceServer>, TransportError> {
        if !SERVED.contains(&service.kind.name) {
            return self.inner.serve(service, on_request);
        }
        let shared = Arc::new(Mutex::new(on_request));
        let answer = |shared: Arc<Mutex<OnRequest>>| {
            move |request: &[u8]| {
                let mut on_request = shared.lock().unwrap_or_else(PoisonError::into_inner);
                (*on_request)(request)
            }
        };
        let inner = self.inner.serve(service, Box::new(answer(Arc::clone(&shared))))?;
        let (request, response) = service.kind.text.split_once("---\n").unwrap_or_default();
        let (name, type_name) = (service.name.as_str(), service.kind.name);
        let description = ServiceDescription { name, type_name, request, response };
        if let Err(error) = self.server.serve(description, answer(shared)) {
            tracing::warn!("{name} is not viewed: {error}");
        }
        let (name, server) = (service.name.clone(), Arc::clone(&self.server));
        Ok(Box::new(ViewedService { _inner: inner, name, server }))
    }

    fn serve_late(
        &self,
        service: &ServiceEndpoint,
        on_request: OnLateRequest,
    ) -> Result<Box<dyn ServiceServer>, TransportError> {
        self.inner.serve_late(service, on_request)
    }

    fn topics(&self) -> Vec<GraphTopic> {
        self.inner.topics()
    }

    fn failure(&self) -> Option<String> {
        self.inner.failure()
    }

    fn health(&self) -> Health {
        self.inner.health()
    }
}

/// A publisher whose messages also reach viewers.
struct ViewedPublication {
    inner: Box<dyn Publication>,
    channel: Option<Arc<Channel>>,
    /// Camera of the centrelines, if the topic carries them.
    camera: Option<Arc<CameraView>>,
    /// Server that publishes changed parameters, if the topic carries parameter events.
    parameter_viewers: Option<Arc<Server>>,
}

impl Publication for ViewedPublication {
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        let published = self.inner.publish(data, source_time_ns);
        if let Some(camera) = &self.camera {
            camera.annotate(data, source_time_ns);
        }
        if let Some(channel) = &self.channel {
            channel.send(data, source_time_ns);
        }
        if let Some(server) = &self.parameter_viewers {
            server.publish_parameters();
        }
        published
    }

    fn num_matched(&self) -> usize {
        self.inner.num_matched()
    }
}

/// A service that viewers can call. Dropping it removes it from viewers.
struct ViewedService {
    _inner: Box<dyn ServiceServer>,
    name: String,
    server: Arc<Server>,
}

impl ServiceServer for ViewedService {}

impl Drop for ViewedService {
    fn drop(&mut self) {
        self.server.withdraw(&self.name);
    }
}
