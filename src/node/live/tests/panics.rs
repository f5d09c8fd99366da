//! A thread that panics ends the node with its name; recordings are closed.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use tracing::subscriber::with_default;
use tracing_subscriber::{layer::SubscriberExt, registry};

use super::{
    recordings::{bags, open},
    rig::{Rig, Setup},
};
use crate::{
    msg::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
    node::{live::error::LiveError, rosout},
    ros::{
        transport::{
            GraphTopic, OnArrival, OnRequest, Publication, Server, ServiceEndpoint, Subscription,
            TopicEndpoint, Transport, TransportError,
        },
        value::Value,
    },
};

/// The part that panics.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fuse {
    /// Publishing on this topic.
    Publish(&'static str),
    /// Asking for the publishers of images.
    NumMatched,
}

/// A network with a programming error that appears once it is armed.
struct Faulty {
    network: Arc<dyn Transport>,
    fuse: Fuse,
    is_armed: Arc<AtomicBool>,
}

/// A publisher or subscriber that panics once it is armed.
struct Fused<T> {
    inner: T,
    is_armed: Arc<AtomicBool>,
    panics: bool,
}

impl<T> Fused<T> {
    fn burn(&self) {
        assert!(!(self.panics && self.is_armed.load(Ordering::Relaxed)), "on purpose");
    }
}

impl Publication for Fused<Box<dyn Publication>> {
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        self.burn();
        self.inner.publish(data, source_time_ns)
    }

    fn num_matched(&self) -> usize {
        self.inner.num_matched()
    }
}

impl Subscription for Fused<Box<dyn Subscription>> {
    fn num_matched(&self) -> usize {
        self.burn();
        self.inner.num_matched()
    }
}

impl Transport for Faulty {
    fn name(&self) -> &'static str {
        self.network.name()
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        self.network.max_reliable_bytes()
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        let (inner, is_armed) = (self.network.advertise(topic)?, Arc::clone(&self.is_armed));
        let panics = matches!(self.fuse, Fuse::Publish(name) if name == topic.name);
        Ok(Box::new(Fused { inner, is_armed, panics }))
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let inner = self.network.subscribe(topic, limit_bytes, on_arrival)?;
        let is_armed = Arc::clone(&self.is_armed);
        Ok(Box::new(Fused { inner, is_armed, panics: self.fuse == Fuse::NumMatched }))
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        self.network.serve(service, on_request)
    }

    fn topics(&self) -> Vec<GraphTopic> {
        self.network.topics()
    }
}

/// Starts a node that records, lets `act` make a thread panic, and returns the name that the node gives.
fn panicked(fuse: Fuse, act: impl FnOnce(&Rig)) -> String {
    let is_armed = Arc::new(AtomicBool::new(false));
    let armed = Arc::clone(&is_armed);
    let (layer, slot) = rosout::layer();
    let mut setup = Setup::new().with("recording.enabled", Value::Bool(true));
    setup.slot = slot;
    setup.through = Box::new(move |network| Arc::new(Faulty { network, fuse, is_armed }));
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    camera.shoot();
    rig.results("centerline", 1);
    armed.store(true, Ordering::Relaxed);
    with_default(registry().with(layer), || act(&rig));
    let (listener, (ended, place)) = (rig.listener.clone(), rig.ended());
    let Err(LiveError::Panicked(name)) = ended else { panic!("the node ended without an error") };
    for bag in bags(place.path()) {
        assert!(open(&bag).is_indexed() && bag.join("metadata.yaml").exists(), "closed");
    }
    let reports = listener.received("/diagnostics");
    let report: DiagnosticArray<'_> = reports.last().unwrap().decode();
    let status = &report.status[0];
    assert_eq!((status.level, &*status.name), (DiagnosticStatus::ERROR, "laser_profiler: node"));
    assert!(status.message.starts_with(&name), "{name}: {}", status.message);
    name
}

#[test]
fn a_worker_that_panics_ends_the_node() {
    // Its next report asks.
    let name = panicked(Fuse::NumMatched, |_| {});
    assert_eq!(name, "the worker of camera \"\"");
}

#[test]
fn a_publisher_that_panics_ends_the_node() {
    let name = panicked(Fuse::Publish("/laser_profiler/profile"), |rig| {
        let mut camera = rig.camera();
        camera.at_ms = 1000;
        camera.shoot();
    });
    assert_eq!(name, "the publisher of camera \"\"");
}

#[test]
fn a_log_that_panics_ends_the_node() {
    let log = |_: &Rig| tracing::info!(target: "laser_profiler", "a line");
    assert_eq!(panicked(Fuse::Publish("/rosout"), log), "the thread of /rosout");
}

#[test]
fn a_transition_that_panics_ends_the_node() {
    // On this network, a service runs on the thread of its caller.
    let name = panicked(Fuse::Publish("/laser_profiler/transition_event"), |rig| {
        catch_unwind(AssertUnwindSafe(|| rig.change_state("deactivate"))).unwrap_err();
    });
    assert_eq!(name, "the service /laser_profiler/change_state");
}

#[test]
fn a_parameter_that_panics_ends_the_node() {
    let name = panicked(Fuse::Publish("/parameter_events"), |rig| {
        let set = || rig.set("slice.profiles", &Value::Integer(7));
        catch_unwind(AssertUnwindSafe(set)).unwrap_err();
    });
    assert_eq!(name, "the service /laser_profiler/set_parameters");
}
