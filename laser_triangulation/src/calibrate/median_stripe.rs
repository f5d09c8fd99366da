//! The median of a stripe over frames of the same scene.

use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use crate::{
    scanner::{
        frame_error::FrameError,
        frame_index::FrameIndex,
        image::Frame,
        params::{Params, StripeDirection},
        pipeline::Pipeline,
        stripe::Centerline,
    },
    statistics::central_median,
};

/// A stripe and the size of its image.
#[derive(Clone, Debug, PartialEq)]
pub struct GaugeStripe {
    /// (along, across) in pixels, ascending along the stripe: column and row, or row and column for a vertical stripe.
    pub points: Vec<[f64; 2]>,
    /// Size and direction of the image.
    pub picture: GaugePicture,
    /// Number of frames used.
    pub frames: u64,
}

/// Format of an image of a gauge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GaugePicture {
    /// Columns and rows.
    pub size_px: [u32; 2],
    /// Direction in which the stripe runs.
    pub direction: StripeDirection,
}

impl GaugePicture {
    /// Returns the middle of the picture along the stripe, pixels.
    #[must_use]
    pub(crate) fn middle_px(&self) -> f64 {
        let [width, height] = self.size_px;
        let length = match self.direction {
            StripeDirection::Horizontal => width,
            StripeDirection::Vertical => height,
        };
        0.5 * (f64::from(length) - 1.0)
    }
}

/// The reason why a frame does not match the others, or cannot be measured.
#[derive(Debug, Error)]
pub enum MedianStripeError {
    /// Frames of different sizes.
    #[error(
        "a frame of {} x {} pixels among frames of {} x {}",
        .found[0], .found[1], .expected[0], .expected[1]
    )]
    Size {
        /// Columns and rows of this frame.
        found: [u32; 2],
        /// Columns and rows of the frames before.
        expected: [u32; 2],
    },
    /// The frame cannot be measured.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// Collects the stripe of frames of one size.
#[derive(Debug)]
pub struct MedianStripe {
    pipeline: Pipeline,
    direction: StripeDirection,
    across: BTreeMap<u32, Vec<f32>>,
    size_px: [u32; 2],
    frames: u64,
}

impl MedianStripe {
    /// Starts without frames.
    #[must_use]
    pub fn new(params: &Params) -> Self {
        Self {
            pipeline: Pipeline::new(*params, None),
            direction: params.stripe_direction,
            across: BTreeMap::new(),
            size_px: [0, 0],
            frames: 0,
        }
    }

    /// Returns the number of frames so far.
    #[must_use]
    pub const fn num_frames(&self) -> u64 {
        self.frames
    }

    /// Extracts the stripe of a frame.
    ///
    /// # Errors
    /// A frame of another size than the first, or one that the pipeline rejects.
    pub fn push(&mut self, frame: &Frame<'_>) -> Result<(), MedianStripeError> {
        let found = [frame.image.width(), frame.image.height()];
        if self.frames > 0 && found != self.size_px {
            return Err(MedianStripeError::Size { found, expected: self.size_px });
        }
        let output = self.pipeline.process(frame, FrameIndex::default(), |_| {})?;
        for [along, across] in oriented(output.centerline, self.direction) {
            self.across.entry(along as u32).or_default().push(across);
        }
        self.size_px = found;
        self.frames += 1;
        Ok(())
    }

    /// Returns the median in every cross-section that at least half of the frames show.
    #[must_use]
    pub fn finish(self) -> GaugeStripe {
        let enough = (self.frames / 2).max(1) as usize;
        let seen = self.across.into_iter().filter(|(_, values)| values.len() >= enough);
        let points = seen
            .map(|(along, mut values)| [f64::from(along), central_median(&mut values)])
            .collect();
        let Self { size_px, direction, frames, .. } = self;
        GaugeStripe { points, picture: GaugePicture { size_px, direction }, frames }
    }
}

/// Returns (along, across) of the first point in every cross-section.
fn oriented(line: &Centerline, direction: StripeDirection) -> impl Iterator<Item = [f32; 2]> {
    let (along, across) = line.along_and_across(direction);
    let mut seen = BTreeSet::new();
    along
        .iter()
        .zip(across)
        .filter_map(move |(&along, &across)| seen.insert(along as u32).then_some([along, across]))
}
