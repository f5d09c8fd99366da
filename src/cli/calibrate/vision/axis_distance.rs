//! How far away turning markers are: their pictures alone do not say.

use anyhow::bail;
use nalgebra::{Point2, Point3, Vector3};

use super::axis::Frames;
use crate::statistics::{RobustSpread, robust_spread};
use crate::{
    calibrate::revolute::RevoluteFit,
    scanner::{calibration::CameraAndPlane, camera::Camera},
};

/// Fewest points of the stripe on the table.
const MIN_POINTS: usize = 200;
/// Largest robust standard deviation of their distances, as a share of the distance.
const MAX_SPREAD: f64 = 0.02;
/// The table is surely flat inside of this share of the markers' circles.
const INSIDE: f64 = 0.95;

/// The distance from the lens to the plane of the markers.
pub(super) struct Distance {
    /// Metres.
    pub(super) meters: f64,
    /// Robust standard deviation of what it was taken from, metres.
    pub(super) spread_m: f64,
    /// In words, where it comes from.
    pub(super) source: &'static str,
}

/// From the side of the markers' black squares.
///
/// # Errors
/// No marker whose corners the camera knows.
pub(super) fn from_side(
    camera: &Camera,
    frames: &Frames,
    fit: &RevoluteFit,
    side_m: f64,
) -> anyhow::Result<Distance> {
    let mut sides = Vec::new();
    for marker in frames.shown.iter().flat_map(|shown| &shown.markers) {
        let corner = |at: usize| {
            let ray = camera.ray(marker.corners[at % 4])?;
            Some(ray / fit.direction.dot(&ray))
        };
        let side = |at: usize| Some((corner(at + 1)? - corner(at)?).norm());
        sides.extend((0..4).filter_map(side));
    }
    let Some(RobustSpread { median, sigma }) =
        robust_spread(&mut sides).filter(|side| side.median > 0.0 && side.median.is_finite())
    else {
        bail!("no marker's side can be measured");
    };
    let meters = side_m / median;
    let spread_m = meters * sigma / median;
    Ok(Distance { meters, spread_m, source: "the side of the markers" })
}

/// From the laser's line on the table inside the circle of the markers, by the laser plane.
///
/// # Errors
/// Hardly any line there, or one that lies on no flat table.
pub(super) fn from_stripe(
    geometry: &CameraAndPlane,
    frames: &Frames,
    fit: &RevoluteFit,
) -> anyhow::Result<Distance> {
    let smallest = fit.radii.iter().copied().fold(f64::INFINITY, f64::min);
    let normal = fit.direction.into_inner();
    let on_table = |ray: &Vector3<f64>| {
        let point = Point3::from(ray / normal.dot(ray));
        (point - fit.point).norm() < INSIDE * smallest
    };
    let mut distances = Vec::new();
    for (_, stripe) in frames.shown.iter().flat_map(|shown| &shown.stripes) {
        for (&u, &v) in stripe.u_px.iter().zip(&stripe.v_px) {
            let ray = geometry.camera.ray(Point2::new(u.into(), v.into())).filter(on_table);
            let point = ray.and_then(|ray| geometry.plane.meet(ray));
            distances.extend(point.map(|point| normal.dot(&point.coords)));
        }
    }
    let num = distances.len();
    let Some(RobustSpread { median: meters, sigma: spread_m }) =
        robust_spread(&mut distances).filter(|_| num >= MIN_POINTS)
    else {
        bail!(
            "the laser's line on the table inside the circle of the markers has only {num} points: give the markers' side \
             (aruco:DICTIONARY:SIDE), or light the line up (--params-file)"
        );
    };
    if spread_m > MAX_SPREAD * meters {
        bail!(
            "what is bright inside the circle of the markers lies {:.1} mm up and down: no flat table, or not the laser; \
             give the markers' side (aruco:DICTIONARY:SIDE)",
            1e3 * spread_m
        );
    }
    Ok(Distance { meters, spread_m, source: "the laser's line on the table" })
}
