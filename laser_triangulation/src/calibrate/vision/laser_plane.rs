//! The laser's plane through its lines on many boards.

use nalgebra::{Matrix3, Point3, Unit, Vector3};
use thiserror::Error;

use super::{
    camera_response::CameraResponse,
    laser_lines::{BoardLine, LaserLines},
    plane_response::Source,
};
use crate::{
    scanner::{
        calibration::{
            CalibratedVolume, CameraAndPlane, CameraCalibration, CameraQuality, PlaneQuality, range,
        },
        camera::Camera,
        laser_plane::LaserPlane,
    },
    statistics::median,
};

/// Fewest boards: the scatter between them determines the uncertainty.
const MIN_BOARDS: usize = 4;
/// Boards that the robust initial fit combines three at a time.
const MAX_TRIED: usize = 24;
/// A board is an outlier if its line lies this many times farther from the plane than the median board's.
const OUTLIER_FACTOR: f64 = 4.0;
/// Lines that lie within this share of their distance of a straight line determine no plane.
const MIN_SPREAD: f64 = 0.01;

/// Largest root mean square distance from the plane, relative to the distance from the camera.
const MAX_RMS: f64 = 0.01;

/// The residual of one board's line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardResidual {
    /// Index of the board.
    pub index: usize,
    /// Points of the line.
    pub points: usize,
    /// Mean signed distance, away from the camera, metres.
    pub mean_m: f64,
    /// Root mean square distance, metres.
    pub rms_m: f64,
}

/// A calibrated laser plane.
#[derive(Clone, Debug)]
pub struct LaserPlaneFit {
    /// The plane.
    pub plane: LaserPlane,
    /// Root mean square distance of all points, metres.
    pub rms_m: f64,
    /// Boards that were used.
    pub used: Vec<BoardResidual>,
    /// Boards that contradict the others.
    pub outliers: Vec<BoardResidual>,
    /// Covariance of two tilts of the normal along [`LaserPlane::tangents`], radians, and of the distance, metres, with this
    /// camera: estimated by leaving out one board at a time, because all points of a board share its errors, and that of
    /// the board's bend. The camera's own share is [`camera_covariance`](Self::camera_covariance).
    pub covariance: Matrix3<f64>,
    /// How the plane follows the camera; `None` if the camera's covariance is unknown.
    camera_response: Option<CameraResponse<3>>,
    /// Both ends of every line that was used, in the camera's frame, metres.
    pub ends_m: Vec<Point3<f64>>,
}

/// The reason why lines determine no plane.
#[derive(Debug, Error, PartialEq)]
pub enum LaserPlaneError {
    /// Too few lines.
    #[error(
        "boards with a usable line: {usable}, at least {MIN_BOARDS} are needed (20 are good): hold the board into the laser \
         near and far and tilted, with the line across its squares. If the pictures show it, its direction may be another: \
         stripe_direction is horizontal for a line from left to right, vertical for one from top to bottom"
    )]
    Few {
        /// Boards with a line.
        usable: usize,
    },
    /// All lines coincide.
    #[error(
        "all laser lines lie within {spread_mm:.1} mm of one straight line in space, and any plane through it would do: \
         move the board nearer and farther, or tilt it about the line, between the pictures"
    )]
    OneLine {
        /// Standard deviation across that line, millimetres.
        spread_mm: f64,
    },
    /// The lines contradict each other.
    #[error(
        "the lines lie {rms_mm:.1} mm from the best plane, which is no plane: check that the bright line on the boards is the laser, and that the \
         target's size is right"
    )]
    NoPlane {
        /// Root mean square distance, millimetres.
        rms_mm: f64,
    },
    /// The plane is not in front of the camera.
    #[error(
        "the lines' plane passes through the lens: the laser must not shine along the camera's view"
    )]
    ThroughLens,
    /// The boards cannot be placed with a camera, or a bend, within the uncertainty.
    #[error(
        "a camera (or a bend of the board) that differs by a hundredth of its stated standard deviation does not see these \
         boards: calibrate the camera again, from more views"
    )]
    Loose,
}

/// Fits the plane by least squares of distances, without boards that contradict the others. `quality` is that of the
/// camera with which the lines were found: the plane inherits its uncertainty.
///
/// # Errors
/// Too few boards, lines that determine no plane, or a camera so uncertain that the boards cannot be placed with it.
pub fn calibrate_plane(
    found: &LaserLines,
    quality: Option<&CameraQuality>,
) -> Result<LaserPlaneFit, LaserPlaneError> {
    let boards = &found.lines;
    if boards.len() < MIN_BOARDS {
        return Err(LaserPlaneError::Few { usable: boards.len() });
    }
    let mut kept: Vec<_> = boards.iter().collect();
    let mut start = robust_start(boards)?;
    let mut outliers = Vec::new();
    loop {
        let found: Vec<_> = find_outliers(&kept, &start);
        kept.retain(|board| !found.iter().any(|outlier| outlier.index == board.index));
        if kept.len() < MIN_BOARDS {
            return Err(LaserPlaneError::Few { usable: kept.len() });
        }
        start = least_squares(&kept)?;
        let is_settled = found.is_empty();
        outliers.extend(found);
        if is_settled {
            break;
        }
    }
    outliers.sort_by_key(|outlier| outlier.index);
    let used: Vec<_> = kept.iter().map(|board| residual(board, &start)).collect();
    let points: usize = used.iter().map(|board| board.points).sum();
    let squares = used.iter().map(|board| board.points as f64 * board.rms_m.powi(2));
    let rms_m = (squares.sum::<f64>() / points as f64).sqrt();
    let distances_m =
        kept.iter().flat_map(|board| &board.line.points).map(|point| point.coords.norm());
    if rms_m > MAX_RMS * distances_m.sum::<f64>() / points as f64 {
        return Err(LaserPlaneError::NoPlane { rms_mm: 1e3 * rms_m });
    }
    let source = Source { found, kept: &kept, plane: start };
    let of_bend = source.of_bend().ok_or(LaserPlaneError::Loose)?;
    let covariance = leave_one_out(&kept, &start)? + of_bend;
    let known = quality.filter(|quality| quality.has_covariance());
    let response = |quality| source.of_camera(quality).ok_or(LaserPlaneError::Loose);
    let camera_response = known.map(response).transpose()?;
    let ends = kept.iter().flat_map(|board| {
        let points = &board.line.points;
        [points.first(), points.last()].into_iter().flatten().copied()
    });
    let ends_m = ends.collect();
    Ok(LaserPlaneFit { plane: start, rms_m, used, outliers, covariance, camera_response, ends_m })
}

impl LaserPlaneFit {
    /// Returns the covariance that the camera's gives the plane, in the order of [`covariance`](Self::covariance); `None` if
    /// the camera's is unknown.
    #[must_use]
    pub fn camera_covariance(&self) -> Option<Matrix3<f64>> {
        self.camera_response.as_ref().map(|response| response.covariance)
    }

    /// Returns one standard deviation of the two tilts of the normal, radians, and of the distance, metres, the camera's
    /// share included if it is known.
    #[must_use]
    pub fn sigmas(&self) -> [f64; 3] {
        let all = self.covariance + self.camera_covariance().unwrap_or_default();
        std::array::from_fn(|i| all[(i, i)].sqrt())
    }

    /// Returns the calibration of camera and plane, without an axis and without a date. `frame_id` names the frame of the
    /// profiles.
    #[must_use]
    pub fn calibration(&self, camera: CameraCalibration, frame_id: &str) -> CameraAndPlane {
        let covariance = std::array::from_fn(|i| self.covariance[(i / 3, i % 3)]);
        CameraAndPlane {
            frame_id: frame_id.to_owned(),
            camera_name: camera.camera_name,
            camera: camera.camera,
            camera_quality: camera.quality,
            plane: self.plane,
            plane_quality: Some(PlaneQuality {
                rms_m: self.rms_m,
                boards_used: self.used.len() as u32,
                covariance: Some(covariance),
                camera_response: self.camera_response.as_ref().map(CameraResponse::rows),
                volume: self.volume(&camera.camera),
            }),
            alignment: None,
            part: None,
            axis: None,
            axis_quality: None,
            calibrated_at: None,
        }
    }

    /// Returns the part of the image, and the depths, that the lines covered.
    fn volume(&self, camera: &Camera) -> Option<CalibratedVolume> {
        let depths_m = range(self.ends_m.iter().map(|end| end.z));
        let seen = self.ends_m.iter().filter_map(|end| Some(camera.project(*end)?.0));
        let of_image = CalibratedVolume::of_positions(seen)?;
        Some(CalibratedVolume { depths_m, ..of_image })
    }

    /// Describes how a board contradicts the others.
    #[must_use]
    pub fn describe_outlier(&self, outlier: &BoardResidual) -> String {
        format!(
            "the line lies {:.2} mm from the other boards' plane, all others {:.2} mm: the board moved or bends",
            1e3 * outlier.rms_m,
            1e3 * self.rms_m
        )
    }
}

/// Returns the plane through three boards' lines with the least median distance of all boards.
fn robust_start(boards: &[BoardLine]) -> Result<LaserPlane, LaserPlaneError> {
    let every = boards.len().div_ceil(MAX_TRIED);
    let tried: Vec<_> = boards.iter().step_by(every).collect();
    let mut best: Option<(f64, LaserPlane)> = None;
    for i in 0..tried.len() {
        for j in i + 1..tried.len() {
            for k in j + 1..tried.len() {
                let Ok(plane) = least_squares(&[tried[i], tried[j], tried[k]]) else { continue };
                let mut all: Vec<_> =
                    boards.iter().map(|board| residual(board, &plane).rms_m).collect();
                let middle = median(&mut all).unwrap_or(f64::NAN);
                if best.as_ref().is_none_or(|(least, _)| middle < *least) {
                    best = Some((middle, plane));
                }
            }
        }
    }
    let all = || least_squares(&boards.iter().collect::<Vec<_>>());
    // If no three boards determine a plane, all lines coincide, and least squares reports it.
    best.map_or_else(all, |(_, plane)| Ok(plane))
}

fn find_outliers(boards: &[&BoardLine], plane: &LaserPlane) -> Vec<BoardResidual> {
    let residuals: Vec<_> = boards.iter().map(|board| residual(board, plane)).collect();
    let mut all_m: Vec<_> = residuals.iter().map(|board| board.rms_m).collect();
    let limit_m = OUTLIER_FACTOR * median(&mut all_m).unwrap_or(f64::NAN);
    residuals.into_iter().filter(|board| board.rms_m > limit_m && board.rms_m > 1e-9).collect()
}

fn residual(board: &BoardLine, plane: &LaserPlane) -> BoardResidual {
    let count = board.line.points.len() as f64;
    let distances =
        || board.line.points.iter().map(|p| plane.normal.dot(&p.coords) - plane.distance_m);
    BoardResidual {
        index: board.index,
        points: board.line.points.len(),
        mean_m: distances().sum::<f64>() / count,
        rms_m: (distances().map(|d| d * d).sum::<f64>() / count).sqrt(),
    }
}

fn least_squares(boards: &[&BoardLine]) -> Result<LaserPlane, LaserPlaneError> {
    plane_through(boards.iter().flat_map(|board| &board.line.points))
}

/// Fits the plane with equal weights for all points.
///
/// # Errors
/// Points that determine no plane.
pub(super) fn plane_through<'a>(
    points: impl Iterator<Item = &'a Point3<f64>> + Clone,
) -> Result<LaserPlane, LaserPlaneError> {
    let count = points.clone().count() as f64;
    let sum = points.clone().map(|point| point.coords).sum::<Vector3<f64>>();
    let middle = sum / count;
    let spread: Matrix3<f64> = points
        .map(|point| {
            let off = point.coords - middle;
            off * off.transpose()
        })
        .sum();
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let sigma = |i: usize| (eigen.eigenvalues[order[i]].max(0.0) / count).sqrt();
    if sigma(1) < MIN_SPREAD * middle.norm() || sigma(1) < 4.0 * sigma(0) {
        return Err(LaserPlaneError::OneLine { spread_mm: 1e3 * sigma(1) });
    }
    let normal = eigen.eigenvectors.column(order[0]).into_owned();
    let normal = if normal.dot(&middle) < 0.0 { -normal } else { normal };
    let distance_m = normal.dot(&middle);
    if distance_m < 1e-6 {
        return Err(LaserPlaneError::ThroughLens);
    }
    Ok(LaserPlane { normal: Unit::new_normalize(normal), distance_m })
}

/// Returns the two tilts, radians, and the growth of the distance, metres, from one plane to another nearby.
pub(super) fn offset(plane: &LaserPlane, other: &LaserPlane) -> Vector3<f64> {
    let [a, b] = plane.tangents().map(|tangent| tangent.dot(&other.normal));
    Vector3::new(a, b, other.distance_m - plane.distance_m)
}

/// The jackknife (Efron and Stein 1981): `(n - 1) / n · Σ (θᵢ - θ̄)²`, θᵢ without board i; times `(n - 1) / (n - 3)`, the
/// variance of Student's t with n - 1 degrees of freedom, because few boards know their own scatter badly.
fn leave_one_out(
    boards: &[&BoardLine],
    plane: &LaserPlane,
) -> Result<Matrix3<f64>, LaserPlaneError> {
    let mut found = Vec::with_capacity(boards.len());
    for left_out in 0..boards.len() {
        let others: Vec<_> =
            (0..boards.len()).filter(|&i| i != left_out).map(|i| boards[i]).collect();
        found.push(offset(plane, &least_squares(&others)?));
    }
    let count = found.len() as f64;
    let mean = found.iter().sum::<Vector3<f64>>() / count;
    let squares = found.iter().map(|one| (one - mean) * (one - mean).transpose());
    let few = (count - 1.0) / (count - 3.0);
    Ok(squares.sum::<Matrix3<f64>>() * (few * (count - 1.0) / count))
}

#[cfg(test)]
mod tests;
