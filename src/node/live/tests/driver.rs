//! A camera driver on the loopback.

use crate::{
    msg::{builtin_interfaces::Time, cdr, schema::Message, sensor_msgs::Image, std_msgs::Header},
    ros::{
        loopback::Loopback,
        transport::{Arrival, Fault},
    },
};

/// 2020-01-01, so that times have a realistic magnitude.
pub(super) const START_NS: i64 = 1_577_836_800_000_000_000;
pub(super) const MS: i64 = 1_000_000;

/// An image with a stripe.
#[derive(Clone, Copy)]
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) row: u32,
    pub(super) encoding: &'static str,
}

impl Default for Picture {
    fn default() -> Self {
        Self { width: 64, height: 32, row: 10, encoding: "mono8" }
    }
}

impl Picture {
    /// Returns the image as a message.
    pub(super) fn message(&self, stamp_ns: i64) -> Vec<u8> {
        let level = |row: u32| match row.abs_diff(self.row) {
            0 => 200,
            1 => 160,
            2 => 90,
            _ => 5,
        };
        let num_channels = if self.encoding == "rgb8" { 3 } else { 1 };
        let step = self.width * num_channels;
        let pixels: Vec<u8> =
            (0..self.height).flat_map(|row| vec![level(row); step as usize]).collect();
        let image = Image {
            header: Header { stamp: Time::from_ns(stamp_ns), frame_id: "optical".into() },
            height: self.height,
            width: self.width,
            encoding: self.encoding.into(),
            is_bigendian: 0,
            step,
            data: &pixels,
        };
        encoded(&image)
    }
}

pub(super) fn encoded(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes).unwrap();
    bytes
}

/// A camera driver.
pub(super) struct TestCamera {
    pub(super) network: Loopback,
    pub(super) topic: String,
    pub(super) picture: Picture,
    pub(super) publisher: [u8; 16],
    pub(super) sequence: i64,
    /// Time of the last frame, after the start.
    pub(super) at_ms: i64,
}

impl TestCamera {
    /// Sends the next frame, 10 ms after the previous one.
    pub(super) fn shoot(&mut self) {
        self.at_ms += 10;
        self.sequence += 1;
        self.send(self.picture.message(START_NS + self.at_ms * MS));
    }

    pub(super) fn shoot_times(&mut self, num: usize) {
        (0..num).for_each(|_| self.shoot());
    }

    /// Sends any bytes as a frame.
    pub(super) fn send(&self, data: Vec<u8>) {
        self.deliver(&Ok(Arrival {
            data,
            publisher: self.publisher,
            sequence: Some(self.sequence),
            source_time_ns: START_NS + self.at_ms * MS,
            receive_time_ns: START_NS + self.at_ms * MS + 1,
        }));
    }

    pub(super) fn deliver(&self, arrival: &Result<Arrival, Fault>) {
        self.network.deliver(&self.topic, arrival);
    }
}
