//! Load in its own process, to measure its memory and time alone: asserted by a test for seconds, and
//! recorded for minutes.
//!
//! ```sh
//! DDS_LOAD="receive Cyclone 2592 2048 22 60" cargo test --release --test it -- --exact dds::load::run --nocapture
//! DDS_LOAD="send FastDds 60000 100 60"       cargo test --release --test it -- --exact dds::load::run --nocapture
//! ```
//!
//! `receive_reliably` has both ends reliable. Images of that width and height, or messages of that many bytes, at that
//! rate, for that many seconds.

use std::{
    env, fs,
    process::Command,
    thread,
    time::{Duration, Instant, SystemTime},
};

use laser_profiler::{
    msg::{
        cdr::decode,
        qos::{QosProfile, Reliability},
        sensor_msgs::Image,
    },
    ros::transport::Transport,
};
use serde_json::{Value as Json, json};

use super::{
    domain::Domain,
    node::{AROUND_PIXELS, Inbox, image, image_topic, open, wait_for_subscribers},
    peer::{Peer, VENDORS, Vendor},
};
use crate::program::end;

const LIMIT_BYTES: usize = 64 << 20;
/// The kernel counts time in hundredths of a second.
const TICKS_PER_S: f64 = 100.0;

fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    i64::try_from(since.as_nanos()).unwrap()
}

/// Seconds that this process has computed.
fn processor_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let behind_name = stat.rsplit(')').next().unwrap();
    let ticks = behind_name.split_whitespace().skip(11).take(2);
    ticks.map(|ticks| ticks.parse::<f64>().unwrap()).sum::<f64>() / TICKS_PER_S
}

/// The most memory that this process ever had.
fn peak_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}

fn percentile_ms(latencies_ns: &[i64], percent: usize) -> f64 {
    let at = latencies_ns.len().saturating_sub(1) * percent / 100;
    latencies_ns.get(at).map_or(f64::NAN, |latency| *latency as f64 / 1e6)
}

fn figures(sent: i64, mut latencies_ns: Vec<i64>, wall: Duration, processor_s: f64) -> Json {
    latencies_ns.sort_unstable();
    json!({
        "sent": sent,
        "received": latencies_ns.len(),
        "p50_ms": percentile_ms(&latencies_ns, 50),
        "p99_ms": percentile_ms(&latencies_ns, 99),
        "max_ms": percentile_ms(&latencies_ns, 100),
        "cores": processor_s / wall.as_secs_f64(),
        "peak_mb": peak_mb(),
    })
}

/// Takes a camera's images and counts those that are whole. Latency: from the stamp to the hands of the node.
fn receive(
    vendor: Vendor,
    qos: QosProfile,
    [width, height, rate, seconds]: [u32; 4],
) -> Option<Json> {
    let domain = Domain::claim();
    let node = open(&domain, "reader");
    let topic = image_topic("/camera/image_raw", qos);
    let inbox = Inbox::open(&node, &topic, LIMIT_BYTES);
    let [width_, height_, rate_, count] =
        [width, height, rate, rate * seconds].map(|number| number.to_string());
    let arguments = ["publish", "--topic", "rt/camera/image_raw", "--width", &width_];
    let more = ["--height", &height_, "--rate", &rate_, "--count", &count, "--held"];
    let reliably: &[&str] =
        if qos.reliability == Reliability::Reliable { &["--reliable"] } else { &[] };
    let mut peer = Peer::start(vendor, &domain, &[&arguments[..], &more, reliably].concat())?;
    inbox.release(&mut peer);
    let (started, before_s) = (Instant::now(), processor_s());
    let mut latencies_ns = Vec::new();
    while latencies_ns.len() < (rate * seconds) as usize {
        let Some(arrival) = inbox.next_within(Duration::from_secs(3)) else { break };
        let arrived_ns = now_ns();
        let arrival = arrival.unwrap();
        let image: Image<'_> = decode(&arrival.data).unwrap();
        assert_eq!((image.width, image.height), (width, height));
        let stamp = image.header.stamp;
        let stamp_ns = i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec);
        latencies_ns.push(arrived_ns - stamp_ns);
    }
    let took = processor_s() - before_s;
    Some(figures(i64::from(rate * seconds), latencies_ns, started.elapsed(), took))
}

/// Publishes results, reliably, and has a peer count them.
fn send(vendor: Vendor, [bytes, rate, seconds]: [u32; 3]) -> Option<Json> {
    let domain = Domain::claim();
    let node = open(&domain, "writer");
    let topic = image_topic("/result", QosProfile::reliable(10));
    let mut publication = node.advertise(&topic).unwrap();
    let (count, patience) = ((rate * seconds).to_string(), (seconds + 10).to_string());
    let arguments = ["subscribe", "--topic", "rt/result", "--reliable", "--count", &count];
    let more = ["--seconds", &patience];
    let peer = Peer::start(vendor, &domain, &[&arguments[..], &more].concat())?;
    wait_for_subscribers(&*publication, 1);
    peer.wait_for("matched");
    let (started, before_s) = (Instant::now(), processor_s());
    for number in 0..rate * seconds {
        let due = Duration::from_secs_f64(f64::from(number) / f64::from(rate));
        thread::sleep(due.saturating_sub(started.elapsed()));
        let stamp_ns = now_ns();
        publication.publish(&image(bytes - AROUND_PIXELS, stamp_ns), stamp_ns).unwrap();
    }
    let (wall, took) = (started.elapsed(), processor_s() - before_s);
    let line = peer.wait_for("received");
    let mut figures = figures(i64::from(rate * seconds), Vec::new(), wall, took);
    for (ours, theirs) in
        [("received", "count"), ("p50_ms", "p50_ms"), ("p99_ms", "p99_ms"), ("max_ms", "max_ms")]
    {
        figures[ours] = line[theirs].clone();
    }
    Some(figures)
}

/// Runs the load in `DDS_LOAD`; does nothing if it is not set.
#[test]
fn run() {
    let Ok(load) = env::var("DDS_LOAD") else { return };
    let mut words = load.split_whitespace();
    let (verb, vendor) = (words.next().unwrap(), words.next().unwrap());
    let vendor = VENDORS.into_iter().find(|known| format!("{known:?}") == vendor).unwrap();
    let numbers: Vec<u32> = words.map(|word| word.parse().unwrap()).collect();
    let figures = match verb {
        "receive" => receive(vendor, QosProfile::best_effort(5), numbers.try_into().unwrap()),
        "receive_reliably" => {
            receive(vendor, QosProfile::reliable(10), numbers.try_into().unwrap())
        }
        "send" => send(vendor, numbers.try_into().unwrap()),
        _ => panic!("receive, receive_reliably or send"),
    };
    if let Some(figures) = figures {
        eprintln!("{load}: {figures}");
    }
}

/// The figures of a load in a process of its own; `None` where there is no peer.
fn measured(load: &str, environment: &[(&str, &str)]) -> Option<Json> {
    let mut command = Command::new(env::current_exe().unwrap());
    command.args(["--exact", "dds::load::run", "--nocapture"]).env("DDS_LOAD", load);
    let ended = end(command.envs(environment.iter().copied()));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let line = ended.stderr.lines().find_map(|line| line.strip_prefix(&format!("{load}: ")))?;
    Some(serde_json::from_str(line).unwrap())
}

fn peak_is_below(figures: &Json, limit_mb: f64) {
    assert!(figures["peak_mb"].as_f64().unwrap() < limit_mb, "{figures}");
}

#[test]
fn images_take_a_bounded_part_of_memory() {
    let _alone = Domain::claim_alone();
    let Some(figures) = measured("receive Cyclone 2592 2048 22 5", &[]) else { return };
    let number = |name: &str| figures[name].as_f64().unwrap();
    let num_lost = number("sent") - number("received");
    assert!(num_lost < 55.0, "half of them, even on a busy machine: {figures}");
    // Six images are queued, two are in transit, and a busy machine keeps fragments of lost ones.
    peak_is_below(&figures, 60.0 + 5.3 * (8.0 + num_lost));
}

/// RustDDS kept incomplete images for ten seconds, up to 700 MB.
#[cfg(feature = "cyclone")]
#[test]
fn lost_datagrams_take_little_memory() {
    let configuration = "<CycloneDDS><Domain><Internal><Test><XmitLossiness>10</XmitLossiness></Test></Internal>\
                         </Domain></CycloneDDS>";
    let _alone = Domain::claim_alone();
    let environment = [("CYCLONEDDS_URI", configuration)];
    let load = "receive Cyclone 2592 2048 22 5";
    let Some(figures) = measured(load, &environment) else { return };
    peak_is_below(&figures, 100.0);
}

/// Cyclone drops one datagram of a hundred that it sends: one image of five would not arrive whole.
#[test]
fn reliable_subscriptions_recover_lost_datagrams() {
    let configuration = "<CycloneDDS><Domain><Internal><Test><XmitLossiness>10</XmitLossiness></Test></Internal>\
                         </Domain></CycloneDDS>";
    let _alone = Domain::claim_alone();
    let environment = [("CYCLONEDDS_URI", configuration)];
    let load = "receive_reliably Cyclone 640 480 22 5";
    let Some(figures) = measured(load, &environment) else { return };
    assert_eq!(figures["received"], figures["sent"], "{figures}");
    peak_is_below(&figures, 100.0);
}
