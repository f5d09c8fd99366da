//! A transport that notices panics of its callbacks, which run on threads of the middleware.

use std::sync::Arc;

use crate::{
    node::watch::Watch,
    ros::transport::{
        GraphTopic, Health, OnArrival, OnLateRequest, OnRequest, Publication, Server,
        ServiceEndpoint, Subscription, TopicEndpoint, Transport, TransportError,
    },
};

/// A middleware whose callbacks are watched.
pub(super) struct Watched {
    pub(super) transport: Arc<dyn Transport>,
    pub(super) watch: Watch,
}

impl Transport for Watched {
    fn name(&self) -> &'static str {
        self.transport.name()
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        self.transport.max_reliable_bytes()
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        self.transport.advertise(topic)
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        mut on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let (watch, name) = (self.watch.clone(), format!("the subscriber of {}", topic.name));
        let watched: OnArrival = Box::new(move |arrival| {
            let _guard = watch.guard(&name);
            on_arrival(arrival);
        });
        self.transport.subscribe(topic, limit_bytes, watched)
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        mut on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        let (watch, name) = (self.watch.clone(), format!("the service {}", service.name));
        let watched: OnRequest = Box::new(move |request| {
            let _guard = watch.guard(&name);
            on_request(request)
        });
        self.transport.serve(service, watched)
    }

    fn serve_late(
        &self,
        service: &ServiceEndpoint,
        mut on_request: OnLateRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        let (watch, name) = (self.watch.clone(), format!("the service {}", service.name));
        let watched: OnLateRequest = Box::new(move |request, responder| {
            let _guard = watch.guard(&name);
            on_request(request, responder);
        });
        self.transport.serve_late(service, watched)
    }

    fn topics(&self) -> Vec<GraphTopic> {
        self.transport.topics()
    }

    fn failure(&self) -> Option<String> {
        self.transport.failure()
    }

    fn health(&self) -> Health {
        self.transport.health()
    }
}
