//! Checks that a set of boards determines a camera, and reports which kind of view is missing.

use nalgebra::Vector3;
use thiserror::Error;

use super::{board::Board, homography, pose};
use crate::scanner::camera::{Camera, DistortedPixel, Distortion};

/// Fewest views for a solution.
const MIN_VIEWS: usize = 5;
/// Least standard deviation of the boards' inclination about either axis, degrees.
const MIN_TILT_DEG: f64 = 4.0;
/// Boards whose normals all lie within this angle of their mean count as parallel, degrees.
const PARALLEL_DEG: f64 = 5.0;
/// Names of the ninths of the image, row by row.
const NINTHS: [&str; 9] = [
    "top left",
    "top",
    "top right",
    "left",
    "centre",
    "right",
    "bottom left",
    "bottom",
    "bottom right",
];
/// Ninths of the image that must show corners.
const MIN_NINTHS: usize = 6;

/// The reason why views do not determine a camera, with a remedy.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MissingViews {
    /// Too few views.
    #[error(
        "usable views: {usable}, at least {MIN_VIEWS} are needed (20 are good): the board nearer and farther, in the middle \
         and in the corners of the image, tilted by 20 to 40 degrees each way"
    )]
    Views {
        /// Views with a board that can be used.
        usable: usize,
    },
    /// All boards have the same orientation.
    #[error(
        "all boards are parallel within {spread_deg:.1} degrees, which leaves the focal length open: tilt the board by 20 \
         to 40 degrees, to the left and to the right (about its vertical axis) and forwards and backwards (about its \
         horizontal axis)"
    )]
    Orientation {
        /// Largest angle between a board's normal and their mean, degrees.
        spread_deg: f64,
    },
    /// The boards are never tilted about one of the axes.
    #[error(
        "the boards are tilted about the image's {axis} axis by only {sigma_deg:.1} degrees (standard deviation), which \
         leaves the principal point open: tilt the board about that axis by 20 to 40 degrees, {how}"
    )]
    Tilt {
        /// The image's vertical or horizontal axis.
        axis: &'static str,
        /// Standard deviation of the inclination, degrees.
        sigma_deg: f64,
        /// Directions in which to tilt the board.
        how: &'static str,
    },
    /// The boards are always in one part of the image.
    #[error(
        "no view has corners of the board in these parts of the image: {}. The lens is not measured there: hold the \
         board into them", .parts.join(", ")
    )]
    Parts {
        /// Parts of the image without corners.
        parts: Vec<&'static str>,
    },
}

/// Checks the number of views, the coverage of the image, and that the boards are not all parallel. Needs no
/// calibration.
///
/// # Errors
/// The first check that fails.
pub(super) fn check_views(
    boards: &[&Board],
    width_px: u32,
    height_px: u32,
) -> Result<(), MissingViews> {
    if boards.len() < MIN_VIEWS {
        return Err(MissingViews::Views { usable: boards.len() });
    }
    let parts = empty_parts(boards, width_px, height_px);
    if NINTHS.len() - parts.len() < MIN_NINTHS {
        return Err(MissingViews::Parts { parts });
    }
    // A rough guess suffices to detect parallel boards: a focal length equal to the image's longer side.
    let long_side = f64::from(width_px.max(height_px));
    let guess = Camera {
        width_px,
        height_px,
        fx_px: long_side,
        fy_px: long_side,
        cx_px: f64::from(width_px - 1) / 2.0,
        cy_px: f64::from(height_px - 1) / 2.0,
        distortion: Distortion::None,
        tilt_rad: [0.0; 2],
    };
    let normals: Vec<_> = boards.iter().filter_map(|board| normal(&guess, board)).collect();
    let spread_deg = spread_deg(&normals);
    if spread_deg < PARALLEL_DEG {
        return Err(MissingViews::Orientation { spread_deg });
    }
    Ok(())
}

/// Checks the inclinations of the solution: `normals` of the boards, towards the camera.
///
/// # Errors
/// An axis about which the boards are not tilted.
pub(super) fn check_tilts(normals: &[Vector3<f64>]) -> Result<(), MissingViews> {
    let sigma = |angle: &dyn Fn(&Vector3<f64>) -> f64| {
        let angles: Vec<_> = normals.iter().map(|normal| angle(normal).to_degrees()).collect();
        let mean = angles.iter().sum::<f64>() / angles.len() as f64;
        (angles.iter().map(|angle| (angle - mean).powi(2)).sum::<f64>() / angles.len() as f64)
            .sqrt()
    };
    let about_vertical = sigma(&|normal| normal.x.atan2(-normal.z));
    let about_horizontal = sigma(&|normal| normal.y.atan2(-normal.z));
    for (axis, sigma_deg, how) in [
        ("vertical", about_vertical, "to the left and to the right"),
        ("horizontal", about_horizontal, "forwards and backwards"),
    ] {
        if sigma_deg < MIN_TILT_DEG {
            return Err(MissingViews::Tilt { axis, sigma_deg, how });
        }
    }
    Ok(())
}

/// Returns the ninths of the image without any corner.
pub(super) fn empty_parts(boards: &[&Board], width_px: u32, height_px: u32) -> Vec<&'static str> {
    let mut is_seen = [false; 9];
    for corner in boards.iter().flat_map(|board| &board.corners) {
        let ninth =
            |at: f64, size: u32| ((at + 0.5) / f64::from(size) * 3.0).clamp(0.0, 2.0) as usize;
        is_seen[3 * ninth(corner.seen.y, height_px) + ninth(corner.seen.x, width_px)] = true;
    }
    NINTHS.into_iter().zip(is_seen).filter(|(_, seen)| !seen).map(|(name, _)| name).collect()
}

fn normal(camera: &Camera, board: &Board) -> Option<Vector3<f64>> {
    let ray = |seen| Some(camera.ray(DistortedPixel(seen))?.xy().into());
    let pairs: Option<Vec<_>> =
        board.pairs(1.0).into_iter().map(|(on, seen)| Some((on, ray(seen)?))).collect();
    let pose = pose::from_homography(&homography::fit(&pairs?)?)?;
    let normal = pose.rotation * Vector3::z();
    Some(if normal.z > 0.0 { -normal } else { normal })
}

/// Returns the largest angle between a normal and their mean, degrees.
fn spread_deg(normals: &[Vector3<f64>]) -> f64 {
    let mean: Vector3<f64> = normals.iter().sum();
    normals.iter().map(|normal| normal.angle(&mean).to_degrees()).fold(0.0, f64::max)
}
