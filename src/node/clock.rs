//! Time of the node: the system clock, or the last message on `/clock` if `use_sim_time` is set.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering},
    },
    time::SystemTime,
};

use crate::{
    msg::{cdr, qos::QosProfile, rosgraph_msgs::Clock},
    ros::{
        names::NodeNames,
        transport::{Arrival, Fault, Subscription, Transport, TransportError},
    },
};

use super::endpoints;

/// A `Clock` message has 12 bytes; some publishers add padding.
const LIMIT_BYTES: usize = 64;
const UNKNOWN_NS: i64 = i64::MIN;

/// Source of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TimeSource {
    /// The system clock of this machine.
    System,
    /// The topic `/clock`, selected by `use_sim_time`.
    Sim,
}

/// The node's clock. Clones share it.
#[derive(Clone, Default)]
pub(crate) struct RosClock(Arc<ClockState>);

#[derive(Default)]
struct ClockState {
    uses_sim_time: AtomicBool,
    sim: Arc<SimTime>,
    subscription: Mutex<Option<Box<dyn Subscription>>>,
}

/// The last time received on `/clock`.
struct SimTime {
    now_ns: AtomicI64,
    num_breaks: AtomicU64,
    num_bad: AtomicU64,
}

impl Default for SimTime {
    fn default() -> Self {
        Self {
            now_ns: AtomicI64::new(UNKNOWN_NS),
            num_breaks: AtomicU64::new(0),
            num_bad: AtomicU64::new(0),
        }
    }
}

impl RosClock {
    /// Returns nanoseconds since the epoch; 0 before the first message on `/clock`, as in rcl.
    pub(crate) fn now_ns(&self) -> i64 {
        if !self.uses_sim_time() {
            return system_ns();
        }
        match self.0.sim.now_ns.load(Ordering::Acquire) {
            UNKNOWN_NS => 0,
            now_ns => now_ns,
        }
    }

    /// True if [`now_ns`](Self::now_ns) is valid. With `use_sim_time`, false until the first message on `/clock`.
    pub(crate) fn is_known(&self) -> bool {
        !self.uses_sim_time() || self.0.sim.now_ns.load(Ordering::Acquire) != UNKNOWN_NS
    }

    /// True if time comes from `/clock`.
    pub(crate) fn uses_sim_time(&self) -> bool {
        self.0.uses_sim_time.load(Ordering::Acquire)
    }

    /// Number of time discontinuities: `/clock` stepped back, or the source of time changed. A change of this number
    /// starts a new session.
    pub(crate) fn num_breaks(&self) -> u64 {
        self.0.sim.num_breaks.load(Ordering::Acquire)
    }

    /// Malformed messages received on `/clock`.
    pub(crate) fn num_bad(&self) -> u64 {
        self.0.sim.num_bad.load(Ordering::Acquire)
    }

    /// Selects the source of time. Does nothing if it is already selected.
    ///
    /// # Errors
    /// The subscription to `/clock` fails; the source does not change.
    pub(crate) fn set_source(
        &self,
        transport: &dyn Transport,
        names: &NodeNames,
        source: TimeSource,
    ) -> Result<(), TransportError> {
        let mut subscription = self.0.subscription.lock().unwrap_or_else(PoisonError::into_inner);
        let next = match (source, &*subscription) {
            (TimeSource::System, None) | (TimeSource::Sim, Some(_)) => return Ok(()),
            (TimeSource::System, Some(_)) => None,
            (TimeSource::Sim, None) => Some(self.subscribe(transport, names)?),
        };
        self.0.uses_sim_time.store(next.is_some(), Ordering::Release);
        self.0.sim.num_breaks.fetch_add(1, Ordering::AcqRel);
        *subscription = next;
        Ok(())
    }

    fn subscribe(
        &self,
        transport: &dyn Transport,
        names: &NodeNames,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let sim = Arc::clone(&self.0.sim);
        // The time of an earlier subscription is out of date.
        sim.now_ns.store(UNKNOWN_NS, Ordering::Release);
        let on_arrival = Box::new(move |arrival| sim.on_arrival(arrival));
        let topic = endpoints::topic_of::<Clock>(names, "/clock", QosProfile::best_effort(1))?;
        transport.subscribe(&topic, LIMIT_BYTES, on_arrival)
    }
}

impl SimTime {
    fn on_arrival(&self, arrival: Result<Arrival, Fault>) {
        let reason = match arrival {
            Ok(arrival) => match cdr::decode::<Clock>(&arrival.data) {
                Ok(clock) => return self.set(clock.clock.to_ns()),
                Err(error) => error.to_string(),
            },
            Err(fault) => fault.to_string(),
        };
        // Logged once, then only counted: a faulty publisher may send a thousand per second.
        if self.num_bad.fetch_add(1, Ordering::AcqRel) == 0 {
            tracing::warn!("/clock: {reason}");
        }
    }

    fn set(&self, now_ns: i64) {
        let before_ns = self.now_ns.swap(now_ns, Ordering::AcqRel);
        if before_ns != UNKNOWN_NS && now_ns < before_ns {
            self.num_breaks.fetch_add(1, Ordering::AcqRel);
        }
    }
}

/// Returns nanoseconds since the epoch by the system clock; 0 if it is set before 1970.
pub(crate) fn system_ns() -> i64 {
    match SystemTime::now().duration_since(SystemTime::UNIX_EPOCH) {
        Ok(since) => i64::try_from(since.as_nanos()).unwrap_or(i64::MAX),
        // A clock set before 1970.
        Err(_) => 0,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        msg::builtin_interfaces::Time,
        ros::{loopback::Loopback, transport::Publication},
    };

    struct Rig {
        network: Loopback,
        names: NodeNames,
        clock: RosClock,
        publisher: Box<dyn Publication>,
    }

    impl Rig {
        fn new() -> Self {
            let network = Loopback::default();
            let names = NodeNames::new("laser_profiler", &[]).unwrap();
            let qos = QosProfile::best_effort(1);
            let publisher = endpoints::advertise::<Clock>(&network, &names, "/clock", qos).unwrap();
            Self { network, names, clock: RosClock::default(), publisher }
        }

        fn switch(&self, source: TimeSource) {
            self.clock.set_source(&self.network, &self.names, source).unwrap();
        }

        fn publish(&mut self, ns: i64) {
            let message = Clock { clock: Time::from_ns(ns) };
            endpoints::send(&mut *self.publisher, &message, ns).unwrap();
        }
    }

    #[test]
    fn the_system_clock_is_the_default() {
        let mut rig = Rig::new();
        rig.publish(5);
        assert!(rig.clock.is_known() && !rig.clock.uses_sim_time());
        let before_ns = system_ns();
        assert!((before_ns..before_ns + 60_000_000_000).contains(&rig.clock.now_ns()));
        assert_eq!(rig.clock.num_breaks(), 0);
    }

    #[test]
    fn with_sim_time_the_last_message_is_the_time() {
        let mut rig = Rig::new();
        rig.switch(TimeSource::Sim);
        assert!(!rig.clock.is_known());
        assert_eq!(rig.clock.now_ns(), 0);
        rig.publish(7_000_000_000);
        rig.publish(7_000_000_001);
        assert!(rig.clock.is_known());
        assert_eq!(rig.clock.now_ns(), 7_000_000_001);
    }

    #[test]
    fn only_a_step_back_and_a_switch_are_breaks() {
        let mut rig = Rig::new();
        rig.switch(TimeSource::Sim);
        assert_eq!(rig.clock.num_breaks(), 1);
        rig.switch(TimeSource::Sim);
        for ns in [10, 20, 20, 30] {
            rig.publish(ns);
        }
        assert_eq!(rig.clock.num_breaks(), 1);
        rig.publish(29);
        assert_eq!((rig.clock.num_breaks(), rig.clock.now_ns()), (2, 29));
        rig.switch(TimeSource::System);
        assert_eq!(rig.clock.num_breaks(), 3);
        // Without a subscription, later messages do not arrive, and earlier ones are discarded.
        rig.publish(40);
        rig.switch(TimeSource::Sim);
        assert!(!rig.clock.is_known());
    }

    #[test]
    fn malformed_clock_messages_are_counted_and_change_nothing() {
        let mut rig = Rig::new();
        rig.switch(TimeSource::Sim);
        rig.publish(50);
        for bytes in [&[][..], &[0, 1, 0, 0, 1], &[9; 40]] {
            rig.publisher.publish(&Arc::from(bytes), 0).unwrap();
        }
        assert_eq!((rig.clock.num_bad(), rig.clock.now_ns()), (3, 50));
    }
}
