//! A limit on repeated lines. Peers on the network cause many of a node's lines, and must not fill a disk or hide other
//! lines.

use std::{
    collections::HashMap,
    fmt,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use tracing::{
    Event, Level, Subscriber,
    callsite::Identifier,
    field::{Field, Visit},
};
use tracing_subscriber::layer::{Context, Layer};

use super::{MIDDLEWARE, OWN_TARGET};

/// Lines that a place in the program may log at once.
const BURST: u32 = 40;
/// Time after which it may log another.
const PERIOD: Duration = Duration::from_secs(5);

/// Target of the lines that say how many were left out.
const NOTICE: &str = "laser_profiler::left_out";
/// Targets of lines that are not limited: the notices, and lines of the middleware process, which limits its own and
/// whose lines the node logs from one place.
const UNLIMITED: [&str; 3] = [NOTICE, OWN_TARGET, MIDDLEWARE];
/// Target of all records of the `log` crate, which state their own in a field.
const LOG_CRATE: &str = "log";

/// Leaves out repeated lines, and says how many.
#[derive(Default)]
pub(super) struct Flood(Mutex<HashMap<Origin, Place>>);

/// A place in the program that logs.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Origin {
    Callsite(Identifier),
    Record(Record),
}

/// The place of a record of the `log` crate.
#[derive(Debug, Default, PartialEq, Eq, Hash)]
struct Record {
    target: String,
    line: u64,
}

impl Visit for Record {
    fn record_str(&mut self, field: &Field, value: &str) {
        if field.name() == "log.target" {
            value.clone_into(&mut self.target);
        }
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        if field.name() == "log.line" {
            self.line = value;
        }
    }

    fn record_debug(&mut self, _field: &Field, _value: &dyn fmt::Debug) {}
}

impl Origin {
    fn of(event: &Event<'_>) -> Self {
        if event.metadata().target() == LOG_CRATE {
            let mut record = Record::default();
            event.record(&mut record);
            Self::Record(record)
        } else {
            Self::Callsite(event.metadata().callsite())
        }
    }
}

/// Log budget of a place in the program.
struct Place {
    num_free: u32,
    counted: Instant,
    num_left_out: u64,
}

impl Place {
    const fn new(now: Instant) -> Self {
        Self { num_free: BURST, counted: now, num_left_out: 0 }
    }

    /// Returns the number of lines left out before this one, or `None` to leave it out too.
    fn admit(&mut self, now: Instant) -> Option<u64> {
        let periods = now.saturating_duration_since(self.counted).as_secs() / PERIOD.as_secs();
        if periods > 0 {
            self.num_free = BURST.min(self.num_free.saturating_add(periods.min(1000) as u32));
            self.counted = now;
        }
        if let Some(num_free) = self.num_free.checked_sub(1) {
            self.num_free = num_free;
            Some(std::mem::take(&mut self.num_left_out))
        } else {
            self.num_left_out += 1;
            None
        }
    }
}

impl<S: Subscriber> Layer<S> for Flood {
    fn event_enabled(&self, event: &Event<'_>, _context: Context<'_, S>) -> bool {
        // Whoever asks for details wants all of them.
        let is_detail = *event.metadata().level() > Level::INFO;
        if is_detail || UNLIMITED.contains(&event.metadata().target()) {
            return true;
        }
        let now = Instant::now();
        let place = Origin::of(event);
        let admitted = {
            let mut places = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            places.entry(place).or_insert_with(|| Place::new(now)).admit(now)
        };
        if let Some(num @ 1..) = admitted {
            tracing::warn!(target: NOTICE, "{num} lines like the next were left out");
        }
        admitted.is_some()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    };

    use tracing::subscriber::with_default;
    use tracing_subscriber::{layer::SubscriberExt, registry};

    use super::*;

    struct Counted(Arc<AtomicU32>);

    impl<S: Subscriber> Layer<S> for Counted {
        fn on_event(&self, _event: &Event<'_>, _context: Context<'_, S>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Number of lines that pass.
    fn num_passed(log: impl Fn()) -> u32 {
        let count = Arc::new(AtomicU32::new(0));
        let counted = Counted(Arc::clone(&count));
        with_default(registry().with(Flood::default()).with(counted), log);
        count.load(Ordering::Relaxed)
    }

    #[test]
    fn notices_and_lines_that_were_limited_already_pass() {
        let num = BURST + 60;
        assert_eq!(num_passed(|| (0..num).for_each(|_| tracing::warn!("own"))), BURST);
        assert_eq!(num_passed(|| (0..num).for_each(|_| tracing::warn!(target: NOTICE, "n"))), num);
        assert_eq!(
            num_passed(|| (0..num).for_each(|_| tracing::warn!(target: MIDDLEWARE, "m"))),
            num
        );
        assert_eq!(
            num_passed(|| (0..num).for_each(|_| tracing::warn!(target: OWN_TARGET, "o"))),
            num
        );
    }

    #[test]
    fn a_flood_leaves_a_burst_and_then_a_line_each_period() {
        let start = Instant::now();
        let mut place = Place::new(start);
        let admitted = |place: &mut Place, seconds: u64| {
            let now = start + Duration::from_secs(seconds);
            (0..1000).filter_map(|_| place.admit(now)).collect::<Vec<_>>()
        };
        assert_eq!(admitted(&mut place, 0), [0; BURST as usize]);
        assert!(admitted(&mut place, 4).is_empty());
        assert_eq!(admitted(&mut place, 5), [1960]);
        assert_eq!(admitted(&mut place, 15), [999, 0]);
        assert_eq!(admitted(&mut place, 100_000).len(), BURST as usize);
    }
}
