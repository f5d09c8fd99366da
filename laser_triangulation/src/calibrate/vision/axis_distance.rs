//! The distance of turning markers, which their images alone do not determine.

use std::fmt;

use nalgebra::{Point2, Point3, Vector3};
use thiserror::Error;

use super::{axis::AxisView, revolute::RevoluteFit};
use crate::{
    scanner::{
        calibration::CameraAndPlane,
        camera::{Camera, DistortedPixel},
    },
    statistics::{RobustSpread, robust_spread},
};

/// Fewest points of the stripe on the table.
const MIN_POINTS: usize = 200;
/// Largest robust standard deviation of their distances, relative to the distance.
const MAX_SPREAD: f64 = 0.02;
/// Share of the smallest marker circle inside which the table is assumed to be flat.
const INSIDE: f64 = 0.95;

/// The distance from the lens to the plane of the markers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableDistance {
    /// Distance, metres.
    pub distance_m: f64,
    /// Robust standard deviation of the underlying samples, metres.
    pub spread_m: f64,
    /// Origin of the distance.
    pub source: DistanceSource,
}

/// The origin of a [`TableDistance`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DistanceSource {
    /// The known side of the markers' black squares.
    MarkerSide,
    /// The laser's line on the table.
    LaserLine,
}

impl fmt::Display for DistanceSource {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::MarkerSide => "the side of the markers",
            Self::LaserLine => "the laser's line on the table",
        })
    }
}

/// The reason why the distance of the markers is unknown.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DistanceError {
    /// The camera model is not valid at any marker.
    #[error("no marker's side can be measured")]
    NoSide,
    /// Too few points of the line are on the table.
    #[error(
        "the laser's line on the table inside the circle of the markers has only {points} points: give the markers' side \
         (aruco:DICTIONARY:SIDE), or make the line visible (--params-file)"
    )]
    FewPoints {
        /// Number of points found.
        points: usize,
    },
    /// The line does not lie on a flat table.
    #[error(
        "the line inside the circle of the markers varies in height by {spread_mm:.1} mm: the table is not flat, or this is \
         not the laser; give the markers' side (aruco:DICTIONARY:SIDE)"
    )]
    NotFlat {
        /// Robust standard deviation of the height, millimetres.
        spread_mm: f64,
    },
}

/// Returns the distance from the side of the markers' black squares.
///
/// # Errors
/// No marker lies where the camera model is valid.
pub(super) fn from_side(
    camera: &Camera,
    views: &[AxisView],
    fit: &RevoluteFit,
    side_m: f64,
) -> Result<TableDistance, DistanceError> {
    let mut sides = Vec::new();
    for marker in views.iter().flat_map(AxisView::markers) {
        let corner = |at: usize| {
            let ray = camera.ray(DistortedPixel(marker.corners[at % 4]))?;
            Some(ray / fit.direction.dot(&ray))
        };
        let side = |at: usize| Some((corner(at + 1)? - corner(at)?).norm());
        sides.extend((0..4).filter_map(side));
    }
    let RobustSpread { median, sigma } = robust_spread(&mut sides)
        .filter(|side| side.median > 0.0 && side.median.is_finite())
        .ok_or(DistanceError::NoSide)?;
    let distance_m = side_m / median;
    let spread_m = distance_m * sigma / median;
    Ok(TableDistance { distance_m, spread_m, source: DistanceSource::MarkerSide })
}

/// Returns the distance from the laser's line on the table inside the circle of the markers, by the laser plane.
///
/// # Errors
/// Too few points, or a table that is not flat.
pub(super) fn from_stripe(
    geometry: &CameraAndPlane,
    views: &[AxisView],
    fit: &RevoluteFit,
) -> Result<TableDistance, DistanceError> {
    let smallest = fit.radii.iter().copied().fold(f64::INFINITY, f64::min);
    let normal = fit.direction.into_inner();
    let on_table = |ray: &Vector3<f64>| {
        let point = Point3::from(ray / normal.dot(ray));
        (point - fit.point).norm() < INSIDE * smallest
    };
    let mut distances = Vec::new();
    for stripe in views.iter().flat_map(|view| &view.stripes) {
        let line = &stripe.centerline;
        for (&u, &v) in line.u_px.iter().zip(&line.v_px) {
            let pixel = DistortedPixel(Point2::new(u.into(), v.into()));
            let ray = geometry.camera.ray(pixel).filter(on_table);
            let point = ray.and_then(|ray| geometry.plane.meet(ray));
            distances.extend(point.map(|point| normal.dot(&point.coords)));
        }
    }
    let points = distances.len();
    let RobustSpread { median: distance_m, sigma: spread_m } = robust_spread(&mut distances)
        .filter(|_| points >= MIN_POINTS)
        .ok_or(DistanceError::FewPoints { points })?;
    if spread_m > MAX_SPREAD * distance_m {
        return Err(DistanceError::NotFlat { spread_mm: 1e3 * spread_m });
    }
    Ok(TableDistance { distance_m, spread_m, source: DistanceSource::LaserLine })
}
