//! The path of one frame through the worker: decode, check, measure, publish, count in exactly one bin.

use std::time::Instant;

use super::{
    Worker, WorkerOptions,
    ledger::Rejection,
    measurer::{Job, Outcome},
};
use crate::{
    bag::RawMessage,
    msg::{
        cdr,
        convert::{compressed, frame},
        sensor_msgs::{CompressedImage, Image},
        std_msgs::Header,
    },
    node::{
        camera_info::ImageHeader,
        order::StampStep,
        publisher::{PublishError, Publisher},
        sink::Purpose,
        unpack::Picture,
    },
    ros::node_params::ImageTransport,
    scanner::image,
};

/// The reason that a frame gave no results.
pub(super) enum NotMeasured {
    /// The frame is rejected; the stream continues.
    Rejected(Rejection),
    /// Nothing more can be published.
    Unpublished(PublishError),
}

impl From<PublishError> for NotMeasured {
    fn from(error: PublishError) -> Self {
        Self::Unpublished(error)
    }
}

impl From<Rejection> for NotMeasured {
    fn from(reason: Rejection) -> Self {
        Self::Rejected(reason)
    }
}

/// A decoded image message.
struct Decoded<'a> {
    started: Instant,
    header: Header<'a>,
    image: image::Image<'a>,
}

impl Worker {
    pub(super) fn take(
        &mut self,
        message: &RawMessage,
        picture: Option<&Picture>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.last_time_ns = message.log_time_ns;
        self.ledger.count_received();
        if self.options.sends_images {
            out.forward(message, 0)?;
        }
        match self.measure(message, picture, out) {
            Ok(outcome) => {
                self.ledger.count_processed(&outcome);
                self.standing.note_profile(&outcome, &self.measurer.pipeline);
                self.note_scanned(&outcome);
                if let Some(online) = &mut self.online {
                    self.ledger.count_not_of_now(online.note_latency(outcome.stamp_ns));
                }
            }
            Err(NotMeasured::Rejected(reason)) => {
                self.ledger.reject(&reason, message.log_time_ns, message.file.as_deref());
            }
            Err(NotMeasured::Unpublished(error)) => return Err(error),
        }
        self.ledger.set_unpublished(out.num_dropped(Purpose::Publish));
        // On a network, the recorder has counters of its own, and reports are also due without frames: see `tick`.
        if self.online.is_some() {
            return self.end_at_limit(out);
        }
        self.ledger.set_recorded(out.num_bytes(), out.num_dropped(Purpose::Record));
        match self.schedule.poll(message.log_time_ns, self.ledger.counts()) {
            Some(interval) => self.report(message.log_time_ns, interval, out),
            None => Ok(()),
        }
    }

    /// Decodes a message and measures its image.
    fn measure(
        &mut self,
        message: &RawMessage,
        picture: Option<&Picture>,
        out: &mut Publisher<'_>,
    ) -> Result<Outcome, NotMeasured> {
        let (now, unpacking) = (Instant::now(), picture.map(Picture::took).unwrap_or_default());
        let started = now.checked_sub(unpacking).unwrap_or(now);
        let mut pixels = std::mem::take(&mut self.measurer.pixels);
        let decoded = match picture {
            Some(picture) => unpacked(message, picture),
            None => decode(message, &self.options, &mut pixels),
        };
        let measured = match decoded {
            Ok((header, image)) => {
                self.measure_image(&Decoded { started, header, image }, message, out)
            }
            Err(rejection) => {
                self.ledger.place(message.sequence);
                Err(rejection.into())
            }
        };
        self.measurer.pixels = pixels;
        measured
    }

    fn measure_image(
        &mut self,
        decoded: &Decoded<'_>,
        message: &RawMessage,
        out: &mut Publisher<'_>,
    ) -> Result<Outcome, NotMeasured> {
        let &Decoded { started, ref header, image } = decoded;
        let stamp_ns = header.stamp.to_ns();
        match self.ledger.check_stamp(stamp_ns, message.sequence)? {
            StampStep::Forward => {}
            StampStep::ClockSetBack => {
                tracing::warn!(
                    "the camera's clock was set back to {stamp_ns} ns: starting a new scan"
                );
                self.end_scan(out)?;
            }
            StampStep::BeginsAgain => self.begin_again(stamp_ns, out)?,
        }
        let (width, height) = (image.width(), image.height());
        let of_image = ImageHeader { stamp_ns, frame_id: &header.frame_id, width, height };
        let camera = match &mut self.online {
            Some(online) => online.observe(&of_image),
            None => self.framing.pair(&of_image),
        };
        let calibrated = self.apply_camera_info(camera, out);
        // A frame of another camera takes its place in the sequence, too.
        let place = self.ledger.place(message.sequence);
        calibrated?;
        let (index, time_ns) = (self.ledger.index(place), message.log_time_ns);
        self.measurer.measure(&Job { started, header, image, place, index, time_ns }, out)
    }
}

/// Returns the image of a message that was decompressed ahead.
fn unpacked<'a>(
    message: &'a RawMessage,
    picture: &'a Picture,
) -> Result<(Header<'a>, image::Image<'a>), Rejection> {
    let message: CompressedImage<'_> = cdr::decode(&message.data)?;
    Ok((message.header, picture.image()?))
}

fn decode<'a>(
    message: &'a RawMessage,
    options: &WorkerOptions,
    pixels: &'a mut Vec<u8>,
) -> Result<(Header<'a>, image::Image<'a>), Rejection> {
    match options.transport {
        ImageTransport::Raw => {
            let message: Image<'_> = cdr::decode(&message.data)?;
            let image = frame::image(&message, options.max_frame_bytes)?;
            Ok((message.header, image))
        }
        ImageTransport::Compressed => {
            let message: CompressedImage<'_> = cdr::decode(&message.data)?;
            let image = compressed::image(&message, options.max_frame_bytes, pixels)?;
            Ok((message.header, image))
        }
    }
}
