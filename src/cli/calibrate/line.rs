//! The stripe of a picture or of a whole recording, found by the node's own extraction.

use std::{collections::BTreeMap, fs, path::Path};

use anyhow::{Context, ensure};

use crate::statistics::central_median;
use crate::{
    cli::{
        recording::{Message, Recording, Wanted},
        settings::Settings,
    },
    msg::{convert::compressed, sensor_msgs::CompressedImage},
    scanner::{
        frame_index::FrameIndex,
        image::Frame,
        params::{Params, StripeDirection},
        pipeline::Pipeline,
        stripe::Centerline,
    },
};

/// Frames of a recording that are averaged; more change nothing.
const MAX_FRAMES: u64 = 200;

/// A stripe, and the picture it lies in.
pub(super) struct Line {
    /// (along, across) in pixels, ascending along the stripe: column and row, or row and column of a vertical stripe.
    pub(super) points: Vec<[f64; 2]>,
    /// Columns and rows of the picture.
    pub(super) size_px: (u32, u32),
    /// Which way it runs.
    pub(super) direction: StripeDirection,
    /// Pictures that went into it.
    pub(super) frames: u64,
}

/// Finds the stripe of a PNG or JPEG file, or of a recording: there the median over its frames.
///
/// # Errors
/// A file that is neither, no stripe, frames of different sizes.
pub(super) fn find(path: &Path, settings: &Settings) -> anyhow::Result<Line> {
    let is_picture = path.extension().is_some_and(|extension| {
        ["png", "jpg", "jpeg"].iter().any(|known| extension.eq_ignore_ascii_case(known))
    });
    let line = if is_picture { of_picture(path, settings) } else { of_recording(path, settings) };
    let line = line.with_context(|| path.display().to_string())?;
    ensure!(
        !line.points.is_empty(),
        "{}: no stripe was found (the parameters extraction.segment_threshold, channel and roi.* decide)",
        path.display()
    );
    Ok(line)
}

fn of_picture(path: &Path, settings: &Settings) -> anyhow::Result<Line> {
    let camera = settings.camera(&[])?;
    let bytes = fs::read(path)?;
    let format = if bytes.starts_with(b"\x89PNG") { "png" } else { "jpeg" };
    let message =
        CompressedImage { format: format.into(), data: &bytes, ..CompressedImage::default() };
    let mut pixels = Vec::new();
    let image = compressed::image(&message, camera.max_frame_bytes, &mut pixels)?;
    let mut collector = Collector::new(&camera.scanner);
    collector.take(&Frame { stamp_ns: 0, image })?;
    Ok(collector.line())
}

fn of_recording(path: &Path, settings: &Settings) -> anyhow::Result<Line> {
    let recording = Recording::open(path, settings)?;
    let mut collector = Collector::new(&recording.camera.scanner);
    recording.read(None, |message| {
        if let Message::Frame(frame) = message {
            collector.take(frame)?;
        }
        Ok(if collector.frames < MAX_FRAMES { Wanted::More } else { Wanted::Nothing })
    });
    Ok(collector.line())
}

/// Collects lines of one size.
struct Collector {
    pipeline: Pipeline,
    direction: StripeDirection,
    across: BTreeMap<u32, Vec<f32>>,
    size_px: (u32, u32),
    frames: u64,
}

impl Collector {
    fn new(params: &Params) -> Self {
        Self {
            pipeline: Pipeline::new(*params, None),
            direction: params.stripe_direction,
            across: BTreeMap::new(),
            size_px: (0, 0),
            frames: 0,
        }
    }

    fn take(&mut self, frame: &Frame<'_>) -> anyhow::Result<()> {
        let size_px = (frame.image.width(), frame.image.height());
        ensure!(
            self.frames == 0 || size_px == self.size_px,
            "a frame of {} x {} pixels among frames of {} x {}",
            size_px.0,
            size_px.1,
            self.size_px.0,
            self.size_px.1
        );
        let output = self.pipeline.process(frame, FrameIndex::default(), |_| {})?;
        for [along, across] in oriented(output.centerline, self.direction) {
            self.across.entry(along as u32).or_default().push(across);
        }
        self.size_px = size_px;
        self.frames += 1;
        Ok(())
    }

    fn line(self) -> Line {
        // What was seen in a few frames only is no stripe.
        let enough = (self.frames / 2).max(1) as usize;
        let seen = self.across.into_iter().filter(|(_, values)| values.len() >= enough);
        let points = seen
            .map(|(along, mut values)| [f64::from(along), central_median(&mut values)])
            .collect();
        Line { points, size_px: self.size_px, direction: self.direction, frames: self.frames }
    }
}

/// (along, across) of the first point in every cross-section.
fn oriented(line: &Centerline, direction: StripeDirection) -> impl Iterator<Item = [f32; 2]> {
    let (along, across) = match direction {
        StripeDirection::Horizontal => (&line.u_px, &line.v_px),
        StripeDirection::Vertical => (&line.v_px, &line.u_px),
    };
    let mut seen = std::collections::BTreeSet::new();
    along
        .iter()
        .zip(across)
        .filter_map(move |(&along, &across)| seen.insert(along as u32).then_some([along, across]))
}
