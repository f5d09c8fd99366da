//! The effect of a calibration's uncertainty on measured points.

mod outside;
mod rig;

use nalgebra::{Matrix3, Point3, Unit, Vector3};

use super::surface::Surface;
use crate::scanner::{
    axis::{Axis, AxisKind},
    calibration::{
        AxisQuality, Calibration, CameraAndPlane, Deviation, Projective, VerticalIncidence,
    },
    params::StripeDirection,
    pose::perpendicular_basis,
};
pub use outside::num_outside;
use rig::Rig;

/// Largest angle between the axis and the laser plane's normal at which the position equals y: the sideways shift of
/// the profiles is negligible.
const LARGEST_LEAN: f64 = 0.05;

/// The calibration, shifted by one standard deviation along one of its independent directions.
#[derive(Clone, Debug)]
pub struct Perturbation(Map);

#[derive(Clone, Debug)]
enum Map {
    /// Maps points of the laser plane to points, by way of the image.
    Projective(Matrix3<f64>),
    /// The nominal and the shifted map of the image.
    Vertical(Box<[VerticalIncidence; 2]>),
    /// The nominal and the shifted camera, plane and axis.
    Rays(Box<[Rig; 2]>),
    /// Contribution of a lens that the model leaves out.
    Lens(Deviation),
}

/// Returns true if the calibration's contribution depends on the positions of the profiles: its axis turns the part or
/// leans, or the part's frame was levelled on a flat.
#[must_use]
pub fn needs_positions(calibration: &Calibration) -> bool {
    let Calibration::CameraAndPlane(geometry) = calibration else { return false };
    let leans = geometry.axis.is_some_and(|axis| {
        let lean = axis.direction.cross(&geometry.plane.normal).norm();
        axis.kind == AxisKind::Revolute || lean > LARGEST_LEAN
    });
    leans || geometry.part.is_some()
}

/// Returns the calibration shifted by one standard deviation along each of its independent directions: the principal
/// axes of its covariance, and the bow of the line by the lens. Their effects on any result add in quadrature. Plane and
/// axis follow the camera as the calibration states; where it does not, they are assumed independent of it. The axis varies in direction,
/// position and scale.
///
/// # Errors
/// The file states no covariance.
pub fn perturbations(
    calibration: &Calibration,
    direction: StripeDirection,
) -> Result<Vec<Perturbation>, &'static str> {
    let maps: Vec<Map> = match calibration {
        Calibration::VerticalIncidence(nominal) => {
            let others = nominal.shifted()?.into_iter();
            others.map(|other| Map::Vertical(Box::new([nominal.clone(), other]))).collect()
        }
        Calibration::Projective(map) => {
            let others = map.shifted()?.into_iter();
            let nominal = Matrix3::from_row_slice(&map.homography);
            let inverse = nominal.try_inverse().ok_or("the homography has no inverse")?;
            let moved = |other: Projective| Matrix3::from_row_slice(&other.homography) * inverse;
            others.map(|other| Map::Projective(moved(other))).collect()
        }
        Calibration::CameraAndPlane(geometry) => {
            let nominal = Rig::new(geometry, direction);
            let others = geometry.shifted()?.into_iter().chain(other_axes(geometry)?);
            let rays = |other| Map::Rays(Box::new([nominal.clone(), Rig::new(&other, direction)]));
            others.map(rays).collect()
        }
    };
    let lens = calibration.deviations().map(Map::Lens);
    Ok(maps.into_iter().chain(lens).map(Perturbation).collect())
}

/// Returns the rigs whose axis is off by one standard deviation.
fn other_axes(geometry: &CameraAndPlane) -> Result<Vec<CameraAndPlane>, &'static str> {
    let Some(axis) = geometry.axis else { return Ok(Vec::new()) };
    let stated = geometry.axis_quality.as_ref();
    let sigma = |of: fn(&AxisQuality) -> Option<f64>| {
        stated.and_then(of).ok_or("the file states no uncertainty of its axis")
    };
    let across = perpendicular_basis(&axis.direction);
    let direction_rad = sigma(|quality| quality.direction_sigma_rad)?;
    let turned = across.map(|to| {
        let direction = axis.direction.into_inner() + direction_rad * to;
        Axis { direction: Unit::new_normalize(direction), ..axis }
    });
    let mut all = turned.to_vec();
    if axis.kind == AxisKind::Revolute {
        let point_m = sigma(|quality| quality.point_sigma_m)?;
        let shifted = across.map(|to| Axis { point_m: axis.point_m + point_m * to, ..axis });
        all.extend(shifted);
    }
    let scale = axis.scale + sigma(|quality| quality.scale_sigma)?;
    all.push(Axis { scale, ..axis });
    let rig = |axis| CameraAndPlane { axis: Some(axis), ..geometry.clone() };
    Ok(all.into_iter().map(rig).collect())
}

impl Perturbation {
    /// Returns the points as the other calibration would have measured them; NaN where it does not see them.
    /// `positions` are those of the rows, in the unit of the axis; if there are none, y is the position.
    #[must_use]
    pub fn apply(&self, surface: &Surface, positions: &[f64]) -> Surface {
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let mut points = Vec::with_capacity(surface.points.len());
        for (number, row) in surface.rows().enumerate() {
            let moved = self.row(row, positions.get(number).copied());
            points.extend(moved.into_iter().map(|point| point.unwrap_or(nowhere)));
        }
        Surface { width: surface.width, points }
    }

    fn row(&self, row: &[Point3<f64>], position: Option<f64>) -> Vec<Option<Point3<f64>>> {
        match &self.0 {
            Map::Projective(map) => row.iter().map(|point| through(map, point)).collect(),
            Map::Vertical(both) => row.iter().map(|point| vertical(both, point)).collect(),
            Map::Rays(both) => rig::row(both, row, position),
            Map::Lens(by) => row.iter().map(|point| Some(deviated(by, point))).collect(),
        }
    }
}

fn through(map: &Matrix3<f64>, point: &Point3<f64>) -> Option<Point3<f64>> {
    let moved = map * Vector3::new(point.x, point.z, 1.0);
    (moved.z > 0.0).then(|| Point3::new(moved.x / moved.z, point.y, moved.y / moved.z))
}

fn deviated(by: &Deviation, point: &Point3<f64>) -> Point3<f64> {
    Point3::new(point.x, point.y, point.z + by.at_m([point.x, point.z]))
}

fn vertical(both: &[VerticalIncidence; 2], point: &Point3<f64>) -> Option<Point3<f64>> {
    let [nominal, other] = both;
    let (along_px, across_px) = nominal.project(point.x, point.z)?;
    let z_m = other.height(across_px)?.z_m;
    Some(Point3::new(other.lateral(along_px, z_m), point.y, z_m))
}

#[cfg(test)]
mod tests;
