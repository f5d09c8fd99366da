//! Messages that do not belong on a topic: each is a named fault, and good messages still arrive.

use std::sync::Arc;

use laser_profiler::{
    msg::{
        cdr::{CdrError, decode},
        laser_profiler_msgs::Centerline,
        qos::QosProfile,
        schema::Message,
        sensor_msgs::Image,
    },
    ros::transport::{Fault, Transport},
};

use super::{
    domain::Domain,
    node::{Inbox, image, image_topic, open, topic, wait_for_subscribers},
    peer::{Peer, VENDORS},
};

const LIMIT_BYTES: usize = 10_000;

#[test]
fn an_oversized_message_is_a_fault_and_the_next_one_arrives() {
    let domain = Domain::claim();
    let (sender, receiver) = (open(&domain, "sender"), open(&domain, "receiver"));
    let images = image_topic("/image", QosProfile::reliable(10));
    let mut publication = sender.advertise(&images).unwrap();
    let inbox = Inbox::open(&receiver, &images, LIMIT_BYTES);
    wait_for_subscribers(&*publication, 1);
    let (large, small) = (image(50_000, 1), image(100, 2));
    publication.publish(&large, 1).unwrap();
    publication.publish(&small, 2).unwrap();
    let limit_bytes = LIMIT_BYTES;
    assert_eq!(inbox.next(), Err(Fault::TooLarge { bytes: large.len(), limit_bytes }));
    assert_eq!(inbox.next().unwrap().data, small.as_ref());
}

#[test]
fn bytes_that_are_no_message_are_handed_on_as_they_are() {
    let domain = Domain::claim();
    let (sender, receiver) = (open(&domain, "sender"), open(&domain, "receiver"));
    let images = image_topic("/image", QosProfile::reliable(10));
    let mut publication = sender.advertise(&images).unwrap();
    let inbox = Inbox::open(&receiver, &images, LIMIT_BYTES);
    wait_for_subscribers(&*publication, 1);
    for garbage in [&[0, 1, 0, 0][..], &[0, 1, 0, 0, 0xff], &[[0, 1, 0, 0], [0xff; 4]].concat()] {
        publication.publish(&Arc::from(garbage), 0).unwrap();
        let arrival = inbox.next().unwrap();
        assert!(arrival.data.starts_with(garbage), "{:?}", arrival.data);
        assert!(matches!(decode::<Image<'_>>(&arrival.data), Err(CdrError::Content { .. })));
    }
}

#[test]
fn a_publisher_of_another_type_is_named() {
    let domain = Domain::claim();
    let (sender, receiver) = (open(&domain, "sender"), open(&domain, "receiver"));
    let qos = QosProfile::reliable(10);
    let foreign = topic("/image", Centerline::TYPE, qos);
    let mut wrong = sender.advertise(&foreign).unwrap();
    let mut right = sender.advertise(&image_topic("/image", qos)).unwrap();
    let inbox = Inbox::open(&receiver, &image_topic("/image", qos), LIMIT_BYTES);
    wait_for_subscribers(&*right, 1);
    // RustDDS matches by the topic's name alone, and finds the type with the message; Cyclone matches by both.
    wait_for_subscribers(&*wrong, usize::from(!cfg!(feature = "cyclone")));
    wrong.publish(&image(100, 1), 1).unwrap();
    let fault = inbox.next().unwrap_err().to_string();
    let words = ["laser_profiler_msgs::msg::dds_::Centerline_", "sensor_msgs::msg::dds_::Image_"];
    assert!(words.iter().all(|word| fault.contains(word)), "{fault}");
    right.publish(&image(100, 2), 2).unwrap();
    assert!(inbox.next().is_ok());
}

/// Version 2 of CDR, from a peer that promised version 1.
#[test]
fn another_encoding_is_named() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let node = open(&domain, "receiver");
        let images = image_topic("/image", QosProfile::best_effort(5));
        let inbox = Inbox::open(&node, &images, 1 << 20);
        let arguments = ["publish", "--topic", "rt/image", "--count", "3", "--encoding", "7"];
        let Some(_peer) = Peer::start(vendor, &domain, &arguments) else { continue };
        let fault = inbox.next().unwrap_err().to_string();
        assert!(fault.contains("encapsulation 00 07 is not plain CDR"), "{vendor:?}: {fault}");
    }
}
