//! `laser_profiler calibrate axis`.

use std::io::Write;

use anyhow::{Context, bail};
use nalgebra::{Point2, Point3, Unit, Vector3};

use super::{
    args::AxisArgs,
    axis_answer,
    axis_distance::{self, Distance},
    boards, file,
    joint::{self, Joint, Source},
    rejected::{self, Rejected},
    report_charts,
    stripes::{Light, Stripes},
    views::{self, View, Views},
};
use crate::{
    calibrate::{
        board::{Board, BoardDetector, Gray},
        board_axis,
        markers::{Marker, MarkerDetector, MarkerKind},
        pose,
        positions::{self, Agreement, Position},
        revolute::{self, RevoluteFit, Sighting},
        target::Checkerboard,
    },
    cli::{
        Outcome, output,
        settings::{self, Settings, SettingsArgs},
    },
    ros::arguments::RosArguments,
    scanner::{
        axis::{Axis, AxisKind},
        calibration::{AxisQuality, Calibration, CameraAndPlane},
        camera::Camera,
        stripe::Centerline,
    },
};

/// Fewest pictures that a marker must be seen in.
const MIN_SEEN: usize = 3;

/// What one picture shows.
pub(super) struct Shown {
    size_px: [u32; 2],
    pub(super) markers: Vec<Marker>,
    pub(super) board: Option<Board>,
    pub(super) stripes: Vec<(Light, Centerline)>,
}

/// The pictures that take part.
pub(super) struct Frames {
    /// Their names.
    pub(super) names: Vec<String>,
    /// What the joint said at their times.
    pub(super) stated: Vec<f64>,
    /// What they show.
    pub(super) shown: Vec<Shown>,
    /// Numbers of the markers that are seen often enough.
    pub(super) ids: Vec<u32>,
    /// Pictures that do not take part.
    pub(super) rejected: Vec<Rejected>,
    is_lossy: bool,
}

/// An axis and everything that is told about it.
pub(super) struct Found {
    /// The axis.
    pub(super) axis: Axis,
    /// How well it is known.
    pub(super) quality: AxisQuality,
    /// What every picture shows, radians or metres; its sense is any.
    pub(super) shown: Vec<f64>,
    /// Positions stated and shown.
    pub(super) agreement: Agreement,
    /// Of markers: their circles, and metres a unit of these.
    pub(super) circles: Option<(RevoluteFit, Distance)>,
}

/// What moves.
enum Target {
    Markers(MarkerKind),
    Board(Checkerboard),
}

/// Calibrates the axis, writes the file and tells on `out` how well.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for a request that cannot be followed; pictures that say too little; files that cannot be
/// read or written.
pub(in crate::cli::calibrate) fn run(
    args: &AxisArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let target = match (&args.markers, &args.target) {
        (Some(markers), _) => Target::Markers(markers.parse().map_err(settings::usage)?),
        (None, board) => Target::Board(boards::target(board.as_deref().unwrap_or_default())?),
    };
    file::refuse_existing(&args.output)?;
    let told = || args.calibration.display().to_string();
    let mut geometry = match Calibration::from_yaml(&file::read(&args.calibration)?) {
        Ok(Calibration::CameraAndPlane(geometry)) => *geometry,
        Ok(_) => bail!("{}: an axis needs a calibration of type camera_and_plane", told()),
        Err(error) => return Err(error).with_context(told),
    };
    let chosen = SettingsArgs { params_file: args.params_file.clone(), camera: None };
    let settings = Settings::load(&chosen, ros)?;
    let views = Views::open(&args.inputs, &settings)?;
    let frames = frames(args, &views, &settings, &target)?;
    frames.refuse_another_size(&geometry.camera)?;
    let found = match &target {
        Target::Markers(kind) => of_markers(&geometry, &frames, kind),
        Target::Board(board) => of_board(&geometry.camera, &frames, board),
    };
    let found = found.with_context(|| frames.told())?;
    geometry.axis = Some(found.axis);
    // It lay in the frame of the axis before.
    geometry.part = None;
    geometry.axis_quality = Some(found.quality.clone());
    geometry.calibrated_at = Some(file::now());
    file::write(&args.output, &Calibration::CameraAndPlane(Box::new(geometry)).to_yaml())?;
    if let Some(path) = &args.output.report {
        report_charts::axis(path, &frames, &found)?;
    }
    output::printed(axis_answer::print(args, &frames, &found, out))?;
    Ok(if frames.is_lossy { Outcome::DataLost } else { Outcome::Done })
}

fn frames(
    args: &AxisArgs,
    views: &Views,
    settings: &Settings,
    target: &Target,
) -> anyhow::Result<Frames> {
    let source = joint::source(args, views)?;
    let look = look(target)?;
    let stripes = Stripes::new(settings, &views.params);
    let mut joint = Joint::new(args.joint.clone(), &views.params.scanner.motion);
    let topic = match &source {
        Source::Topic(topic) => Some(topic.as_str()),
        Source::Step(_) => None,
    };
    let mut joint_error = None;
    let on_other = |message: &_| {
        let taken = joint.take(message);
        taken.inspect_err(|error| {
            joint_error.get_or_insert_with(|| format!("{error:#}"));
        })
    };
    let seen = views.map_beside(topic, on_other, |image| {
        let full_scale = views.params.scanner.full_scale_of(image.format());
        let levels = views::gray(image, full_scale.unwrap_or(image.format().max_level()));
        let (markers, board) = match look(&views::view_of(image, &levels)) {
            Ok(found) => found,
            Err(reason) => return Ok(Err(reason)),
        };
        let size_px = [image.width(), image.height()];
        Ok(Ok(Shown { size_px, markers, board, stripes: stripes.extract(image)? }))
    });
    joint.settle();
    if topic.is_some() && joint.is_empty() {
        bail!(joint_error.unwrap_or_else(|| "the joint's topic has no messages".to_owned()));
    }
    let position = |index: usize, stamp_ns: i64| match source {
        Source::Step(step) => Some(step * index as f64),
        Source::Topic(_) => joint.at(stamp_ns),
    };
    Ok(sort(seen, position))
}

/// What is looked for in a picture: markers, or a whole board; or why there is none.
type Looked = Result<(Vec<Marker>, Option<Board>), String>;

/// Looks for it, on any core.
type Looker = Box<dyn Fn(&Gray<'_>) -> Looked + Sync>;

fn look(target: &Target) -> anyhow::Result<Looker> {
    Ok(match target {
        Target::Markers(kind) => {
            let detector = MarkerDetector::new(kind);
            Box::new(move |picture| {
                let markers = detector.detect(picture);
                if markers.is_empty() { Err("no marker".to_owned()) } else { Ok((markers, None)) }
            })
        }
        Target::Board(board) => {
            // A part of a board does not say which part.
            let detector = BoardDetector::new(*board, board.num_corners())?;
            Box::new(move |picture| {
                let board = detector.detect(picture).map_err(|error| error.to_string())?;
                Ok((Vec::new(), Some(board)))
            })
        }
    })
}

fn sort(
    seen: Vec<View<Result<Shown, String>>>,
    position: impl Fn(usize, i64) -> Option<f64>,
) -> Frames {
    let mut frames = Frames {
        names: Vec::new(),
        stated: Vec::new(),
        shown: Vec::new(),
        ids: Vec::new(),
        rejected: Vec::new(),
        is_lossy: false,
    };
    for (index, View { name, stamp_ns, result }) in seen.into_iter().enumerate() {
        frames.is_lossy |= result.is_err();
        let reason = match (result.and_then(|looked| looked), position(index, stamp_ns)) {
            (Err(reason), _) => reason,
            (Ok(_), None) => "no position is stated at its time".to_owned(),
            (Ok(shown), Some(stated)) => {
                frames.names.push(name);
                frames.stated.push(stated);
                frames.shown.push(shown);
                continue;
            }
        };
        frames.rejected.push(Rejected::new(name, reason));
    }
    let seen = || frames.shown.iter().flat_map(|shown| &shown.markers).map(|marker| marker.id);
    let mut ids: Vec<_> = seen().collect();
    ids.sort_unstable();
    ids.dedup();
    ids.retain(|&id| seen().filter(|&other| other == id).count() >= MIN_SEEN);
    frames.ids = ids;
    frames
}

fn of_markers(
    geometry: &CameraAndPlane,
    frames: &Frames,
    kind: &MarkerKind,
) -> anyhow::Result<Found> {
    let camera = &geometry.camera;
    let fit = revolute::fit(camera, &sightings(camera, frames))?;
    let distance = match kind.side_m {
        Some(side_m) => axis_distance::from_side(camera, frames, &fit, side_m),
        None => axis_distance::from_stripe(geometry, frames, &fit),
    }?;
    let point_m = fit.point * distance.meters;
    let quality = AxisQuality {
        rms_px: Some(fit.rms_px),
        direction_sigma_rad: Some(fit.sigma[0]),
        point_sigma_m: Some(fit.sigma[1] * distance.meters),
        ..AxisQuality::default()
    };
    let shown = fit.angles.clone();
    let way = (AxisKind::Revolute, point_m, fit.direction);
    Ok(Found { circles: Some((fit, distance)), ..found(frames, shown, way, &quality)? })
}

fn of_board(camera: &Camera, frames: &Frames, target: &Checkerboard) -> anyhow::Result<Found> {
    let boards = || frames.shown.iter().filter_map(|shown| shown.board.as_ref());
    let poses: Option<Vec<_>> =
        boards().map(|board| pose::fit(camera, &board.pairs(target.square_m))).collect();
    let poses = poses.context("the camera cannot see one of the boards")?;
    let placed: Vec<_> = boards().zip(&poses).collect();
    let fit = board_axis::fit(target, &placed)?;
    let quality = AxisQuality {
        rms_m: Some(fit.rms_m),
        direction_sigma_rad: Some(fit.direction_sigma_rad),
        point_sigma_m: (fit.kind == AxisKind::Revolute)
            .then(|| fit.rms_m / (poses.len() as f64).sqrt()),
        ..AxisQuality::default()
    };
    found(frames, fit.shown, (fit.kind, fit.point_m, fit.direction), &quality)
}

/// The axis of a way, its sense and unit by what was stated.
fn found(
    frames: &Frames,
    shown: Vec<f64>,
    (kind, point_m, direction): (AxisKind, Point3<f64>, Unit<Vector3<f64>>),
    quality: &AxisQuality,
) -> anyhow::Result<Found> {
    let pairs = frames.stated.iter().zip(&shown);
    let pairs: Vec<_> = pairs.map(|(&stated, &shown)| Position { stated, shown }).collect();
    let agreement = positions::compare(&pairs)?;
    // The position grows where the direction points, or as a right hand turns about it.
    let direction = Unit::new_unchecked(direction.into_inner() * agreement.scale.signum());
    let axis = Axis { kind, point_m, direction, scale: agreement.scale_to_write() };
    let quality = AxisQuality {
        positions_used: shown.len() as u32,
        scale_sigma: Some(agreement.scale_sigma),
        ..quality.clone()
    };
    Ok(Found { axis, quality, shown, agreement, circles: None })
}

/// The markers' middles: where the diagonals of their corners cross, without the lens's distortion.
fn sightings(camera: &Camera, frames: &Frames) -> Vec<Sighting> {
    let mut sightings = Vec::new();
    for (frame, shown) in frames.shown.iter().enumerate() {
        for marker in &shown.markers {
            let Some(number) = frames.ids.iter().position(|id| *id == marker.id) else { continue };
            let Some(seen) = middle(camera, marker) else { continue };
            sightings.push(Sighting { frame, marker: number, seen });
        }
    }
    sightings
}

fn middle(camera: &Camera, marker: &Marker) -> Option<Point2<f64>> {
    let mut rays = [Vector3::zeros(); 4];
    for (ray, corner) in rays.iter_mut().zip(marker.corners) {
        *ray = camera.ray(corner)?;
    }
    let diagonal = rays[0].cross(&rays[2]).cross(&rays[1].cross(&rays[3]));
    let towards = if diagonal.z < 0.0 { -diagonal } else { diagonal };
    camera.project(towards.into())
}

impl Frames {
    fn refuse_another_size(&self, camera: &Camera) -> anyhow::Result<()> {
        let expected = [camera.width_px, camera.height_px];
        match self.shown.iter().find(|shown| shown.size_px != expected) {
            None => Ok(()),
            Some(Shown { size_px, .. }) => bail!(
                "the pictures have {} x {} pixels, the calibrated camera {} x {}: another camera's, or scaled",
                size_px[0],
                size_px[1],
                expected[0],
                expected[1]
            ),
        }
    }

    /// Where pictures went.
    fn told(&self) -> String {
        format!(
            "{} pictures take part; {} are not used\n{}",
            self.names.len(),
            self.rejected.len(),
            rejected::text(&self.rejected)
        )
    }
}
