//! Messages both ways, latched ones included.

use laser_profiler::{
    msg::{cdr, qos::QosProfile, schema::Message, sensor_msgs::Image},
    ros::transport::Transport,
};

use super::{
    network::{Inbox, Network, header, headers, images},
    peer::wait_until,
};

const NO_LIMIT: usize = usize::MAX;

#[test]
fn images_from_python_arrive_intact() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let inbox = Inbox::open(&node, &images(), NO_LIMIT);
    let _sender = network.peer(
        "send",
        &["--count", "5", "--width", "640", "--height", "480", "--fps", "50", "--linger", "60"],
    );
    let mut senders = Vec::new();
    for number in 0..5_u32 {
        let arrival = inbox.next().unwrap();
        let image: Image<'_> = cdr::decode(&arrival.data).unwrap();
        assert_eq!((image.width, image.height, image.step), (640, 480, 640));
        assert_eq!((image.encoding.as_ref(), image.header.frame_id.as_ref()), ("mono8", "camera"));
        let expected = |index: usize| ((index + number as usize) % 251) as u8;
        assert!(image.data.iter().enumerate().all(|(index, pixel)| *pixel == expected(index)));
        assert_eq!(arrival.sequence, Some(i64::from(number) + 1));
        assert_eq!(arrival.source_time_ns, image.header.stamp.to_ns());
        assert!(arrival.receive_time_ns >= arrival.source_time_ns, "{arrival:?}");
        senders.push(arrival.publisher);
    }
    senders.dedup();
    assert_eq!(senders.len(), 1);
    assert_eq!(inbox.subscription.num_matched(), 1);
}

#[test]
fn ours_arrive_at_python() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let mut publication = node.advertise(&headers(QosProfile::reliable(10))).unwrap();
    assert_eq!(publication.num_matched(), 0);
    let listener = network.header_peer("listen", &[]);
    listener.event("ready");
    wait_until("a subscriber", || publication.num_matched() == 1);
    for sequence in 1..=3 {
        let data = header(&format!("message {sequence}"));
        publication.publish(&data, sequence * 1_000_000_007).unwrap();
        let message = listener.event("message");
        assert_eq!(message["payload"], serde_json::json!(data.to_vec()));
        assert_eq!(message["sequence"], sequence);
        assert_eq!(message["source_time_ns"], sequence * 1_000_000_007);
    }
    drop(listener);
    wait_until("no subscriber", || publication.num_matched() == 0);
}

#[test]
fn our_late_subscribers_receive_latched_messages() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let mut publication = node.advertise(&headers(QosProfile::latched(2))).unwrap();
    for text in ["one", "two", "three"] {
        publication.publish(&header(text), 1).unwrap();
    }
    let listener = network.header_peer("listen", &["--latched", "2"]);
    // The subscriber requests history before it announces itself.
    let events = [(); 3].map(|()| listener.any_event());
    let sequences: Vec<_> = events.iter().filter_map(|event| event["sequence"].as_i64()).collect();
    assert_eq!(sequences, [2, 3], "{events:?}");
    publication.publish(&header("four"), 1).unwrap();
    assert_eq!(listener.event("message")["sequence"], 4);
}

#[test]
fn our_subscribers_receive_latched_messages_of_peers() {
    let Some((network, _router)) = Network::start() else { return };
    let talker = network.header_peer("talk", &["--latched", "1", "--count", "3"]);
    talker.event("sent");
    let node = network.node();
    let inbox = Inbox::open(&node, &headers(QosProfile::latched(1)), NO_LIMIT);
    assert_eq!(inbox.next().unwrap().sequence, Some(3));
    // The subscriber also queries a publisher that comes later.
    let late = network.header_peer("talk", &["--latched", "1", "--count", "2"]);
    late.event("sent");
    wait_until("the last of the other", || {
        inbox.try_next().is_some_and(|arrival| arrival.unwrap().sequence == Some(2))
    });
}

/// A publisher of Lyrical sends images to a separate key if every subscriber belongs to the group.
#[test]
fn the_cpu_buffer_group_is_listened_to() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let inbox = Inbox::open(&node, &images(), NO_LIMIT);
    let kind = Image::TYPE;
    let arguments = ["--type", kind.name, "--hash", kind.hash];
    for suffix in ["", "/_buf_cpu"] {
        let arguments = [&arguments[..], &["--suffix", suffix]].concat();
        let talker = network.peer("talk", &arguments);
        talker.event("sent");
        assert_eq!(inbox.next().unwrap().data, [7; 4], "{suffix:?}");
    }
}

#[test]
fn nothing_arrives_behind_a_drop() {
    let Some((network, _router)) = Network::start() else { return };
    let (node, other) = (network.node(), network.node());
    let mut publication = other.advertise(&headers(QosProfile::reliable(10))).unwrap();
    let (gone, stays) = (
        Inbox::open(&node, &headers(QosProfile::reliable(10)), NO_LIMIT),
        Inbox::open(&node, &headers(QosProfile::reliable(10)), NO_LIMIT),
    );
    wait_until("two subscribers", || publication.num_matched() == 2);
    publication.publish(&header("first"), 1).unwrap();
    assert_eq!(gone.next().unwrap().sequence, Some(1));
    drop(gone.subscription);
    wait_until("one subscriber", || publication.num_matched() == 1);
    publication.publish(&header("second"), 1).unwrap();
    assert_eq!(stays.next().unwrap().sequence, Some(1));
    assert_eq!(stays.next().unwrap().sequence, Some(2));
    assert!(gone.arrivals.try_recv().is_err());
    // The session outlives its node: an endpoint is enough.
    drop((node, other));
    publication.publish(&header("third"), 1).unwrap();
    assert_eq!(stays.next().unwrap().sequence, Some(3));
}
