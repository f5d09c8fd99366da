//! Logging to standard error; standard output carries only results. A live node also publishes to `/rosout`.

mod flood;

use std::{
    io::{self, IsTerminal},
    sync::atomic::{AtomicBool, Ordering},
};

use ros2args::{LogLevel, LogLevelAssignment, RemapRule};
use tracing::{Level, Subscriber, field::Field, level_filters::LevelFilter};
use tracing_subscriber::{
    Layer,
    filter::{Targets, dynamic_filter_fn},
    fmt::{
        self, FormatFields,
        format::{Writer, debug_fn},
    },
    layer::SubscriberExt,
    registry,
    util::SubscriberInitExt,
};

use self::flood::Flood;

use super::{Usage, terminal::LogLines};
use crate::{
    msg::printable,
    node::{
        replay::NODE_NAME,
        rosout::{self, RosoutSlot},
    },
    ros::{
        names::NodeNames,
        process::{
            host::Events,
            log::{LogToNode, MIDDLEWARE},
        },
    },
};

/// Target prefix of this program's events.
const OWN_TARGET: &str = "laser_profiler";
/// Dependencies that log, by the prefix of their crate names.
const DEPENDENCIES: [&str; 3] = ["rustdds", "ros2_client", "zenoh"];
/// Logs hundreds of errors per second while fragments are lost; the counters report them.
const NOISE: &str = "rustdds::structure";

/// Logs once for each interest that a peer withdraws and this router does not keep ("Unknown remote interest"), tens of
/// them when a process with many endpoints ends. The withdrawal has no effect there; nothing is lost.
const INTERESTS: &str = "zenoh::net::routing::hat::peer::interests";

/// Log levels by logger.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Levels {
    own: LevelFilter,
    others: LevelFilter,
    named: Vec<(&'static str, LevelFilter)>,
}

impl Levels {
    /// Parses `--log-level level` and `--log-level logger:=level`. A logger is the node, a namespace above it, or a
    /// dependency. A longer name takes precedence over a shorter one, a later option over an earlier one.
    ///
    /// # Errors
    /// A logger that does not exist.
    pub(super) fn new(chosen: &[LogLevelAssignment], remaps: &[RemapRule]) -> Result<Self, Usage> {
        let mut own = (0, LogLevel::Info);
        let mut others = LogLevel::Warn;
        let mut named = Vec::new();
        for LogLevelAssignment { logger_name, level } in chosen {
            let Some(name) = logger_name else {
                own = most_specific(own, (0, *level));
                others = match level {
                    LogLevel::Info => LogLevel::Warn,
                    level => *level,
                };
                continue;
            };
            let logger = NodeNames::new(NODE_NAME, remaps)
                .map_err(|error| Usage(error.to_string()))?
                .logger();
            if is_at_or_above(name, &logger) {
                own = most_specific(own, (name.len(), *level));
            } else if let Some(crate_name) = DEPENDENCIES.iter().find(|known| *known == name) {
                named.push((*crate_name, filter(*level)));
            } else {
                return Err(Usage(format!(
                    "--log-level {name}:={}: no logger is called {name:?}, allowed is {logger}, {}",
                    level.as_str().to_lowercase(),
                    DEPENDENCIES.join(", ")
                )));
            }
        }
        Ok(Self { own: filter(own.1), others: filter(others), named })
    }

    /// Returns the level of every target.
    pub(super) fn targets(&self) -> Targets {
        // It repeats warnings on foreign datagrams and on peers with incompatible QoS.
        let rustdds =
            if self.others > LevelFilter::WARN { self.others } else { LevelFilter::ERROR };
        // The detectors of boards explain in their own terms what our errors say, once for each picture.
        let detail = if self.others > LevelFilter::WARN { self.others } else { LevelFilter::OFF };
        let detectors =
            ["calib_targets", "chess_corners", "projective_grid"].map(|name| (name, detail));
        Targets::new()
            .with_default(self.others)
            .with_targets(detectors)
            .with_target("rustdds", rustdds)
            // Its only error: a listener on loopback, which is in no multicast group, cannot leave it at the end.
            .with_target("rustdds::network::udp_listener", detail)
            .with_target(OWN_TARGET, self.own)
            // Filtered in its own process.
            .with_target(MIDDLEWARE, LevelFilter::TRACE)
            .with_targets(self.named.iter().copied())
            .with_target(NOISE, LevelFilter::OFF)
    }
}

/// Levels, with the length of the logger's name.
fn most_specific(before: (usize, LogLevel), next: (usize, LogLevel)) -> (usize, LogLevel) {
    if next.0 >= before.0 { next } else { before }
}

fn is_at_or_above(name: &str, logger: &str) -> bool {
    logger.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

const fn filter(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Debug => LevelFilter::DEBUG,
        LogLevel::Info => LevelFilter::INFO,
        LogLevel::Warn => LevelFilter::WARN,
        LogLevel::Error | LogLevel::Fatal => LevelFilter::ERROR,
    }
}

/// Lines to log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lines {
    /// All.
    All,
    /// Without floods of the same: for programs to which others connect.
    Limited,
}

/// Passes only the first error of a target.
fn once<S: Subscriber>(target: &'static str) -> impl Layer<S> {
    let was_logged = AtomicBool::new(false);
    dynamic_filter_fn(move |metadata, _| {
        let is_meant = metadata.target() == target && *metadata.level() == Level::ERROR;
        !is_meant || !was_logged.swap(true, Ordering::Relaxed)
    })
}

/// Starts logging and returns the connection for `/rosout`. A second call has no effect.
pub(super) fn start(levels: &Levels, limit: Lines) -> RosoutSlot {
    let (rosout, slot) = rosout::layer();
    let lines = fmt::layer()
        .with_target(false)
        .without_time()
        .with_ansi(io::stderr().is_terminal())
        .with_writer(|| LogLines)
        .fmt_fields(fields())
        // It would report its own failure on standard error, and panic if that fails.
        .log_internal_errors(false);
    // Also captures the `log` crate of dependencies. Fails only if a subscriber exists already, as in tests.
    let flood = (limit == Lines::Limited).then(Flood::default);
    let filters = registry().with(levels.targets()).with(flood);
    drop(filters.with(lines).with(rosout).try_init());
    slot
}

/// Starts logging in the middleware process: lines of these targets go to the node.
pub(super) fn start_in_middleware(targets: Targets, events: Events) {
    // Fails only if a subscriber exists already.
    let filters = registry().with(targets).with(Flood::default()).with(once(INTERESTS));
    drop(filters.with(LogToNode(events)).try_init());
}

/// Writes a line's text, in which peers and recordings may have a say.
fn fields() -> impl for<'writer> FormatFields<'writer> + 'static {
    debug_fn(|writer: &mut Writer<'_>, field: &Field, value| {
        // The place of a record of the `log` crate.
        if field.name().starts_with("log.") {
            return Ok(());
        }
        let value = format!("{value:?}");
        let value = printable::line(&value);
        if field.name() == "message" {
            write!(writer, "{value}")
        } else {
            write!(writer, " {field}={value}")
        }
    })
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, atomic::AtomicUsize};

    use tracing::{Event, Level, Subscriber, subscriber::with_default};
    use tracing_subscriber::layer::{Context, Layer};

    use super::*;
    use crate::ros::arguments;

    fn levels(line: &str) -> Result<Levels, Usage> {
        let words: Vec<_> = line.split_whitespace().map(str::to_owned).collect();
        let (ros, _) = arguments::split(&words).unwrap();
        Levels::new(&ros.log_levels, &ros.remaps)
    }

    fn shows(line: &str, target: &str, level: Level) -> bool {
        levels(line).unwrap().targets().would_enable(target, &level)
    }

    #[test]
    fn the_program_logs_more_than_its_dependencies() {
        assert!(shows("", "laser_profiler::node", Level::INFO));
        assert!(!shows("", "laser_profiler::node", Level::DEBUG));
        assert!(shows("", "zenoh_transport::unicast", Level::WARN));
        assert!(!shows("", "zenoh_transport::unicast", Level::INFO));
        assert!(
            !shows("", "rustdds::rtps", Level::WARN) && shows("", "rustdds::rtps", Level::ERROR)
        );
        let debug = "--ros-args --log-level debug";
        assert!(shows(debug, "laser_profiler::node", Level::DEBUG));
        assert!(shows(debug, "rustdds::rtps", Level::DEBUG));
        let listener = "rustdds::network::udp_listener";
        assert!(!shows("", listener, Level::ERROR) && shows(debug, listener, Level::ERROR));
        let error = "--ros-args --log-level error";
        assert!(!shows(error, "laser_profiler::node", Level::WARN));
        assert!(!shows(error, "rustdds::rtps", Level::WARN));
    }

    #[test]
    fn errors_of_rustdds_about_lost_fragments_are_never_logged() {
        for line in ["", "--ros-args --log-level debug", "--ros-args --log-level rustdds:=debug"] {
            assert!(!shows(line, "rustdds::structure::sequence_number", Level::ERROR), "{line}");
        }
    }

    #[test]
    fn a_logger_has_the_name_of_its_node() {
        let node = "--ros-args --log-level warn --log-level laser_profiler:=debug";
        assert!(shows(node, "laser_profiler::node", Level::DEBUG));
        assert!(!shows(node, "rustdds", Level::INFO));
        // The order does not matter.
        let node = "--ros-args --log-level laser_profiler:=debug --log-level warn";
        assert!(shows(node, "laser_profiler::node", Level::DEBUG));
        let renamed = "--ros-args -r __ns:=/cell -r __node:=top --log-level";
        assert!(shows(&format!("{renamed} cell.top:=debug"), "laser_profiler", Level::DEBUG));
        assert!(shows(&format!("{renamed} cell:=debug"), "laser_profiler", Level::DEBUG));
        let line = format!("{renamed} cell.top:=error --log-level cell:=debug");
        assert!(!shows(&line, "laser_profiler", Level::WARN));
        assert!(shows("--ros-args --log-level zenoh:=debug", "zenoh_link", Level::DEBUG));
    }

    #[test]
    fn a_logger_that_does_not_exist_is_named_with_those_that_do() {
        for name in ["other", "laser", "laser_profiler.child", "cell"] {
            let error = levels(&format!("--ros-args --log-level {name}:=debug")).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!(
                    "--log-level {name}:=debug: no logger is called {name:?}, allowed is laser_profiler, rustdds, \
                     ros2_client, zenoh"
                )
            );
        }
    }

    struct Counted(Arc<AtomicUsize>);

    impl<S: Subscriber> Layer<S> for Counted {
        fn on_event(&self, _event: &Event<'_>, _context: Context<'_, S>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn errors_that_repeat_are_logged_once() {
        let count = Arc::new(AtomicUsize::new(0));
        let counted = Counted(Arc::clone(&count));
        with_default(registry().with(once(INTERESTS)).with(counted), || {
            for _ in 0..3 {
                tracing::error!(target: "zenoh::net::routing::hat::peer::interests", "Unknown");
            }
            assert_eq!(count.load(Ordering::Relaxed), 1);
            tracing::error!(target: "zenoh::net::routing", "another");
            assert_eq!(count.load(Ordering::Relaxed), 2);
        });
    }

    #[test]
    fn records_of_the_log_crate_are_filtered_by_target() {
        // Connects the `log` crate, in this or in another test.
        start(&levels("").unwrap(), Lines::All);
        let count = Arc::new(AtomicUsize::new(0));
        let counted = Counted(Arc::clone(&count));
        with_default(registry().with(levels("").unwrap().targets()).with(counted), || {
            log::info!(target: "rustdds::discovery", "too much");
            log::error!(target: "rustdds::structure::sequence_number", "noise");
            assert_eq!(count.load(Ordering::Relaxed), 0);
            log::error!(target: "rustdds::network", "no such interface");
            assert_eq!(count.load(Ordering::Relaxed), 1);
        });
    }
}
