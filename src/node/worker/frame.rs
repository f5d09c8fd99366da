//! One frame's way through the worker: decoded, judged, measured, published, counted in exactly one bin.

use std::time::Instant;

use thiserror::Error;

use super::{Pending, Worker, WorkerOptions};
use crate::{
    bag::RawMessage,
    msg::{
        cdr::{self, CdrError},
        convert::{FrameRejected, compressed, frame},
        sensor_msgs::{CompressedImage, Image},
        std_msgs::Header,
    },
    node::{
        camera_info::{Conflict, ImageHeader},
        order::{Place, StampFault, StampStep},
        publisher::{Halt, Publisher},
        results::Measured,
        sink::Purpose,
        statistics::{Counts, StageTimes},
        unpack::Picture,
    },
    ros::node_params::ImageTransport,
    scanner::{
        coverage::LARGEST_SHARE,
        exposure_pair::ExposurePairing,
        image,
        pipeline::{FrameError, FrameIndex, Stage},
    },
};

/// Why a frame was refused.
#[derive(Debug, Error)]
enum Rejection {
    #[error("malformed: {0}")]
    Message(#[from] CdrError),
    #[error("malformed: {0}")]
    Image(#[from] FrameRejected),
    #[error("malformed: {0}")]
    Params(#[from] FrameError),
    #[error("malformed: {0}")]
    CameraInfo(#[from] Conflict),
    #[error("malformed: {0}")]
    Transport(String),
    #[error("its stamp is that of the frame before")]
    Duplicate,
    #[error("its stamp lies before that of an earlier frame")]
    OutOfOrder,
}

impl Worker {
    /// Counts frames that a full queue has dropped before the next one.
    pub(super) fn take_dropped(&mut self, num_dropped: u32) {
        self.counts.received += u64::from(num_dropped);
        self.counts.dropped_overload += u64::from(num_dropped);
        self.pending.rejected = self.pending.rejected.saturating_add(num_dropped);
        self.sequence.skip(num_dropped);
    }

    pub(super) fn take(
        &mut self,
        message: &RawMessage,
        picture: Option<&Picture>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        self.last_time_ns = message.log_time_ns;
        self.counts.received += 1;
        if self.options.sends_images {
            out.forward(message, 0)?;
        }
        match self.measure(message, picture, out)? {
            Ok(()) => self.counts.processed += 1,
            Err(rejection) => self.reject(&rejection, message.log_time_ns),
        }
        self.counts.unpublished = out.num_dropped(Purpose::Publish);
        // Live, the recorder knows itself what it has, and time passes without frames, too: see `tick`.
        if self.live.is_some() {
            return self.end_at_length(out);
        }
        self.counts.recorder_bytes = out.num_bytes();
        self.counts.recorder_dropped = out.num_dropped(Purpose::Record);
        match self.schedule.poll(message.log_time_ns, &self.counts) {
            Some(interval) => self.report(message.log_time_ns, interval, out),
            None => Ok(()),
        }
    }

    /// Counts a message that the middleware could not hand on.
    pub(super) fn take_fault(&mut self, what: &str) {
        self.counts.received += 1;
        // It has a number of its own that nobody saw.
        self.sequence.skip(1);
        self.reject(&Rejection::Transport(what.to_owned()), self.last_time_ns);
    }

    /// Outer result: whether to go on at all; inner one: whether this frame was good.
    fn measure(
        &mut self,
        message: &RawMessage,
        picture: Option<&Picture>,
        out: &mut Publisher<'_>,
    ) -> Result<Result<(), Rejection>, Halt> {
        let (now, unpacking) = (Instant::now(), picture.map(Picture::took).unwrap_or_default());
        let started = now.checked_sub(unpacking).unwrap_or(now);
        let mut pixels = std::mem::take(&mut self.pixels);
        let decoded = match picture {
            Some(picture) => unpacked(message, picture),
            None => decode(message, &self.options, &mut pixels),
        };
        let measured = match decoded {
            Ok((header, image)) => self.measure_image(started, (&header, image), message, out),
            Err(rejection) => {
                self.place(message.sequence);
                Ok(Err(rejection))
            }
        };
        self.pixels = pixels;
        measured
    }

    fn measure_image(
        &mut self,
        started: Instant,
        (header, image): (&Header<'_>, image::Image<'_>),
        message: &RawMessage,
        out: &mut Publisher<'_>,
    ) -> Result<Result<(), Rejection>, Halt> {
        let stamp_ns = header.stamp.to_ns();
        match self.stamps.take(stamp_ns) {
            Ok(StampStep::Forward) => {}
            Ok(StampStep::ClockSetBack) => {
                tracing::warn!(
                    "the camera's clock was set back to {stamp_ns} ns: a new scan begins"
                );
                self.end_scan(out)?;
            }
            Err(fault) => {
                let missing = self.sequence.take_repeated(message.sequence);
                self.miss(missing);
                return Ok(Err(match fault {
                    StampFault::Duplicate => Rejection::Duplicate,
                    StampFault::OutOfOrder => Rejection::OutOfOrder,
                }));
            }
        }
        let (width, height) = (image.width(), image.height());
        let of_image = ImageHeader { stamp_ns, frame_id: &header.frame_id, width, height };
        let pairing = match &mut self.live {
            Some(live) => live.observe(&of_image),
            None => self.framing.pair(&of_image),
        };
        let framed = self.frame_by(pairing, out)?;
        let place = self.place(message.sequence);
        if let Err(conflict) = framed {
            return Ok(Err(conflict.into()));
        }
        let index = FrameIndex {
            frame_number: place.frame_number,
            frames_missing: self.pending.missing,
            frames_rejected: self.pending.rejected,
        };

        let position = self.locate(place.frame_number, (stamp_ns, message.log_time_ns));
        let mut clock = StageClock { last: started, stages: &mut self.stages };
        let frame = image::Frame { stamp_ns, image };
        let on_stage = |stage| clock.tick(stage);
        let output = match self.pipeline.process_at(&frame, index, position, on_stage) {
            Ok(output) => output,
            Err(error) => return Ok(Err(error.into())),
        };
        self.pending = Pending::default();
        self.travelled = output.travelled;
        let position = output.position;
        self.counts.points += output.centerline.len() as u64;
        self.counts.slices += u64::from(output.slice.is_some());
        self.counts.unpaired += u64::from(is_unpaired(output.pairing));
        count_flooded(output.share_above_threshold, &mut self.counts);
        let time_ns = message.log_time_ns;
        self.results
            .publish_frame(&Measured { header, image, place, index, output, time_ns }, out)?;
        self.count_position(stamp_ns, position);
        self.stages.encode.record(out.take_encoding_time());
        if let Some(live) = &mut self.live {
            live.note_latency(stamp_ns);
        }
        Ok(Ok(()))
    }

    /// The place of the next frame, with all that is missing since the last good one.
    fn place(&mut self, sequence: u32) -> Place {
        let place = self.sequence.take(sequence);
        self.miss(place.missing.unwrap_or(0));
        self.pending.is_unknown |= place.missing.is_none();
        Place { missing: (!self.pending.is_unknown).then_some(self.pending.missing), ..place }
    }

    fn miss(&mut self, missing: u32) {
        self.counts.lost_transport += u64::from(missing);
        self.pending.missing = self.pending.missing.saturating_add(missing);
    }

    fn reject(&mut self, rejection: &Rejection, time_ns: i64) {
        let count = match rejection {
            Rejection::Duplicate => &mut self.counts.duplicate,
            Rejection::OutOfOrder => &mut self.counts.out_of_order,
            _ => &mut self.counts.malformed,
        };
        *count += 1;
        self.pending.rejected = self.pending.rejected.saturating_add(1);
        self.last_rejection = Some(rejection.to_string());
        // One of a kind is enough to act on; the summary counts the rest.
        if *count == 1 {
            tracing::warn!(
                "frame rejected (log time {time_ns} ns): {rejection}; further ones of this kind are only counted"
            );
        } else {
            tracing::debug!("frame rejected (log time {time_ns} ns): {rejection}");
        }
    }
}

/// Whether a frame lacks its other exposure. Tells why, when the scene or the parameters are to blame.
fn is_unpaired(pairing: Option<ExposurePairing>) -> bool {
    if pairing == Some(ExposurePairing::Alike) {
        tracing::debug!("exposures alternate, but this frame is as bright as the one before it");
    }
    matches!(pairing, Some(ExposurePairing::Alone | ExposurePairing::Alike))
}

/// Counts a frame of which too much is above the threshold for a line, and says so once.
fn count_flooded(share_above_threshold: Option<f64>, counts: &mut Counts) {
    let Some(share) = share_above_threshold.filter(|share| *share > LARGEST_SHARE) else { return };
    counts.flooded += 1;
    if counts.flooded == 1 {
        tracing::warn!(
            "{:.0} % of the searched pixels are above extraction.segment_threshold, which is no line: raise it, or set \
             extraction.background: local and extraction.threshold: adaptive; further frames like this are only counted",
            100.0 * share
        );
    }
}

/// Writes down how long each stage took.
struct StageClock<'a> {
    last: Instant,
    stages: &'a mut StageTimes,
}

impl StageClock<'_> {
    fn tick(&mut self, stage: Stage) {
        let now = Instant::now();
        let histogram = match stage {
            Stage::Decode => &mut self.stages.decode,
            Stage::Extract => &mut self.stages.extract,
            Stage::Triangulate => &mut self.stages.triangulate,
        };
        histogram.record(now - self.last);
        self.last = now;
    }
}

/// The image of a message that was unpacked before.
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
