//! Messages in both directions, read and written by software that is not ours.

use std::{sync::Arc, time::SystemTime};

use laser_profiler::{
    msg::{cdr::decode, qos::QosProfile, sensor_msgs::Image},
    ros::transport::Transport,
};
use serde_json::json;

use super::{
    domain::Domain,
    node::{Inbox, eventually, image, image_topic, open, wait_for_subscribers},
    peer::Peer,
};

const LIMIT_BYTES: usize = 64 << 20;

fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    i64::try_from(since.as_nanos()).unwrap()
}

#[test]
fn images_from_python_arrive_with_their_metadata() {
    let domain = Domain::claim();
    let node = open(&domain, "reader");
    let topic = image_topic("/camera/image_raw", QosProfile::best_effort(5));
    let inbox = Inbox::open(&node, &topic, LIMIT_BYTES);
    let started_ns = now_ns();
    let Some(mut peer) = Peer::python("publish", &domain, &["rt/camera/image_raw", "10"]) else {
        return;
    };
    inbox.release(&mut peer);
    let first = inbox.next().unwrap();
    assert_eq!(inbox.subscription.num_matched(), 1);
    for (number, arrival) in
        (1..).zip(std::iter::once(first.clone()).chain((1..10).map(|_| inbox.next().unwrap())))
    {
        let image: Image<'_> = decode(&arrival.data).unwrap();
        assert_eq!(i64::from(image.header.stamp.sec), number - 1);
        assert_eq!(image.header.frame_id, "camera");
        assert_eq!((image.width, image.height, image.step), (64, 48, 64));
        let pixels: Vec<u8> = (0..12).flat_map(|_| 0..=255).collect();
        assert_eq!(image.data, pixels);
        assert_eq!(arrival.sequence, Some(number));
        assert_eq!(arrival.publisher, first.publisher);
        assert!((started_ns..arrival.receive_time_ns).contains(&arrival.source_time_ns));
        assert!(arrival.receive_time_ns <= now_ns());
    }
}

#[test]
fn python_reads_what_we_publish() {
    let domain = Domain::claim();
    let node = open(&domain, "writer");
    let topic = image_topic("/result", QosProfile::latched(10));
    let mut publication = node.advertise(&topic).unwrap();
    let Some(peer) = Peer::python("subscribe", &domain, &["rt/result", "3"]) else { return };
    wait_for_subscribers(&*publication, 1);
    for number in 1..=3 {
        let stamp_ns = number * 1_000_000_007;
        publication.publish(&image(100, stamp_ns), stamp_ns).unwrap();
        let line = peer.wait_for("image");
        assert_eq!(line["stamp"], json!([number, 7 * number]));
        assert_eq!(line["source_ns"], stamp_ns);
        assert_eq!((&line["size"], &line["sum"]), (&json!([100, 1]), &json!(700)));
    }
}

#[test]
fn a_late_subscriber_receives_latched_messages() {
    let domain = Domain::claim();
    let node = open(&domain, "writer");
    let mut publication = node.advertise(&image_topic("/latched", QosProfile::latched(1))).unwrap();
    for number in 1..=3 {
        publication.publish(&image(100, number), number).unwrap();
    }
    // It would wait for all three, as RustDDS sends them all; only the last is promised.
    let Some(peer) = Peer::python("subscribe", &domain, &["rt/latched", "3"]) else { return };
    peer.wait_until(|line| line["stamp"] == json!([0, 3]));
}

#[test]
fn between_our_own_nodes_nothing_is_lost_and_matches_are_counted() {
    let domain = Domain::claim();
    let (sender, receiver) = (open(&domain, "sender"), open(&domain, "receiver"));
    // RustDDS stores more than the depth until it is acknowledged, Cyclone exactly that many.
    let depth = if cfg!(feature = "cyclone") { 50 } else { 10 };
    let mut publication =
        sender.advertise(&image_topic("/blob", QosProfile::reliable(depth))).unwrap();
    assert_eq!(publication.num_matched(), 0);
    let inboxes = [QosProfile::reliable(100), QosProfile::best_effort(100)]
        .map(|qos| Inbox::open(&receiver, &image_topic("/blob", qos), LIMIT_BYTES));
    wait_for_subscribers(&*publication, 2);
    eventually("both are matched", || {
        inboxes.iter().all(|inbox| inbox.subscription.num_matched() == 1)
    });
    let message = image(20_000, 5);
    for _ in 0..50 {
        publication.publish(&message, 6).unwrap();
    }
    for number in 1..=50 {
        let arrival = inboxes[0].next().unwrap();
        assert_eq!((arrival.sequence, arrival.source_time_ns), (Some(number), 6));
        assert_eq!(arrival.data, message.as_ref());
    }
    drop(inboxes);
    wait_for_subscribers(&*publication, 0);
}

#[test]
fn a_best_effort_publisher_is_not_matched_with_a_reliable_subscriber() {
    let domain = Domain::claim();
    let (sender, receiver) = (open(&domain, "sender"), open(&domain, "receiver"));
    let best_effort = image_topic("/x", QosProfile::best_effort(5));
    let publication = sender.advertise(&best_effort).unwrap();
    let reliable = image_topic("/x", QosProfile::reliable(5));
    let deaf = Inbox::open(&receiver, &reliable, LIMIT_BYTES);
    let hearing = Inbox::open(&receiver, &best_effort, LIMIT_BYTES);
    // Each end learns of it by itself.
    eventually("one is matched", || {
        hearing.subscription.num_matched() == 1 && publication.num_matched() > 0
    });
    assert_eq!((deaf.subscription.num_matched(), publication.num_matched()), (0, 1));
}

#[test]
fn only_little_endian_cdr_is_published() {
    let domain = Domain::claim();
    let node = open(&domain, "writer");
    let mut publication = node.advertise(&image_topic("/x", QosProfile::reliable(5))).unwrap();
    let message: Arc<[u8]> = Arc::from([0, 0, 0, 0, 1]);
    let error = publication.publish(&message, 0).unwrap_err().to_string();
    assert!(error.contains("/x") && error.contains("little-endian"), "{error}");
}

/// RustDDS gives a new reader what it received for an earlier one.
#[test]
fn a_new_subscription_gets_nothing_from_before_it() {
    let domain = Domain::claim();
    let (sender, receiver) = (open(&domain, "sender"), open(&domain, "receiver"));
    let topic = image_topic("/image", QosProfile::reliable(50));
    let mut publication = sender.advertise(&topic).unwrap();
    let first = Inbox::open(&receiver, &topic, LIMIT_BYTES);
    wait_for_subscribers(&*publication, 1);
    for number in 1..=20 {
        publication.publish(&image(100, number), number).unwrap();
        assert_eq!(first.next().unwrap().source_time_ns, number);
    }
    drop(first);
    wait_for_subscribers(&*publication, 0);
    let second = Inbox::open(&receiver, &topic, LIMIT_BYTES);
    wait_for_subscribers(&*publication, 1);
    publication.publish(&image(100, 21), 21).unwrap();
    assert_eq!(second.next().unwrap().source_time_ns, 21);
}
