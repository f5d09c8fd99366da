//! The axis that moves the part, from markers that turn with it or a board that moves with it.

use nalgebra::{Point3, Unit, Vector3};
use thiserror::Error;

use super::{
    axis_distance::{self, DistanceError, TableDistance},
    axis_response,
    board::{Board, BoardRejected},
    board_axis::{self, BoardAxisError},
    board_bend::{self, BoardBend},
    board_shape::BoardShape,
    circle_centres::with_true_centres,
    laser_finder::LitCenterline,
    markers::{Marker, MarkerDetector, MarkerKind},
    picture::GrayPicture,
    pose,
    positions::{self, Agreement, Position, PositionError},
    revolute::{self, RevoluteError, RevoluteFit, Sighting},
    target::Target,
    target_detector::{TargetDetector, TargetDetectorError},
};
use crate::scanner::{
    axis::{Axis, AxisKind},
    calibration::{AxisQuality, CameraAndPlane},
    camera::{Camera, DistortedPixel},
};

/// Fewest pictures in which a marker must be visible.
const MIN_SEEN: usize = 3;
/// Fewest corners of a board whose corners are numbered. Another board must be entirely visible: a part of it is ambiguous.
const MIN_NUMBERED: usize = 12;

/// The target that moves with the part.
#[derive(Clone, Copy, Debug)]
pub enum AxisTarget {
    /// Markers on a turning table.
    Markers(MarkerKind),
    /// A board.
    Board(Target),
}

/// The target as seen in one picture.
#[derive(Clone, Debug, PartialEq)]
pub enum SeenTarget {
    /// At least one marker.
    Markers(Vec<Marker>),
    /// The board.
    Board(Board),
}

/// The reason why a picture shows no target.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TargetRejected {
    /// No marker.
    #[error("no marker")]
    NoMarker,
    /// No usable board.
    #[error(transparent)]
    Board(#[from] BoardRejected),
}

/// Finds the target in pictures.
#[expect(missing_debug_implementations, reason = "the grid detector has none")]
pub struct AxisTargetDetector(Detector);

enum Detector {
    Markers(MarkerDetector),
    Board(TargetDetector),
}

impl AxisTargetDetector {
    /// Creates a detector. A board must be entirely visible, but for a `ChArUco` board.
    ///
    /// # Errors
    /// Never for a target that was read from text.
    pub fn new(target: &AxisTarget) -> Result<Self, TargetDetectorError> {
        Ok(Self(match target {
            AxisTarget::Markers(kind) => Detector::Markers(MarkerDetector::new(kind)),
            AxisTarget::Board(board) => {
                let min_points =
                    if board.is_numbered() { MIN_NUMBERED } else { board.num_points() };
                Detector::Board(TargetDetector::new(board, min_points)?)
            }
        }))
    }

    /// Finds the target in a picture.
    ///
    /// # Errors
    /// No marker, or no usable board.
    pub fn detect(&self, picture: &GrayPicture) -> Result<SeenTarget, TargetRejected> {
        match &self.0 {
            Detector::Markers(detector) => {
                let markers = detector.detect(picture);
                if markers.is_empty() {
                    return Err(TargetRejected::NoMarker);
                }
                Ok(SeenTarget::Markers(markers))
            }
            Detector::Board(detector) => Ok(SeenTarget::Board(detector.detect(picture)?)),
        }
    }
}

/// A picture of the target at a stated position of the axis.
#[derive(Clone, Debug)]
pub struct AxisView {
    /// Columns and rows of the picture.
    pub size_px: [u32; 2],
    /// Position reported by the joint or encoder, in its unit.
    pub stated: f64,
    /// The target.
    pub target: SeenTarget,
    /// Stripe of the picture, in each light that was tried. Only needed for markers of unknown size.
    pub stripes: Vec<LitCenterline>,
}

impl AxisView {
    /// Returns the markers that the picture shows.
    #[must_use]
    pub fn markers(&self) -> &[Marker] {
        match &self.target {
            SeenTarget::Markers(markers) => markers,
            SeenTarget::Board(_) => &[],
        }
    }

    /// Returns the board that the picture shows.
    #[must_use]
    pub const fn board(&self) -> Option<&Board> {
        match &self.target {
            SeenTarget::Markers(_) => None,
            SeenTarget::Board(board) => Some(board),
        }
    }
}

/// The circles of markers about a rotary axis.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerCircles {
    /// Numbers of the markers that enough pictures show, ascending.
    pub ids: Vec<u32>,
    /// Radius of each marker's circle, metres.
    pub radii_m: Vec<f64>,
    /// Distance of the markers' plane from the lens.
    pub distance: TableDistance,
}

/// A calibrated axis.
#[derive(Clone, Debug)]
pub struct AxisFit {
    /// The axis, in the camera's frame.
    pub axis: Axis,
    /// Residuals and uncertainties.
    pub quality: AxisQuality,
    /// Position of every view relative to the first, radians or metres, with arbitrary sign.
    pub shown: Vec<f64>,
    /// Agreement of reported and observed positions.
    pub agreement: Agreement,
    /// Circles of the markers; `None` for a board.
    pub circles: Option<MarkerCircles>,
    /// The board's bend under the given camera; `None` for markers, and for a board that is flat within the uncertainty.
    pub bend: Option<BoardBend>,
}

/// The reason why pictures determine no axis.
#[derive(Debug, Error)]
pub enum AxisError {
    /// The size of the pictures differs from the camera's.
    #[error(
        "the pictures have {} x {} pixels, the calibrated camera {} x {}: another camera's, or scaled",
        .pictures[0], .pictures[1], .camera[0], .camera[1]
    )]
    Size {
        /// Columns and rows of a picture.
        pictures: [u32; 2],
        /// Columns and rows of the calibrated camera.
        camera: [u32; 2],
    },
    /// No pose of a board explains its corners.
    #[error("no pose in front of this camera explains one of the boards")]
    NoPose,
    /// The markers turn about no axis.
    #[error(transparent)]
    Markers(#[from] RevoluteError),
    /// The distance of the markers is unknown.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// The board moves along no axis.
    #[error(transparent)]
    Board(#[from] BoardAxisError),
    /// Reported and observed positions do not match.
    #[error(transparent)]
    Position(#[from] PositionError),
}

/// Calibrates the axis from views of the target, all of the kind that `target` states.
///
/// # Errors
/// Pictures of another size than the camera's, views that determine no axis, or positions that contradict the views.
pub fn calibrate_axis(
    geometry: &CameraAndPlane,
    target: &AxisTarget,
    views: &[AxisView],
) -> Result<AxisFit, AxisError> {
    let camera = [geometry.camera.width_px, geometry.camera.height_px];
    if let Some(view) = views.iter().find(|view| view.size_px != camera) {
        return Err(AxisError::Size { pictures: view.size_px, camera });
    }
    let mut fit = fitted(geometry, target, views, None)?;
    fit.quality.camera_response = axis_response::find(geometry, &fit.axis, |other| {
        Some(fitted(other, target, views, Some(&fit)).ok()?.axis)
    });
    Ok(fit)
}

/// Fits the axis; `near` is that of a similar camera, if it is known.
fn fitted(
    geometry: &CameraAndPlane,
    target: &AxisTarget,
    views: &[AxisView],
    near: Option<&AxisFit>,
) -> Result<AxisFit, AxisError> {
    match target {
        AxisTarget::Markers(kind) => {
            of_markers(geometry, views, kind, near.map(|near| near.axis.direction))
        }
        AxisTarget::Board(board) => of_board(&geometry.camera, views, board, near),
    }
}

impl AxisFit {
    /// Puts the axis into a calibration. A part's frame is dropped: it was defined in the frame of the previous axis.
    pub fn apply_to(&self, geometry: &mut CameraAndPlane) {
        geometry.axis = Some(self.axis);
        geometry.axis_quality = Some(self.quality.clone());
        geometry.part = None;
    }
}

fn of_markers(
    geometry: &CameraAndPlane,
    views: &[AxisView],
    kind: &MarkerKind,
    near: Option<Unit<Vector3<f64>>>,
) -> Result<AxisFit, AxisError> {
    let camera = &geometry.camera;
    let ids = ids(views);
    let fit = revolute::fit(camera, &sightings(camera, views, &ids), near)?;
    let distance = match kind.side_m {
        Some(side_m) => axis_distance::from_side(camera, views, &fit, side_m),
        None => axis_distance::from_stripe(geometry, views, &fit),
    }?;
    let RevoluteFit { direction, point, angles, radii, rms_px, sigma } = fit;
    let quality = AxisQuality {
        rms_px: Some(rms_px),
        direction_sigma_rad: Some(sigma[0]),
        point_sigma_m: Some(sigma[1] * distance.distance_m),
        ..AxisQuality::default()
    };
    let way =
        Way { kind: AxisKind::Revolute, point_m: point * distance.distance_m, direction, quality };
    let radii_m = radii.iter().map(|radius| radius * distance.distance_m).collect();
    let circles = Some(MarkerCircles { ids, radii_m, distance });
    Ok(AxisFit { circles, ..with_positions(views, angles, way)? })
}

fn of_board(
    camera: &Camera,
    views: &[AxisView],
    target: &Target,
    near: Option<&AxisFit>,
) -> Result<AxisFit, AxisError> {
    let square_m = target.unit_m();
    let seen: Vec<_> = views.iter().filter_map(AxisView::board).cloned().collect();
    let boards = with_true_centres(camera, &seen, square_m);
    let boards: Vec<_> = boards.iter().collect();
    let bend = match near {
        Some(near) => near.bend,
        None => board_bend::find(&boards, square_m, camera, &[]).map(|(bend, _)| bend),
    };
    let shape = bend
        .map_or(Some(BoardShape::default()), |bend| bend.accounted_under(camera, &boards, square_m))
        .ok_or(AxisError::NoPose)?;
    let poses: Option<Vec<_>> =
        boards.iter().map(|board| pose::fit(camera, &board.points(square_m, &shape))).collect();
    let poses = poses.ok_or(AxisError::NoPose)?;
    let placed: Vec<_> = boards.iter().copied().zip(&poses).collect();
    let fit = board_axis::fit(target, &placed)?;
    let quality = AxisQuality {
        rms_m: Some(fit.rms_m),
        direction_sigma_rad: Some(fit.direction_sigma_rad),
        point_sigma_m: (fit.kind == AxisKind::Revolute)
            .then(|| fit.rms_m / (poses.len() as f64).sqrt()),
        ..AxisQuality::default()
    };
    let way = Way { kind: fit.kind, point_m: fit.point_m, direction: fit.direction, quality };
    Ok(AxisFit { bend, ..with_positions(views, fit.shown, way)? })
}

/// An axis of unknown sign and unit.
struct Way {
    kind: AxisKind,
    point_m: Point3<f64>,
    direction: Unit<Vector3<f64>>,
    quality: AxisQuality,
}

/// Takes sign and unit of the axis from the reported positions.
fn with_positions(views: &[AxisView], shown: Vec<f64>, way: Way) -> Result<AxisFit, PositionError> {
    let pairs = views.iter().zip(&shown);
    let pairs: Vec<_> =
        pairs.map(|(view, &shown)| Position { stated: view.stated, shown }).collect();
    let agreement = positions::compare(&pairs)?;
    let Way { kind, point_m, direction, quality } = way;
    // The position grows along the direction, or by the right-hand rule about it.
    let direction = Unit::new_unchecked(direction.into_inner() * agreement.scale.signum());
    let axis = Axis { kind, point_m, direction, scale: agreement.scale_to_write() };
    let quality = AxisQuality {
        positions_used: shown.len() as u32,
        scale_sigma: Some(agreement.scale_sigma),
        ..quality
    };
    Ok(AxisFit { axis, quality, shown, agreement, circles: None, bend: None })
}

/// Returns the numbers of the markers that enough views show, ascending.
fn ids(views: &[AxisView]) -> Vec<u32> {
    let seen = || views.iter().flat_map(AxisView::markers).map(|marker| marker.id);
    let mut ids: Vec<_> = seen().collect();
    ids.sort_unstable();
    ids.dedup();
    ids.retain(|&id| seen().filter(|&other| other == id).count() >= MIN_SEEN);
    ids
}

/// Returns the centres of the markers: the intersections of their diagonals, without lens distortion.
fn sightings(camera: &Camera, views: &[AxisView], ids: &[u32]) -> Vec<Sighting> {
    let mut sightings = Vec::new();
    for (frame, view) in views.iter().enumerate() {
        for marker in view.markers() {
            let Some(number) = ids.iter().position(|id| *id == marker.id) else { continue };
            let Some(seen) = middle(camera, marker) else { continue };
            sightings.push(Sighting { frame, marker: number, seen });
        }
    }
    sightings
}

fn middle(camera: &Camera, marker: &Marker) -> Option<DistortedPixel> {
    let mut rays = [Vector3::zeros(); 4];
    for (ray, corner) in rays.iter_mut().zip(marker.corners) {
        *ray = camera.ray(DistortedPixel(corner))?;
    }
    let diagonal = rays[0].cross(&rays[2]).cross(&rays[1].cross(&rays[3]));
    let towards = if diagonal.z < 0.0 { -diagonal } else { diagonal };
    camera.project(towards.into())
}
