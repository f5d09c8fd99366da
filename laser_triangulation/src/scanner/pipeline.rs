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
    motion::{Motion, Position, doubt, placement::Placement, travel::Travel},
    params::{Exposure, FullScaleError, Params},
    profile::Profile,
    scan::{Completed, Placed, Scan, Slice},
    stripe::{Centerline, Extractor},
};
use nalgebra::Isometry3;
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
    travel: Travel,
    placement: Placement,
    /// Frames before the next profile of the scan that are not in it: missing, and refused or without a position.
    left_out: (u32, u32),
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
            travel: travel(&params),
            placement: placement(calibration.as_ref(), &params),
            left_out: (0, 0),
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

    /// The same, where poses that are measured ([`Position::part_from_sensor`]) are the laser plane's, not the camera's.
    #[must_use]
    pub fn with_laser_tracked(self) -> Self {
        Self { placement: self.placement.with_laser_tracked(), ..self }
    }

    /// Measures one frame at the position that the parameters say. `on_stage` hears of the end of every stage, so that
    /// somebody with a clock can time them.
    ///
    /// # Errors
    /// A frame that the parameters do not fit; the pipeline goes on with the next one as if it had never come.
    pub fn process(
        &mut self,
        frame: &Frame<'_>,
        index: FrameIndex,
        on_stage: impl FnMut(Stage),
    ) -> Result<Output<'_>, FrameError> {
        let position = self.expected_position(index.frame_number, frame.stamp_ns);
        self.process_at(frame, index, position, on_stage)
    }

    /// Where the parameters say that a frame was taken; `None`: they say that it is measured.
    pub fn expected_position(&mut self, frame_number: u64, stamp_ns: i64) -> Option<Position> {
        self.motion.position(frame_number, stamp_ns)
    }

    /// Measures one frame that was taken at `position`. One whose position nobody knows gives a profile, but is not in the
    /// scan.
    ///
    /// # Errors
    /// As [`process`](Self::process).
    pub fn process_at(
        &mut self,
        frame: &Frame<'_>,
        index: FrameIndex,
        position: Option<Position>,
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

        let placed = position.map(|position| self.place(position));
        let completed = match &self.calibration {
            Some(calibration) => {
                let lines = Lines::new(self.params.stripe_direction, &searched);
                // Step 9: metres.
                calibration.triangulate(&self.centerline, &lines, full_scale, &mut self.profile);
                let (missing, rejected) = std::mem::take(&mut self.left_out);
                let index = index.behind(missing, rejected);
                // Step 10: stacked along the motion.
                match placed {
                    _ if !self.is_scanning => Completed::default(),
                    Some((position, part_from_laser)) => self.scan.push(&Placed {
                        profile: &self.profile,
                        image_px,
                        stamp_ns,
                        position: position.value,
                        is_doubtful: position.doubts != 0,
                        part_from_laser,
                        index,
                    }),
                    None => {
                        let FrameIndex { frames_missing, frames_rejected, .. } = index;
                        self.left_out = (frames_missing, frames_rejected.saturating_add(1));
                        Completed::default()
                    }
                }
            }
            None => Completed::default(),
        };
        on_stage(Stage::Triangulate);

        Ok(Output {
            centerline: &self.centerline,
            pairing,
            share_above_threshold,
            position: placed.map(|(position, _)| position),
            travelled: placed.map_or(0.0, |(position, _)| self.travel.distance(position.value)),
            profile: self.calibration.is_some().then_some(&self.profile),
            slice: completed.slice,
            height_map: completed.height_map,
        })
    }

    /// What a position means for the part, and whether it is where it should be.
    fn place(&mut self, mut position: Position) -> (Position, Isometry3<f64>) {
        let part_from_laser = self.placement.place(&mut position);
        // A pose has no direction of its own.
        if position.part_from_sensor.is_none() && self.travel.is_reversed(position.value) {
            position.doubts |= doubt::REVERSED;
        }
        (position, part_from_laser)
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
        let (missing, rejected) = std::mem::take(&mut self.left_out);
        let frames_missing = missing.saturating_add(frames_missing);
        self.scan.finish(frames_missing, rejected.saturating_add(frames_rejected))
    }

    /// Throws the open scan away. The next frame lies at position 0 again.
    pub fn discard(&mut self) {
        self.restart();
        self.left_out = (0, 0);
        self.scan.discard();
    }

    /// What comes does not go on from what came: not its positions, and not its exposures.
    fn restart(&mut self) {
        self.motion.restart();
        self.travel.restart();
        self.placement.restart();
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
            self.travel = travel(&params);
        }
        if self.params.stripe_direction != params.stripe_direction {
            let camera_from_laser = camera_from_laser(self.calibration.as_ref(), &params);
            self.placement = self.placement.clone().with_camera_from_laser(camera_from_laser);
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

fn travel(params: &Params) -> Travel {
    Travel::new(params.motion.direction, params.motion.backlash)
}

fn placement(calibration: Option<&Calibration>, params: &Params) -> Placement {
    let axis = calibration.and_then(Calibration::axis).copied();
    let placement = Placement::new(camera_from_laser(calibration, params), axis);
    match calibration.and_then(Calibration::part) {
        Some(part) => placement.with_part(&part.pose()),
        None => placement,
    }
}

fn camera_from_laser(calibration: Option<&Calibration>, params: &Params) -> Isometry3<f64> {
    let direction = params.stripe_direction;
    calibration.and_then(|calibration| calibration.camera_from_laser(direction)).unwrap_or_default()
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

impl FrameIndex {
    /// The same frame behind so many more that are missing or refused.
    const fn behind(self, missing: u32, rejected: u32) -> Self {
        Self {
            frame_number: self.frame_number,
            frames_missing: self.frames_missing.saturating_add(missing),
            frames_rejected: self.frames_rejected.saturating_add(rejected),
        }
    }
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
    /// Where along the scan it was taken; `None`: nobody knows.
    pub position: Option<Position>,
    /// How far it came since the first frame of the scan, metres; radians on a rotary axis.
    pub travelled: f64,
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
    #[error(transparent)]
    FullScale(#[from] FullScaleError),
}
