//! The whole measurement: extract → triangulate → push, the ten steps of Yao et al. 2023 (doi 10.3390/app13179831).

use super::{
    ambient::Ambient,
    auto_channel::{AutoChannel, ChannelChoice},
    axis::{Axis, AxisKind, AxisTravel},
    calibration::{Calibration, Lines, Triangulator},
    channel::{Decoder, SearchedRegion, check_channel},
    coverage::share_above_threshold,
    diagnosis::{self, Diagnosis},
    exposure_pair::{ExposurePairing, ExposurePairs},
    frame_error::FrameError,
    frame_index::FrameIndex,
    height_map::HeightMap,
    image::{Frame, Image, OwnedImage},
    motion::{Position, locator::Locator, standstill},
    params::{Background, Channel, Exposure, MotionSource, Params},
    profile::Profile,
    scan::{Completed, Scan, ScanEntry, Slice},
    stripe::{Centerline, Extractor, SigmaParts},
};

/// Measures frame after frame. Owns all buffers: after the first frame of a size and the first two scans it does not
/// allocate.
///
/// ```
/// use laser_triangulation::{
///     scanner::{
///         calibration::Calibration,
///         frame_index::FrameIndex,
///         image::{Frame, Image, PixelFormat},
///         params::{ExtractionParams, MotionParams, MotionSource, Params},
///         pipeline::Pipeline,
///     },
///     simulate::{scenario::{EXAMPLE, Scenario}, world::RenderedFrame},
/// };
///
/// // The simulated camera and part stand for your own.
/// let scenario = Scenario::from_yaml(EXAMPLE)?;
/// let calibration = Calibration::from_yaml(&scenario.camera.calibration_yaml())?;
///
/// let step = Some(scenario.motion.step_m);
/// let params = Params {
///     extraction: ExtractionParams { min_segment_area: 50, ..ExtractionParams::default() },
///     motion: MotionParams { source: MotionSource::Constant, step, ..MotionParams::default() },
///     ..Params::default()
/// };
/// let mut pipeline = Pipeline::new(params, Some(calibration));
///
/// let (width, height) = (scenario.camera.width_px, scenario.camera.height_px);
/// let mut picture = RenderedFrame::default();
/// for number in 0..scenario.frames {
///     scenario.render(number, &mut picture);
///     let image = Image::packed(width, height, PixelFormat::Mono8, &picture.samples)?;
///     let frame = Frame { stamp_ns: scenario.stamp_ns(number), image };
///     let index = FrameIndex { frame_number: number.into(), ..FrameIndex::default() };
///     let output = pipeline.process(&frame, index, |_| ())?;
///     assert!(output.profile.is_some());
/// }
/// let map = pipeline.finish(0, 0).height_map.ok_or("the scan is empty")?;
/// assert_eq!((map.width, map.height), (width, scenario.frames));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Pipeline {
    params: Params,
    triangulator: Option<Triangulator>,
    decoder: Decoder,
    auto_channel: AutoChannel,
    ambient: Ambient,
    extractor: Extractor,
    /// Present if short and long exposures alternate.
    pairs: Option<ExposurePairs>,
    centerline: Centerline,
    profile: Profile,
    locator: Locator,
    scan: Scan,
}

impl Pipeline {
    /// A pipeline with these parameters. Without a calibration it returns centrelines only.
    ///
    /// # Panics
    /// A parameter is out of its range: [`Params::check_ranges`] returns an error.
    pub fn new(params: Params, calibration: Option<Calibration>) -> Self {
        if let Err(error) = params.check_ranges() {
            panic!("{error}");
        }
        let seed = calibration.as_ref().map(Calibration::id).unwrap_or_default();
        Self {
            decoder: Decoder::default(),
            auto_channel: AutoChannel::default(),
            ambient: Ambient::default(),
            extractor: Extractor::new(params.extraction, params.stripe_direction),
            pairs: pairs(&params),
            centerline: Centerline::default(),
            profile: Profile::default(),
            locator: Locator::new(params.motion, params.stripe_direction, calibration.as_ref()),
            scan: Scan::new(params.scan_limits(), seed),
            params,
            triangulator: calibration.map(Triangulator::new),
        }
    }

    /// The same pipeline with a reference frame without laser, which `background: reference` subtracts.
    #[must_use]
    pub fn with_ambient(self, image: Option<OwnedImage>) -> Self {
        Self { ambient: Ambient::new(image), ..self }
    }

    /// The same pipeline for measured poses ([`Position::part_from_sensor`]) of the laser plane instead of the camera.
    #[must_use]
    pub fn with_laser_tracked(self) -> Self {
        Self { locator: self.locator.with_laser_tracked(), ..self }
    }

    /// Measures one frame at its expected position. Calls `on_stage` at the end of every stage, for timing.
    ///
    /// # Errors
    /// A frame that does not fit the parameters. The next frame is measured as if this one had never come.
    pub fn process(
        &mut self,
        frame: &Frame<'_>,
        index: FrameIndex,
        on_stage: impl FnMut(Stage),
    ) -> Result<Output<'_>, FrameError> {
        let position = self.expected_position(index.frame_number, frame.stamp_ns);
        self.process_at(frame, index, position, on_stage)
    }

    /// Position of a frame according to the parameters; `None` if positions are measured.
    pub fn expected_position(&mut self, frame_number: u64, stamp_ns: i64) -> Option<Position> {
        self.locator.expected_position(frame_number, stamp_ns)
    }

    /// Measures one frame taken at `position`. A frame without a position returns a profile, but is left out of the scan.
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
        let image_px = (image.width(), image.height());
        let full_scale = self.params.full_scale_of(image.format())?;
        check_channel(self.params.channel, image.format())?;
        self.check_size(image_px)?;
        // Step 1: crop.
        let searched = SearchedRegion::new(self.params.roi, image.width(), image.height())?;
        let channel = self.channel(&image, &searched, full_scale);
        let params = Params { channel, ..self.params };
        self.ambient.prepare(&image, &searched, &params, &mut self.extractor)?;

        // Step 2: one grey level a pixel.
        let plane = self.decoder.decode(&image, channel, &searched);
        on_stage(Stage::Decode);

        // Steps 3 to 8: blur, segment, coarse peak, width, window, centre.
        let share_above_threshold =
            share_above_threshold(&plane, &self.params.extraction, full_scale);
        self.extractor.extract_plane(&plane, searched.offset(), full_scale, &mut self.centerline);
        let pairs = self.pairs.as_mut();
        let pairing = pairs.map(|pairs| pairs.merge(&mut self.centerline, index, image_px));
        on_stage(Stage::Extract);

        let located = position.map(|position| self.locator.locate(position));
        let is_in_scan = self.triangulator.is_some() && self.scan.is_stacking();
        let mut completed = Completed::default();
        if let Some(triangulator) = &mut self.triangulator {
            // Step 9: metres.
            let lines = Lines::new(self.params.stripe_direction, &searched);
            triangulator.prepare(lines.direction, image_px);
            triangulator.triangulate(&self.centerline, &lines, full_scale, &mut self.profile);
            // Step 10: stacked along the motion.
            let profile = &self.profile;
            let entry = ScanEntry { profile, image_px, stamp_ns, located, index };
            completed = self.scan.push(&entry);
        }
        on_stage(Stage::Triangulate);

        Ok(Output {
            centerline: &self.centerline,
            channel,
            stripe_share: diagnosis::stripe_share(&self.centerline, &self.params, &searched),
            sigma_parts: self.extractor.sigma_parts(),
            channel_choice: (self.params.channel == Channel::Auto)
                .then(|| self.auto_channel.choice())
                .flatten(),
            pairing,
            share_above_threshold,
            position: located.map(|located| located.position),
            travelled: located.map(|located| located.travelled),
            stands: is_in_scan && located.is_some_and(|located| located.stands),
            profile: self.triangulator.is_some().then_some(&self.profile),
            slice: completed.slice,
            height_map: completed.height_map,
        })
    }

    /// Returns the channel to measure. A stored frame of grey levels was made from the largest colour, unless its maker
    /// chose a channel and states the same one in the parameters.
    fn channel(
        &mut self,
        image: &Image<'_>,
        searched: &SearchedRegion,
        full_scale: u32,
    ) -> Channel {
        let subtracts = self.params.extraction.background == Background::Reference;
        if self.params.channel == Channel::Auto && subtracts && self.ambient.is_gray() {
            return Channel::Max;
        }
        self.auto_channel.channel(image, searched, &self.params, full_scale)
    }

    /// Returns the likely reason why an image has no stripe, or hardly any. Takes some ten times as long as a measurement.
    #[must_use]
    pub fn explain(&self, image: &Image<'_>) -> Diagnosis {
        let choice = self.auto_channel.choice().map(|choice| choice.channel);
        let channel = match self.params.channel {
            Channel::Auto => choice.unwrap_or(Channel::Max),
            named => named,
        };
        let reference = self.ambient.view();
        diagnosis::diagnose(image, &Params { channel, ..self.params }, reference.as_ref())
    }

    /// A calibration holds for one image size: another one would be measured at the wrong place.
    fn check_size(&self, image: (u32, u32)) -> Result<(), FrameError> {
        let calibrated = self.calibration().and_then(Calibration::image_size_px);
        match calibrated {
            Some(calibrated) if calibrated != image => Err(FrameError::Size { image, calibrated }),
            _ => Ok(()),
        }
    }

    /// Ends the scan: returns its last slice and its height map. Of the frames after the last good one, `frames_missing`
    /// never arrived and `frames_rejected` were rejected. The next frame lies at position 0 again.
    pub fn finish(&mut self, frames_missing: u32, frames_rejected: u32) -> Completed<'_> {
        self.restart();
        self.scan.finish(frames_missing, frames_rejected)
    }

    /// Discards the open scan. The next frame lies at position 0 again.
    pub fn discard(&mut self) {
        self.restart();
        self.scan.discard();
    }

    /// Forgets positions, exposures and the chosen channel: the next frame does not continue the last one.
    fn restart(&mut self) {
        self.auto_channel.forget();
        self.locator.restart();
        self.extractor.reset();
        if let Some(pairs) = &mut self.pairs {
            pairs.restart();
        }
    }

    /// True if frames return profiles.
    pub const fn is_calibrated(&self) -> bool {
        self.triangulator.is_some()
    }

    fn calibration(&self) -> Option<&Calibration> {
        self.triangulator.as_ref().map(Triangulator::calibration)
    }

    /// True if the travel of the scan is an angle: a revolute axis, unless poses are measured.
    pub fn travels_by_angle(&self) -> bool {
        let axis = self.calibration().and_then(Calibration::axis);
        self.params.motion.source != MotionSource::Tf
            && matches!(axis, Some(Axis { kind: AxisKind::Revolute, .. }))
    }

    /// Returns the parameter that moves the profiles of a standing scan apart, in a clause for messages.
    #[must_use]
    pub const fn standstill_remedy(&self) -> &'static str {
        standstill::remedy(&self.params.motion)
    }

    /// Sets the identity of the next scan; `None`: derived from its first frame.
    pub const fn set_next_scan_id(&mut self, scan_id: Option<[u8; 16]>) {
        self.scan.set_next_id(scan_id);
    }

    /// Stacks profiles into a scan again, as a new pipeline does.
    pub const fn start_scanning(&mut self) {
        self.scan.start();
    }

    /// Stacks no profiles from the next frame on. Call [`finish`](Self::finish) first.
    pub const fn stop_scanning(&mut self) {
        self.scan.stop();
    }

    /// Identity of the open scan; `None` before its first profile.
    pub fn scan_id(&self) -> Option<[u8; 16]> {
        self.scan.open_id()
    }

    /// True if the open scan must end before these parameters apply: they change its positions or its geometry.
    pub fn must_end_for(&self, params: &Params) -> bool {
        let Params { motion, stripe_direction, roi, .. } = self.params;
        motion != params.motion || stripe_direction != params.stripe_direction || roi != params.roi
    }

    /// Measures with this calibration from the next frame on. Call [`finish`](Self::finish) first.
    pub fn recalibrate(&mut self, calibration: Calibration) {
        self.triangulator = Some(Triangulator::new(calibration));
    }

    /// Measures with these parameters from the next frame on. Call [`finish`](Self::finish) first if
    /// [`must_end_for`](Self::must_end_for) returns true.
    ///
    /// # Panics
    /// A parameter is out of its range: [`Params::check_ranges`] returns an error.
    pub fn reconfigure(&mut self, params: Params) {
        if let Err(error) = params.check_ranges() {
            panic!("{error}");
        }
        let calibration = self.triangulator.as_ref().map(Triangulator::calibration);
        self.locator.reconfigure(&self.params, &params, calibration);
        self.extractor = Extractor::new(params.extraction, params.stripe_direction);
        self.ambient.forget();
        if is_seen_otherwise(&self.params, &params) {
            self.auto_channel.forget();
        }
        self.pairs = pairs(&params);
        self.scan.set_limits(params.scan_limits());
        self.params = params;
    }
}

/// True if these parameters select other samples.
fn is_seen_otherwise(before: &Params, after: &Params) -> bool {
    let Params { channel, stripe_direction, full_scale, roi, .. } = *before;
    (channel, stripe_direction, full_scale, roi)
        != (after.channel, after.stripe_direction, after.full_scale, after.roi)
}

fn pairs(params: &Params) -> Option<ExposurePairs> {
    (params.exposure == Exposure::Alternating).then(|| ExposurePairs::new(params.stripe_direction))
}

/// End of a stage of [`Pipeline::process`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The image is one channel of grey levels.
    Decode,
    /// The centreline is known.
    Extract,
    /// The profile is in metres and in the scan.
    Triangulate,
}

/// Result of one frame, borrowed from the pipeline until the next frame.
#[derive(Clone, Copy, Debug)]
pub struct Output<'a> {
    /// The centreline; it may have no points.
    pub centerline: &'a Centerline,
    /// Share of the cross-sections with a point of an unbroken line, 0 to 1. 0: no stripe was found, or stray points
    /// only; see [`Pipeline::explain`].
    pub stripe_share: f64,
    /// Shares of noise and texture in the uncertainty of the centres; `None` without points.
    pub sigma_parts: Option<SigmaParts>,
    /// The channel that was measured. For `channel: auto` it is the choice of this scan, the largest colour until a frame
    /// shows the line, and `auto` for grey images.
    pub channel: Channel,
    /// The choice of `channel: auto` in this scan; `None` if the parameters name a channel, for grey images, and until a
    /// frame shows the line.
    pub channel_choice: Option<ChannelChoice>,
    /// Pairing of the two exposures, if they alternate.
    pub pairing: Option<ExposurePairing>,
    /// Share of the searched pixels above a fixed segment threshold, 0 to 1: above [`LARGEST_SHARE`] the threshold is too
    /// low for the scene. `None` if the threshold is adaptive.
    ///
    /// [`LARGEST_SHARE`]: super::coverage::LARGEST_SHARE
    pub share_above_threshold: Option<f64>,
    /// Position along the scan, with its doubts; `None` if unknown.
    pub position: Option<Position>,
    /// Distance from the first frame of the scan, never negative; `None` if the position is unknown.
    pub travelled: Option<AxisTravel>,
    /// True if the profile is in the scan and lies where the one before lies: see [`Pipeline::standstill_remedy`].
    pub stands: bool,
    /// The profile in metres, if calibrated.
    pub profile: Option<&'a Profile>,
    /// The slice that ended before this frame, if one did.
    pub slice: Option<&'a Slice>,
    /// The height map of the scan that ended before this frame, if one did.
    pub height_map: Option<&'a HeightMap>,
}
