//! The stripe of a picture or recording, found by the node's own extraction.

use std::{fs, path::Path};

use anyhow::{Context, ensure};

use crate::{
    bag::pictures,
    calibrate::{GaugeStripe, MedianStripe},
    cli::{
        recording::{Message, Recording, Wanted},
        settings::Settings,
    },
    msg::convert::picture_message,
    scanner::image::Frame,
};

/// Frames of a recording that are averaged; more do not change the result.
const MAX_FRAMES: u64 = 200;

/// Finds the stripe of a picture file, or the median stripe over the frames of a recording, a folder of pictures or a video.
///
/// # Errors
/// A file of another kind, no stripe, or frames of different sizes.
pub(super) fn find(path: &Path, settings: &Settings) -> anyhow::Result<GaugeStripe> {
    let line = if pictures::is_picture(path) {
        of_picture(path, settings)
    } else {
        of_recording(path, settings)
    };
    let line = line.with_context(|| path.display().to_string())?;
    ensure!(
        !line.points.is_empty(),
        "{}: no stripe was found (the parameters extraction.segment_threshold, channel and roi.* decide)",
        path.display()
    );
    Ok(line)
}

fn of_picture(path: &Path, settings: &Settings) -> anyhow::Result<GaugeStripe> {
    let camera = settings.camera(&[])?;
    let bytes = fs::read(path)?;
    let mut pixels = Vec::new();
    let image = picture_message::decode(&bytes, camera.max_frame_bytes, &mut pixels)?;
    let mut collector = MedianStripe::new(&camera.scanner);
    collector.push(&Frame { stamp_ns: 0, image })?;
    Ok(collector.finish())
}

fn of_recording(path: &Path, settings: &Settings) -> anyhow::Result<GaugeStripe> {
    let recording = Recording::open(path, settings)?;
    let mut collector = MedianStripe::new(&recording.camera.scanner);
    recording.read(None, |message| {
        if let Message::Frame(frame) = message {
            collector.push(frame)?;
        }
        Ok(if collector.num_frames() < MAX_FRAMES { Wanted::More } else { Wanted::Nothing })
    });
    Ok(collector.finish())
}
