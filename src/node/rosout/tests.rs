use std::{
    sync::mpsc::{RecvTimeoutError, sync_channel},
    time::Duration,
};

use tracing::subscriber::with_default;
use tracing_subscriber::{layer::SubscriberExt, registry};

use super::*;
use crate::{
    msg::cdr,
    ros::{
        loopback::Loopback,
        transport::{Arrival, Fault, Subscription},
    },
};

const DEADLINE: Duration = Duration::from_secs(30);

/// A line as a subscriber receives it.
#[derive(Debug, PartialEq, Eq)]
struct ReceivedLine {
    level: u8,
    name: String,
    text: String,
    function: String,
}

struct Rig {
    network: Loopback,
    names: NodeNames,
    received: Receiver<ReceivedLine>,
    _subscription: Box<dyn Subscription>,
}

impl Rig {
    /// `on_line` runs in the subscriber, which the loopback calls inside `publish`.
    fn new(mut on_line: impl FnMut() + Send + 'static) -> Self {
        let network = Loopback::default();
        let rule = ros2args::RemapRule::new_global("__ns".into(), "/cell".into());
        let names = NodeNames::new("laser_profiler", &[rule]).unwrap();
        let (sender, received) = sync_channel(10_000);
        let receive = Box::new(move |arrival: Result<Arrival, Fault>| {
            let bytes = arrival.unwrap().data;
            let log: Log<'_> = cdr::decode(&bytes).unwrap();
            assert!(log.stamp.to_ns() > 0 && log.line > 0 && log.file.ends_with(".rs"));
            on_line();
            let line = ReceivedLine {
                level: log.level,
                name: log.name.into(),
                text: log.msg.into(),
                function: log.function.into(),
            };
            sender.send(line).unwrap();
        });
        let qos = QosProfile::latched(1000);
        let topic = endpoints::topic_of::<Log<'_>>(&names, "/rosout", qos).unwrap();
        let subscription = network.subscribe(&topic, 100_000, receive).unwrap();
        Self { network, names, received, _subscription: subscription }
    }

    fn start(&self, slot: &RosoutSlot) -> Rosout {
        Rosout::start(&self.network, &self.names, slot.clone(), Watch::default()).unwrap()
    }

    fn next(&self) -> ReceivedLine {
        self.received.recv_timeout(DEADLINE).unwrap()
    }

    fn is_quiet(&self) -> bool {
        matches!(self.received.recv_timeout(Duration::ZERO), Err(RecvTimeoutError::Timeout))
    }
}

#[test]
fn the_programs_events_become_log_lines_of_the_node() {
    let rig = Rig::new(|| ());
    let (layer, slot) = layer();
    with_default(registry().with(layer), || {
        tracing::error!("before there is a node");
        let rosout = rig.start(&slot);
        let number = 7;
        tracing::error!(number, camera = "left", "a frame of {} bytes", 12);
        tracing::warn!("w");
        tracing::info!("i");
        tracing::debug!("d");
        tracing::trace!("too fine for ROS");
        tracing::error!(target: "rustdds", "of another crate");
        tracing::error!(target: "laser_profiler_of_others", "of another crate");
        tracing::info!(target: "laser_profiler", "the end");
        drop(rosout);
        tracing::error!("after the node");
    });
    let first = rig.next();
    assert_eq!(first.level, Log::ERROR);
    assert_eq!(first.name, "cell.laser_profiler");
    assert_eq!(first.text, "a frame of 12 bytes number=7 camera=\"left\"");
    assert_eq!(first.function, "laser_profiler::node::rosout::tests");
    let rest: Vec<_> = (0..4).map(|_| rig.next()).map(|line| (line.level, line.text)).collect();
    let expected = [(30, "w"), (20, "i"), (10, "d"), (20, "the end")];
    assert_eq!(rest, expected.map(|(level, text)| (level, text.to_owned())));
    assert!(rig.is_quiet());
    assert_eq!(slot.num_dropped(), 0);
}

/// The subscriber plays a transport that logs while it publishes.
#[test]
fn events_logged_while_publishing_are_not_published() {
    let (layer, slot) = layer();
    let dispatch = tracing::Dispatch::new(registry().with(layer));
    let inside = dispatch.clone();
    let rig = Rig::new(move || {
        tracing::dispatcher::with_default(&inside, || tracing::error!("a sample was sent"));
    });
    let rosout = rig.start(&slot);
    tracing::dispatcher::with_default(&dispatch, || tracing::info!("hello"));
    drop(rosout);
    assert_eq!(rig.next().text, "hello");
    assert!(rig.is_quiet());
}

#[test]
fn logging_never_waits_and_dropped_lines_are_reported() {
    let (release, wait) = sync_channel::<()>(0);
    let rig = Rig::new(move || assert!(wait.recv().is_err()));
    let (layer, slot) = layer();
    let num_lines = 3 * DEPTH as u64;
    let rosout = rig.start(&slot);
    with_default(registry().with(layer), || {
        // The subscriber blocks in the first line; logging does not wait for it.
        for number in 0..num_lines {
            tracing::info!("{number}");
        }
    });
    let num_dropped = slot.num_dropped();
    // The queue and the thread hold the other lines.
    assert!((num_lines - DEPTH as u64 - 1..=num_lines - DEPTH as u64).contains(&num_dropped));
    drop(release);
    drop(rosout);
    let lines: Vec<_> = rig.received.try_iter().collect();
    assert_eq!(lines.len() as u64, num_lines - num_dropped + 1);
    let warnings: Vec<_> = lines.iter().filter(|line| line.level == Log::WARN).collect();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].text.starts_with(&format!("{num_dropped} log lines")), "{warnings:?}");
}

#[test]
fn long_lines_are_truncated_and_control_characters_escaped() {
    let rig = Rig::new(|| ());
    let (layer, slot) = layer();
    with_default(registry().with(layer), || {
        let rosout = rig.start(&slot);
        tracing::warn!("a\0b");
        tracing::warn!("{}", "\u{b5}".repeat(100_000));
        drop(rosout);
    });
    assert_eq!(rig.next().text, "a\\u0000b");
    let long = rig.next().text;
    assert!(long.len() <= 4096 && long.ends_with("\u{b5} [...]"), "{}", long.len());
}
