//! The time of the node: the system's time, or with `use_sim_time` the last message on `/clock`.

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

/// A `Clock` has 12 bytes; some writers pad.
const LIMIT_BYTES: usize = 64;
const UNHEARD_NS: i64 = i64::MIN;

/// Source of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeSource {
    /// This machine's clock.
    System,
    /// `/clock`, as `use_sim_time` wants it.
    Sim,
}

/// The node's clock. Clones share it.
#[derive(Clone, Default)]
pub struct RosClock(Arc<ClockState>);

#[derive(Default)]
struct ClockState {
    uses_sim_time: AtomicBool,
    sim: Arc<SimTime>,
    subscription: Mutex<Option<Box<dyn Subscription>>>,
}

/// The last time on `/clock`.
struct SimTime {
    now_ns: AtomicI64,
    num_breaks: AtomicU64,
    num_bad: AtomicU64,
}

impl Default for SimTime {
    fn default() -> Self {
        Self {
            now_ns: AtomicI64::new(UNHEARD_NS),
            num_breaks: AtomicU64::new(0),
            num_bad: AtomicU64::new(0),
        }
    }
}

impl RosClock {
    /// Nanoseconds since the epoch; 0 before the first message on `/clock`, as in rcl.
    pub fn now_ns(&self) -> i64 {
        if !self.uses_sim_time() {
            return system_ns();
        }
        match self.0.sim.now_ns.load(Ordering::Acquire) {
            UNHEARD_NS => 0,
            now_ns => now_ns,
        }
    }

    /// True if [`now_ns`](Self::now_ns) is valid: with `use_sim_time` not before the first message on `/clock`.
    pub fn is_known(&self) -> bool {
        !self.uses_sim_time() || self.0.sim.now_ns.load(Ordering::Acquire) != UNHEARD_NS
    }

    /// True if time comes from `/clock`.
    pub fn uses_sim_time(&self) -> bool {
        self.0.uses_sim_time.load(Ordering::Acquire)
    }

    /// How often time did not go on: `/clock` stepped back, or the source of time changed. Another number than before
    /// means that a new session begins.
    pub fn num_breaks(&self) -> u64 {
        self.0.sim.num_breaks.load(Ordering::Acquire)
    }

    /// Messages on `/clock` that were none.
    pub fn num_bad(&self) -> u64 {
        self.0.sim.num_bad.load(Ordering::Acquire)
    }

    /// Chooses the source of time, at any time. Nothing happens where it is chosen already.
    ///
    /// # Errors
    /// `/clock` cannot be subscribed; the source stays what it was.
    pub fn set_source(
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
        // An earlier time on `/clock` is out of date.
        sim.now_ns.store(UNHEARD_NS, Ordering::Release);
        let on_arrival = Box::new(move |arrival| sim.hear(arrival));
        let qos = QosProfile::best_effort(1);
        endpoints::subscribe::<Clock>(transport, (names, "/clock"), qos, LIMIT_BYTES, on_arrival)
    }
}

impl SimTime {
    fn hear(&self, arrival: Result<Arrival, Fault>) {
        let reason = match arrival {
            Ok(arrival) => match cdr::decode::<Clock>(&arrival.data) {
                Ok(clock) => return self.set(clock.clock.to_ns()),
                Err(error) => error.to_string(),
            },
            Err(fault) => fault.to_string(),
        };
        // Once, and counted from then on: a wrong publisher sends a thousand a second.
        if self.num_bad.fetch_add(1, Ordering::AcqRel) == 0 {
            tracing::warn!("/clock: {reason}");
        }
    }

    fn set(&self, now_ns: i64) {
        let before_ns = self.now_ns.swap(now_ns, Ordering::AcqRel);
        if before_ns != UNHEARD_NS && now_ns < before_ns {
            self.num_breaks.fetch_add(1, Ordering::AcqRel);
        }
    }
}

/// Nanoseconds since the epoch by the system's clock.
pub fn system_ns() -> i64 {
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

        fn tell(&mut self, ns: i64) {
            let message = Clock { clock: Time::from_ns(ns) };
            endpoints::send(&mut *self.publisher, &message, ns).unwrap();
        }
    }

    #[test]
    fn the_system_clock_is_the_default() {
        let mut rig = Rig::new();
        rig.tell(5);
        assert!(rig.clock.is_known() && !rig.clock.uses_sim_time());
        let before_ns = system_ns();
        assert!((before_ns..before_ns + 60_000_000_000).contains(&rig.clock.now_ns()));
        assert_eq!(rig.clock.num_breaks(), 0);
    }

    #[test]
    fn with_sim_time_the_last_message_counts() {
        let mut rig = Rig::new();
        rig.switch(TimeSource::Sim);
        assert!(!rig.clock.is_known());
        assert_eq!(rig.clock.now_ns(), 0);
        rig.tell(7_000_000_000);
        rig.tell(7_000_000_001);
        assert!(rig.clock.is_known());
        assert_eq!(rig.clock.now_ns(), 7_000_000_001);
    }

    #[test]
    fn a_step_back_and_a_switch_are_breaks_and_nothing_else_is() {
        let mut rig = Rig::new();
        rig.switch(TimeSource::Sim);
        assert_eq!(rig.clock.num_breaks(), 1);
        rig.switch(TimeSource::Sim);
        for ns in [10, 20, 20, 30] {
            rig.tell(ns);
        }
        assert_eq!(rig.clock.num_breaks(), 1);
        rig.tell(29);
        assert_eq!((rig.clock.num_breaks(), rig.clock.now_ns()), (2, 29));
        rig.switch(TimeSource::System);
        assert_eq!(rig.clock.num_breaks(), 3);
        // Unsubscribed: later messages do not arrive, and earlier ones are forgotten.
        rig.tell(40);
        rig.switch(TimeSource::Sim);
        assert!(!rig.clock.is_known());
    }

    #[test]
    fn malformed_clock_messages_are_counted_and_change_nothing() {
        let mut rig = Rig::new();
        rig.switch(TimeSource::Sim);
        rig.tell(50);
        for bytes in [&[][..], &[0, 1, 0, 0, 1], &[9; 40]] {
            rig.publisher.publish(&Arc::from(bytes), 0).unwrap();
        }
        assert_eq!((rig.clock.num_bad(), rig.clock.now_ns()), (3, 50));
    }
}
