//! The stripe of a picture or recording, found by the node's own extraction.

use std::{fs, path::Path};

use anyhow::{Context, bail};

use crate::{
    bag::pictures,
    calibrate::{GaugeStripe, MedianStripe},
    cli::{
        recording::{Message, Recording, Wanted},
        settings::Settings,
    },
    msg::convert::picture_message,
    scanner::{
        frame_index::FrameIndex,
        image::{Frame, OwnedImage},
        params::{Params, StripeDirection},
        pipeline::Pipeline,
    },
};

/// Frames of a recording that are averaged; more do not change the result.
const MAX_FRAMES: u64 = 200;

/// A stripe in a smaller share of the lines may be a chance find.
const SHORT: f64 = 0.25;

/// Finds the stripe of a picture file, or the median stripe over the frames of a recording, a folder of pictures or a video.
///
/// # Errors
/// A file of another kind, no stripe, a stripe in the other direction, or frames of different sizes.
pub(super) fn find(path: &Path, settings: &Settings) -> anyhow::Result<GaugeStripe> {
    let line = if pictures::is_picture(path) {
        of_picture(path, settings)
    } else {
        of_recording(path, settings)
    };
    line.with_context(|| path.display().to_string())
}

/// Refuses a stripe that is missing, or of which chance points were found because it runs in the other direction. `first` is
/// the first frame.
fn checked(stripe: GaugeStripe, first: &Frame<'_>, params: &Params) -> anyhow::Result<GaugeStripe> {
    let num = stripe.points.len();
    let [width, height] = stripe.picture.size_px;
    let length = match stripe.picture.direction {
        StripeDirection::Horizontal => width,
        StripeDirection::Vertical => height,
    };
    if num as f64 > SHORT * f64::from(length) {
        return Ok(stripe);
    }
    let mut pipeline = Pipeline::new(*params, None);
    pipeline.process(first, FrameIndex::default(), |_| ())?;
    let diagnosis = pipeline.explain(&first.image);
    if num == 0 {
        bail!("no stripe was found: {diagnosis}");
    }
    if diagnosis.turned.is_some() {
        bail!("the stripe has {num} points: {diagnosis}");
    }
    Ok(stripe)
}

fn of_picture(path: &Path, settings: &Settings) -> anyhow::Result<GaugeStripe> {
    let camera = settings.camera(&[])?;
    let bytes = fs::read(path)?;
    let mut pixels = Vec::new();
    let image = picture_message::decode(&bytes, camera.max_frame_bytes, &mut pixels)?;
    let mut collector = MedianStripe::new(&camera.scanner);
    let frame = Frame { stamp_ns: 0, image };
    collector.push(&frame)?;
    checked(collector.finish(), &frame, &camera.scanner)
}

fn of_recording(path: &Path, settings: &Settings) -> anyhow::Result<GaugeStripe> {
    let recording = Recording::open(path, settings)?;
    let params = &recording.camera.scanner;
    let mut collector = MedianStripe::new(params);
    let mut first = None;
    recording.read(None, |message| {
        if let Message::Frame(frame) = message {
            collector.push(frame)?;
            first.get_or_insert_with(|| OwnedImage::from(&frame.image));
        }
        Ok(if collector.num_frames() < MAX_FRAMES { Wanted::More } else { Wanted::Nothing })
    });
    let first = first.context("no frame can be measured")?;
    checked(collector.finish(), &Frame { stamp_ns: 0, image: first.view() }, params)
}
