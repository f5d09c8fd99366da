use std::fmt::Debug;

use proptest::{collection::vec, prelude::*};
use serde::{
    Deserializer, Serialize,
    de::{SeqAccess, Visitor},
};

use super::*;
use crate::msg::{
    action_msgs, builtin_interfaces, diagnostic_msgs, foxglove_msgs, geometry_msgs,
    laser_profiler_msgs::{self, scan},
    lifecycle_msgs,
    noise::{self, for_each_message},
    rcl_interfaces, rosgraph_msgs, rosout,
    schema::MessageType,
    sensor_msgs, std_msgs, std_srvs, tf2_msgs, unique_identifier_msgs,
};

fn check_round_trip<'a, T>(noise: &'a [u8], bytes: &'a mut Vec<u8>)
where
    T: Message + Deserialize<'a> + PartialEq + Debug,
{
    let message: T = noise::message(noise);
    encode(&message, bytes).unwrap();
    // Noise never yields NaN, the default exposure time, so messages compare equal.
    assert_eq!(decode::<T>(bytes).unwrap(), message);
}

/// Any outcome but a panic.
fn check_decode<'a, T: Message + Deserialize<'a>>(bytes: &'a [u8]) {
    drop(decode::<T>(bytes));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_message_round_trips(noise in vec(any::<u8>(), 0..2000)) {
        for_each_message!(check_round_trip, &noise, &mut Vec::new());
    }

    #[test]
    fn arbitrary_bytes_never_panic(order in 0_u8..2, mut bytes in vec(any::<u8>(), 0..300)) {
        bytes.splice(0..0, [0, order, 0, 0]);
        for_each_message!(check_decode, &bytes);
    }

    /// Most arbitrary bytes fail early; messages with one wrong byte are decoded further.
    #[test]
    fn damaged_messages_never_panic(noise in vec(any::<u8>(), 400), at: prop::sample::Index, byte: u8) {
        let mut bytes = Vec::new();
        encode(&noise::message::<laser_profiler_msgs::Centerline<'_>>(&noise), &mut bytes).unwrap();
        *at.get_mut(&mut bytes) = byte;
        check_decode::<laser_profiler_msgs::Centerline<'_>>(&bytes);
        encode(&noise::message::<diagnostic_msgs::DiagnosticArray<'_>>(&noise), &mut bytes).unwrap();
        *at.get_mut(&mut bytes) = byte;
        check_decode::<diagnostic_msgs::DiagnosticArray<'_>>(&bytes);
    }
}

/// Time 1.5 s, frame `ab`.
const HEADER: [u8; 19] =
    [0, 1, 0, 0, 1, 0, 0, 0, 0x00, 0x65, 0xcd, 0x1d, 3, 0, 0, 0, b'a', b'b', 0];

#[test]
fn bytes_are_little_endian_and_reuse_the_buffer() {
    let header = std_msgs::Header {
        stamp: builtin_interfaces::Time { sec: 1, nanosec: 500_000_000 },
        frame_id: "ab".into(),
    };
    let mut bytes = Vec::with_capacity(100);
    bytes.extend([7; 50]);
    let memory = bytes.as_ptr();
    encode(&header, &mut bytes).unwrap();
    assert_eq!(bytes, HEADER);
    assert_eq!(bytes.as_ptr(), memory);
    assert_eq!(decode::<std_msgs::Header<'_>>(&bytes).unwrap(), header);
}

#[test]
fn both_byte_orders_are_read_and_bytes_are_borrowed() {
    let big = [
        0, 0, 0, 0, 0, 0, 0, 1, 0x1d, 0xcd, 0x65, 0x00, 0, 0, 0, 3, b'a', b'b', 0, 0, 0, 0, 0, 5,
        b'j', b'p', b'e', b'g', 0, 0, 0, 0, 0, 0, 0, 2, 0xaa, 0xbb,
    ];
    let image: sensor_msgs::CompressedImage<'_> = decode(&big).unwrap();
    assert_eq!(image.header.stamp.to_ns(), 1_500_000_000);
    assert_eq!((&*image.header.frame_id, &*image.format), ("ab", "jpeg"));
    assert_eq!(image.data, [0xaa, 0xbb]);
    assert_eq!(image.data.as_ptr_range().end, big.as_ptr_range().end, "borrowed, not copied");
    assert!(matches!(image.format, std::borrow::Cow::Borrowed(_)));
}

#[test]
fn other_encodings_are_rejected_by_id() {
    type Header<'a> = std_msgs::Header<'a>;
    for id in [[0, 2], [0, 3], [0, 6], [0, 7], [1, 1], [0xff, 0xff]] {
        let mut bytes = HEADER;
        bytes[..2].copy_from_slice(&id);
        let error = decode::<Header<'_>>(&bytes).unwrap_err();
        assert!(matches!(error, CdrError::Encapsulation { id: found, .. } if found == id));
        assert!(error.to_string().contains(&format!("{:02x} {:02x}", id[0], id[1])), "{error}");
    }
    for length in 0..4 {
        let error = decode::<Header<'_>>(&HEADER[..length]).unwrap_err();
        assert!(matches!(error, CdrError::Header { actual, .. } if actual == length));
    }
}

#[test]
fn truncated_and_inconsistent_bytes_are_rejected_with_numbers() {
    type Header<'a> = std_msgs::Header<'a>;
    for length in 4..HEADER.len() {
        let error = decode::<Header<'_>>(&HEADER[..length]).unwrap_err();
        assert!(matches!(error, CdrError::Content { length: l, .. } if l == length), "{error}");
    }
    let mut too_long = HEADER;
    too_long[12..16].fill(0xff);
    assert_eq!(
        decode::<Header<'_>>(&too_long).unwrap_err().to_string(),
        "std_msgs/msg/Header: at byte 16 of 19: unexpected end of input"
    );
    let mut unterminated = HEADER;
    unterminated[18] = b'c';
    let error = decode::<Header<'_>>(&unterminated).unwrap_err().to_string();
    assert!(error.contains("string of 3 bytes does not end in NUL"), "{error}");
    let mut latin = HEADER;
    latin[16] = 0xe9;
    let error = decode::<Header<'_>>(&latin).unwrap_err().to_string();
    assert!(error.contains("UTF-8"), "{error}");
}

#[test]
fn padding_is_allowed_and_surplus_bytes_are_rejected() {
    let mut bytes = HEADER.to_vec();
    bytes.resize(HEADER.len() + 7, 0);
    assert!(decode::<std_msgs::Header<'_>>(&bytes).is_ok());
    bytes.push(0);
    let error = decode::<std_msgs::Header<'_>>(&bytes).unwrap_err();
    assert!(matches!(error, CdrError::Surplus { used: 19, length: 27, .. }), "{error}");
}

#[test]
fn a_stated_length_reserves_nothing() {
    /// Reads a sequence and returns its size hint.
    struct Promise(Option<usize>);
    impl<'de> Deserialize<'de> for Promise {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            struct Reader;
            impl<'de> Visitor<'de> for Reader {
                type Value = Promise;
                fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                    formatter.write_str("a sequence")
                }
                fn visit_seq<A: SeqAccess<'de>>(self, elements: A) -> Result<Promise, A::Error> {
                    Ok(Promise(elements.size_hint()))
                }
            }
            deserializer.deserialize_seq(Reader)
        }
    }
    impl Serialize for Promise {
        fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.serialize_unit()
        }
    }
    impl Message for Promise {
        const TYPE: &'static MessageType =
            &MessageType { name: "test_msgs/msg/Promise", text: "", dependencies: &[], hash: "" };
    }
    let promise: Promise = decode(&[0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff]).unwrap();
    assert_eq!(promise.0, None, "serde reserves by this hint");
}

#[test]
fn false_sequence_lengths_are_rejected() {
    let line = laser_profiler_msgs::Centerline {
        u: vec![1.0, 2.0, 3.0].into(),
        v: vec![1.0, 2.0, 3.0].into(),
        ..Default::default()
    };
    let mut bytes = Vec::new();
    encode(&line, &mut bytes).unwrap();
    let length_of_u = bytes.windows(4).position(|word| word == [3, 0, 0, 0]).unwrap();
    bytes[length_of_u..length_of_u + 4].fill(0xff);
    let error = decode::<laser_profiler_msgs::Centerline<'_>>(&bytes).unwrap_err();
    assert!(matches!(error, CdrError::Content { .. }), "{error}");

    let names = sensor_msgs::JointState { name: vec!["axis".into(); 3], ..Default::default() };
    encode(&names, &mut bytes).unwrap();
    let length_of_name = bytes.windows(4).position(|word| word == [3, 0, 0, 0]).unwrap();
    bytes[length_of_name..length_of_name + 4].fill(0xff);
    assert!(decode::<sensor_msgs::JointState<'_>>(&bytes).is_err());
}
