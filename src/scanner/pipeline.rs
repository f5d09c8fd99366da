//! The whole measurement on one screen: extract → triangulate → push, the ten steps of Yao et al. 2023
//! (doi 10.3390/app13179831).

use super::{
    ambient::{Ambient, AmbientError},
    calibration::{Calibration, Lines},
    channel::{Decoder, RoiError, window},
    coverage::share_above_threshold,
    exposure_pair::{ExposurePairs, Pairing},
    height_map::HeightMap,
    image::{Frame, OwnedImage},
    motion::Motion,
    params::{Exposure, Params},
    profile::Profile,
    scan::{Completed, Placed, Scan, Slice},
    stripe::{Centerline, Extractor},
};
use thiserror::Error;

/// Measures frame after frame. Owns all buffers: after the first frame of a size and the first two scans nothing is
/// allocated.
#[derive(Debug)]
pub struct Pipeline {
    params: Params,
    calibration: Option<Calibration>,
    decoder: Decoder,
    ambient: Ambient,
    extractor: Extractor,
    /// When short and long exposures alternate.
    pairs: Option<ExposurePairs>,
    centerline: Centerline,
    profile: Profile,
    motion: Motion,
    scan: Scan,
    is_scanning: bool,
}

impl Pipeline {
    /// A pipeline for these parameters; without a calibration it gives centrelines only.
    pub fn new(params: Params, calibration: Option<Calibration>) -> Self {
        let seed = calibration.as_ref().map(Calibration::id).unwrap_or_default();
        Self {
            decoder: Decoder::default(),
            ambient: Ambient::default(),
            extractor: Extractor::new(params.extraction, params.stripe_direction),
            pairs: pairs(&params),
            centerline: Centerline::default(),
            profile: Profile::default(),
            motion: Motion::new(params.motion),
            scan: Scan::new(params.scan_limits(), seed),
            is_scanning: true,
            params,
            calibration,
        }
    }

    /// The same with a frame without laser, which `background: reference` takes off.
    #[must_use]
    pub fn with_ambient(self, image: Option<OwnedImage>) -> Self {
        Self { ambient: Ambient::new(image), ..self }
    }

    /// Measures one frame. `on_stage` hears of the end of every stage, so that somebody with a clock can time them.
    ///
    /// # Errors
    /// A frame that the parameters do not fit; the pipeline goes on with the next one as if it had never come.
    pub fn process(
        &mut self,
        frame: &Frame<'_>,
        index: FrameIndex,
        mut on_stage: impl FnMut(Stage),
    ) -> Result<Output<'_>, FrameError> {
        let Frame { stamp_ns, image } = *frame;
        let full_scale = self.params.full_scale_of(image.format())?;
        self.check_size(image.width(), image.height())?;
        // Step 1: crop.
        let searched = window(self.params.roi, image.width(), image.height())?;
        self.ambient.prepare(&image, &searched, &self.params, &mut self.extractor)?;

        // Step 2: one grey level a pixel.
        let plane = self.decoder.decode(&image, self.params.channel, &searched);
        on_stage(Stage::Decode);

        // A line is a small part of the image.
        let share_above_threshold =
            share_above_threshold(&plane, &self.params.extraction, full_scale);

        // Steps 3 to 8: blur, segment, coarse peak, width, window, centre.
        self.extractor.extract(&plane, (searched.x, searched.y), full_scale, &mut self.centerline);
        let image_px = (image.width(), image.height());
        // Alternating exposures: what this frame lacks, the frame before has.
        let pairs = self.pairs.as_mut();
        let pairing = pairs.map(|pairs| pairs.merge(&mut self.centerline, index, image_px));
        on_stage(Stage::Extract);

        let position_m = self.motion.position_m(index.frame_number, stamp_ns);
        let completed = match &self.calibration {
            Some(calibration) => {
                let lines = Lines::new(self.params.stripe_direction, &searched);
                // Step 9: metres.
                calibration.triangulate(&self.centerline, &lines, full_scale, &mut self.profile);
                let placed =
                    Placed { profile: &self.profile, image_px, stamp_ns, position_m, index };
                // Step 10: stacked along the motion.
                if self.is_scanning { self.scan.push(&placed) } else { Completed::default() }
            }
            None => Completed::default(),
        };
        on_stage(Stage::Triangulate);

        Ok(Output {
            centerline: &self.centerline,
            pairing,
            share_above_threshold,
            position_m,
            profile: self.calibration.is_some().then_some(&self.profile),
            slice: completed.slice,
            height_map: completed.height_map,
        })
    }

    /// Images of another size than those of the calibration would be measured at the wrong place.
    fn check_size(&self, width: u32, height: u32) -> Result<(), FrameError> {
        let calibrated = self.calibration.as_ref().and_then(Calibration::image_size_px);
        match calibrated {
            Some(calibrated) if calibrated != (width, height) => {
                Err(FrameError::Size { image: (width, height), calibrated })
            }
            _ => Ok(()),
        }
    }

    /// Ends the scan: its last slice and its height map. Of the frames after the last good one, `frames_missing` never
    /// arrived and `frames_rejected` were refused. The next frame lies at position 0 again.
    pub fn finish(&mut self, frames_missing: u32, frames_rejected: u32) -> Completed<'_> {
        self.restart();
        self.scan.finish(frames_missing, frames_rejected)
    }

    /// Throws the open scan away. The next frame lies at position 0 again.
    pub fn discard(&mut self) {
        self.restart();
        self.scan.discard();
    }

    /// What comes does not go on from what came: not its positions, and not its exposures.
    fn restart(&mut self) {
        self.motion.restart();
        self.extractor.reset();
        if let Some(pairs) = &mut self.pairs {
            pairs.restart();
        }
    }

    /// Whether frames give profiles.
    pub const fn is_calibrated(&self) -> bool {
        self.calibration.is_some()
    }

    /// Gives the scan that begins next this identity, instead of one made from its first frame.
    pub const fn set_next_scan_id(&mut self, scan_id: Option<[u8; 16]>) {
        self.scan.set_next_id(scan_id);
    }

    /// Stacks profiles, as from the beginning.
    pub const fn start_scanning(&mut self) {
        self.is_scanning = true;
    }

    /// Stacks no profiles: [`finish`](Self::finish) the scan first.
    pub const fn stop_scanning(&mut self) {
        self.is_scanning = false;
        self.scan.set_next_id(None);
    }

    /// Identity of the open scan; `None` before its first profile.
    pub fn scan_id(&self) -> Option<[u8; 16]> {
        self.scan.open_id()
    }

    /// Whether the open scan cannot go on under these parameters: its positions or its geometry would change in it.
    pub fn must_end_for(&self, params: &Params) -> bool {
        let Params { motion, stripe_direction, roi, .. } = self.params;
        motion != params.motion || stripe_direction != params.stripe_direction || roi != params.roi
    }

    /// Measures with this calibration from the next frame on. The scan was finished before.
    pub fn recalibrate(&mut self, calibration: Calibration) {
        self.calibration = Some(calibration);
    }

    /// Measures by these parameters from the next frame on. Where [`must_end_for`](Self::must_end_for) says so, the scan
    /// was finished before.
    pub fn reconfigure(&mut self, params: Params) {
        if self.params.motion != params.motion {
            self.motion = Motion::new(params.motion);
        }
        self.extractor = Extractor::new(params.extraction, params.stripe_direction);
        self.ambient.forget();
        self.pairs = pairs(&params);
        self.scan.set_limits(params.scan_limits());
        self.params = params;
    }
}

fn pairs(params: &Params) -> Option<ExposurePairs> {
    (params.exposure == Exposure::Alternating).then(|| ExposurePairs::new(params.stripe_direction))
}

/// What is known about a frame besides its picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameIndex {
    /// Frame counter, 64 bit, gaps included.
    pub frame_number: u64,
    /// Frames known to be missing directly before this one.
    pub frames_missing: u32,
    /// Frames that arrived directly before this one and were refused.
    pub frames_rejected: u32,
}

/// End of a stage, told to the observer of [`Pipeline::process`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The samples are one channel of numbers.
    Decode,
    /// The centreline is known.
    Extract,
    /// The profile is metric and lies in the scan.
    Triangulate,
}

/// What one frame gave. Borrowed from the pipeline, valid until the next frame.
#[derive(Clone, Copy, Debug)]
pub struct Output<'a> {
    /// The centreline, perhaps without points.
    pub centerline: &'a Centerline,
    /// How it was made of two exposures, when those alternate.
    pub pairing: Option<Pairing>,
    /// Share of the searched pixels above a fixed segment threshold, from 0 to 1: above [`LARGEST_SHARE`] the threshold is
    /// too low for the scene. `None` where the threshold follows the scene.
    ///
    /// [`LARGEST_SHARE`]: super::coverage::LARGEST_SHARE
    pub share_above_threshold: Option<f64>,
    /// Position along the scan, metres.
    pub position_m: f64,
    /// The metric profile, when calibrated.
    pub profile: Option<&'a Profile>,
    /// The slice before this frame's, when it is complete.
    pub slice: Option<&'a Slice>,
    /// The height map of the scan that ended before this frame.
    pub height_map: Option<&'a HeightMap>,
}

/// Why a frame cannot be measured with these parameters.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FrameError {
    /// The region of interest does not fit.
    #[error(transparent)]
    Roi(#[from] RoiError),
    /// The frame without laser does not fit.
    #[error(transparent)]
    Ambient(#[from] AmbientError),
    /// The image is not of the calibrated size.
    #[error(
        "the image has {} x {} pixels, the calibration is of {} x {}: calibrate at this size, or state binning and roi \
         in camera_info", .image.0, .image.1, .calibrated.0, .calibrated.1
    )]
    Size {
        /// Columns and rows of the image.
        image: (u32, u32),
        /// Columns and rows of the calibrated images.
        calibrated: (u32, u32),
    },
    /// Saturation above what the image can hold.
    #[error("full_scale is {full_scale}, but samples of this encoding end at {max_level}")]
    FullScale {
        /// The parameter.
        full_scale: u32,
        /// Largest level of the encoding.
        max_level: u32,
    },
}
