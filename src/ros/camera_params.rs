//! A camera's parameters as types.

mod motion;

pub use motion::Moved;

use std::path::PathBuf;

use crate::{
    msg::convert::cloud,
    scanner::{
        calibration::Calibration,
        params::{
            Background, Channel, Exposure, ExtractionParams, GravityWindow, Method, NoiseSource,
            Params, PeakSelection, RegionOfInterest, StripeDirection, Threshold,
        },
        scan::MAX_SLICE_POINTS,
    },
};

use super::{
    node_params::ImageTransport,
    parameters::{ParameterError, Section},
};

/// Everything that decides what the frames of one camera give.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraParams {
    /// Its name among several; empty: the node has only this one.
    pub name: String,
    /// How images arrive; `None` when nobody set it, and the default may give way to what a recording holds.
    pub image_transport: Option<ImageTransport>,
    /// Largest decoded image accepted, bytes.
    pub max_frame_bytes: u64,
    /// The calibration; `None`: centrelines only.
    pub calibration_file: Option<PathBuf>,
    /// The frame without laser; `None`: there is none.
    pub background_file: Option<PathBuf>,
    /// Largest message of the point cloud, bytes; 0: any. Live, what the transport carries stands here in its place.
    pub points_max_bytes: u64,
    /// What is moved, by name.
    pub moved: Moved,
    /// The measurement, without a limit to a slice's points: see [`scanner_for`](Self::scanner_for).
    pub scanner: Params,
}

impl CameraParams {
    pub(super) fn new(name: &str, values: Section<'_>) -> Result<Self, ParameterError> {
        let transport = values.choice("image_transport", ImageTransport::from_name)?;
        let params = Self {
            name: name.to_owned(),
            image_transport: values.is_set("image_transport").then_some(transport),
            max_frame_bytes: values.unsigned("max_frame_bytes")?,
            calibration_file: values.file("calibration_file")?,
            background_file: values.file("extraction.background_file")?,
            points_max_bytes: values.unsigned("points.max_bytes")?,
            moved: motion::moved(values)?,
            scanner: scanner(values)?,
        };
        params.check()?;
        Ok(params)
    }

    /// The measurement with slices whose message, in the frame `frame_id`, fits into `points_max_bytes`.
    pub fn scanner_for(&self, frame_id: &str) -> Params {
        let slice_max_points = match self.points_max_bytes {
            0 => MAX_SLICE_POINTS,
            bytes => cloud::points_within(usize::try_from(bytes).unwrap_or(usize::MAX), frame_id),
        };
        Params { slice_max_points, ..self.scanner }
    }

    /// The frame of the scan: its point clouds and height maps. Empty without a calibration.
    pub fn part_frame(&self, calibration: Option<&Calibration>) -> String {
        let Some(calibration) = calibration else { return String::new() };
        let is_laser_plane = calibration.axis().is_none() && calibration.part().is_none();
        match self.moved.part_frame.as_str() {
            "" if is_laser_plane => calibration.frame_id().to_owned(),
            "" => "part".to_owned(),
            chosen => chosen.to_owned(),
        }
    }

    /// Whether poses that are measured are those of the laser plane itself.
    pub fn tracks_laser(&self, calibration: Option<&Calibration>) -> bool {
        let frame = calibration.map_or("", Calibration::frame_id);
        !frame.is_empty() && self.moved.sensor_frame == frame
    }

    /// How images arrive live: raw, unless it was set.
    pub fn live_transport(&self) -> ImageTransport {
        self.image_transport.unwrap_or(ImageTransport::Raw)
    }

    /// The full name of a parameter of this camera.
    pub fn full_name(&self, name: &str) -> String {
        if self.name.is_empty() { name.to_owned() } else { format!("{}.{name}", self.name) }
    }

    fn check(&self) -> Result<(), ParameterError> {
        let name = |name| self.full_name(name);
        let conflict = |text: String| Err(ParameterError::Conflict(text));
        motion::check(self)?;
        let is_reference = self.scanner.extraction.background == Background::Reference;
        if is_reference && self.background_file.is_none() {
            return conflict(format!(
                "{} is reference, but {} is empty: name a picture without laser, as laser_profiler ambient makes",
                name("extraction.background"),
                name("extraction.background_file")
            ));
        }
        let smoothed = self.scanner.extraction.smoothing_columns;
        if smoothed.is_multiple_of(2) {
            return conflict(format!(
                "{} is {smoothed}: a point and as many neighbours to either side are an odd number",
                name("extraction.smoothing_columns")
            ));
        }
        let (slice, scan) = (self.scanner.slice_profiles, self.scanner.scan_max_profiles);
        if slice > scan {
            return conflict(format!(
                "{} is {slice}, but a scan ends at {} {scan}: a slice may not be larger",
                name("slice.profiles"),
                name("scan.max_profiles")
            ));
        }
        Ok(())
    }
}

fn scanner(values: Section<'_>) -> Result<Params, ParameterError> {
    let number = |name| values.unsigned(name).map(|value| value as u32);
    Ok(Params {
        channel: values.choice("channel", Channel::from_name)?,
        stripe_direction: values.choice("stripe_direction", StripeDirection::from_name)?,
        full_scale: number("full_scale")?,
        roi: RegionOfInterest {
            x_offset: number("roi.x_offset")?,
            y_offset: number("roi.y_offset")?,
            width: number("roi.width")?,
            height: number("roi.height")?,
        },
        exposure: values.choice("exposure", Exposure::from_name)?,
        extraction: extraction(values)?,
        motion: motion::params(values)?,
        slice_profiles: number("slice.profiles")?,
        slice_max_points: MAX_SLICE_POINTS,
        scan_max_profiles: number("scan.max_profiles")?,
    })
}

fn extraction(values: Section<'_>) -> Result<ExtractionParams, ParameterError> {
    let float = |name: &str| values.float(&format!("extraction.{name}"));
    let number =
        |name: &str| values.unsigned(&format!("extraction.{name}")).map(|value| value as u32);
    Ok(ExtractionParams {
        method: values.choice("extraction.method", Method::from_name)?,
        window: values.choice("extraction.window", GravityWindow::from_name)?,
        blur_radius: number("blur_radius")?,
        segment_threshold: float("segment_threshold")?,
        min_segment_area: number("min_segment_area")?,
        width_threshold: float("width_threshold")?,
        peak_selection: values.choice("extraction.peak_selection", PeakSelection::from_name)?,
        background: values.choice("extraction.background", Background::from_name)?,
        background_window_px: number("background_window")?,
        threshold: values.choice("extraction.threshold", Threshold::from_name)?,
        threshold_sigmas: float("threshold_sigmas")?,
        min_contrast: float("min_contrast")?,
        min_width_px: number("min_width")?,
        max_width_px: number("max_width")?,
        min_snr: float("min_snr")?,
        max_stripes: number("max_stripes")?,
        max_step_px: float("max_step")?,
        tracking_margin_px: number("tracking_margin")?,
        smoothing_columns: number("smoothing_columns")?,
        ridge_sigma_px: float("ridge_sigma")?,
        noise: values.choice("extraction.noise", NoiseSource::from_name)?,
        read_noise: float("read_noise")?,
        shot_gain: float("shot_gain")?,
    })
}
