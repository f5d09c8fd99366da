//! A labelled scene, and the share of it that an extraction finds.

use std::{fmt, fs};

use laser_profiler::{
    ros::{
        arguments::RosArguments, camera_params::CameraParams, names::NodeNames,
        node_params::NodeParams, parameters::Parameters,
    },
    scanner::{
        frame_index::FrameIndex,
        image::{Frame, Image, PixelFormat},
        params::{ExtractionParams, Params, StripeDirection},
        pipeline::{Output, Pipeline},
    },
};

use super::path;

/// Distance from every label of its line beyond which a point is an outlier, pixels.
const OUTLIER_PX: f64 = 3.0;

/// A stored picture with its labels and its parameters.
pub(crate) struct Labelled {
    picture: image::DynamicImage,
    /// Line and position across the stripe, pixels; NaN: no line there.
    labels: Vec<(u32, f64)>,
    params: Params,
}

/// Shares from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Score {
    /// Share of the labelled lines with a point within 1 px of a label.
    pub(crate) found_1px: f64,
    /// The same within 3 px.
    pub(crate) found_3px: f64,
    /// Share of the points farther than 3 px from every label of their line.
    pub(crate) outliers: f64,
    pub(crate) num_points: usize,
}

impl Labelled {
    pub(crate) fn open(name: &str) -> Self {
        let labels = fs::read_to_string(path(name, "csv")).unwrap();
        let label = |row: &str| {
            let mut cells = row.split(',');
            let mut next = || cells.next().unwrap().to_owned();
            (next().parse().unwrap(), next().parse().unwrap())
        };
        Self {
            picture: image::open(path(name, "png")).unwrap(),
            labels: labels.lines().skip(1).map(label).collect(),
            params: params(name).scanner,
        }
    }

    /// Score with the scene's parameters after `change`.
    pub(crate) fn score(&self, change: impl Fn(ExtractionParams) -> ExtractionParams) -> Score {
        let params = Params { extraction: change(self.params.extraction), ..self.params };
        self.measure(&params, |output| {
            let line = output.centerline;
            let (along, across) = match params.stripe_direction {
                StripeDirection::Horizontal => (&line.u_px, &line.v_px),
                StripeDirection::Vertical => (&line.v_px, &line.u_px),
            };
            let points = along.iter().zip(across);
            let points: Vec<_> =
                points.map(|(&along, &across)| (along as u32, f64::from(across))).collect();
            Score::of(&self.labels, &points)
        })
    }

    /// Share of the pixels above the threshold with the scene's parameters after `change`.
    pub(crate) fn share_above_threshold(
        &self,
        change: impl Fn(ExtractionParams) -> ExtractionParams,
    ) -> Option<f64> {
        let params = Params { extraction: change(self.params.extraction), ..self.params };
        self.measure(&params, |output| output.share_above_threshold)
    }

    fn measure<T>(&self, params: &Params, read: impl Fn(&Output<'_>) -> T) -> T {
        let (width, height) = (self.picture.width(), self.picture.height());
        let format = match self.picture.color().channel_count() {
            1 => PixelFormat::Mono8,
            _ => PixelFormat::Rgb8,
        };
        let step = width * format.bytes_per_pixel() as u32;
        let image = Image::new(width, height, step, format, self.picture.as_bytes()).unwrap();
        let mut pipeline = Pipeline::new(*params, None);
        let frame = Frame { stamp_ns: 0, image };
        read(&pipeline.process(&frame, FrameIndex::default(), |_| ()).unwrap())
    }
}

/// The parameters beside a scene.
fn params(name: &str) -> CameraParams {
    let file = path(name, "yaml");
    let arguments = RosArguments { parameter_files: vec![file.clone()], ..RosArguments::default() };
    let values = Parameters::load(&NodeNames::new("laser_profiler", &[]).unwrap(), &arguments)
        .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    NodeParams::new(&values).unwrap().cameras.remove(0)
}

impl Score {
    /// Returns the score of points against labels, both (line, position across the stripe).
    pub(crate) fn of(labels: &[(u32, f64)], points: &[(u32, f64)]) -> Self {
        let distance = |line: u32, position_px: f64| {
            let of_line = labels.iter().filter(|label| label.0 == line && label.1.is_finite());
            of_line.map(|label| (label.1 - position_px).abs()).fold(f64::INFINITY, f64::min)
        };
        let distances: Vec<_> =
            points.iter().map(|&(line, position_px)| (line, distance(line, position_px))).collect();
        let mut lit: Vec<u32> =
            labels.iter().filter(|label| label.1.is_finite()).map(|label| label.0).collect();
        lit.dedup();
        let found = |within_px: f64| {
            let is_found = |line: &&u32| {
                distances.iter().any(|(of, distance_px)| of == *line && *distance_px <= within_px)
            };
            lit.iter().filter(is_found).count() as f64 / lit.len() as f64
        };
        let num_outliers =
            distances.iter().filter(|(_, distance_px)| *distance_px > OUTLIER_PX).count();
        Self {
            found_1px: found(1.0),
            found_3px: found(3.0),
            outliers: num_outliers as f64 / points.len().max(1) as f64,
            num_points: points.len(),
        }
    }
}

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| 100.0 * share;
        write!(
            f,
            "{:5.1} % within 1 px, {:5.1} % within 3 px, {:5.1} % of {:3} points on no label",
            percent(self.found_1px),
            percent(self.found_3px),
            percent(self.outliers),
            self.num_points
        )
    }
}
