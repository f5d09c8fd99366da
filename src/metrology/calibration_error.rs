//! What a calibration that is not known exactly does to measured points.

use nalgebra::{DMatrix, Isometry3, Matrix3, Point3, SymmetricEigen, Unit, Vector3};

use super::surface::Surface;
use crate::scanner::{
    axis::AxisKind,
    calibration::{Calibration, CameraAndPlane},
    camera::{Camera, Distortion},
    params::StripeDirection,
};

/// An axis that leans so far from the laser plane's normal that profiles shift against one another.
const LARGEST_LEAN: f64 = 0.05;

/// The calibration, one standard deviation off along one of its independent directions.
#[derive(Clone, Debug)]
pub struct Perturbation(Map);

#[derive(Clone, Debug)]
enum Map {
    /// From points of the laser plane to points, by way of the image.
    Projective(Matrix3<f64>),
    /// By way of the camera's rays.
    Rays(Box<Rays>),
}

#[derive(Clone, Debug)]
struct Rays {
    camera_from_laser: Isometry3<f64>,
    camera: Camera,
    other: CameraAndPlane,
    other_laser_from_camera: Isometry3<f64>,
}

/// All independent directions in which the calibration may be off, each by one standard deviation: the principal axes of
/// its covariance. Their effects on any figure add up as squares. Camera and plane are taken as independent.
///
/// # Errors
/// Why it is not known: the file states no covariance, or the part turned.
pub fn perturbations(
    calibration: &Calibration,
    direction: StripeDirection,
) -> Result<Vec<Perturbation>, &'static str> {
    match calibration {
        Calibration::VerticalIncidence(_) => Err("a vertical_incidence file states no uncertainty"),
        Calibration::Projective(map) => {
            let quality = map.quality.as_ref().filter(|quality| quality.covariance.len() == 81);
            let quality = quality.ok_or("the file states no covariance of its homography")?;
            let nominal = Matrix3::from_row_slice(&map.homography);
            let inverse = nominal.try_inverse().ok_or("the homography has no inverse")?;
            let maps = axes(9, &quality.covariance).into_iter();
            let moved = |axis: Vec<f64>| (nominal + Matrix3::from_row_slice(&axis)) * inverse;
            Ok(maps.map(|axis| Perturbation(Map::Projective(moved(axis)))).collect())
        }
        Calibration::CameraAndPlane(geometry) => of_camera(geometry, direction),
    }
}

fn of_camera(
    geometry: &CameraAndPlane,
    direction: StripeDirection,
) -> Result<Vec<Perturbation>, &'static str> {
    let normal = geometry.plane.normal;
    if let Some(axis) = &geometry.axis {
        if axis.kind == AxisKind::Revolute {
            return Err("it is not propagated through a rotation");
        }
        if axis.direction.cross(&normal).norm() > LARGEST_LEAN {
            return Err(
                "it is not propagated along an axis that leans from the laser plane's normal",
            );
        }
    }
    let plane = geometry.plane_quality.as_ref().and_then(|quality| quality.covariance);
    let plane = plane.ok_or("the file states no covariance of its laser plane")?;
    let mut others = Vec::new();
    let tangents = geometry.plane.tangents();
    for axis in axes(3, &plane) {
        let mut other = geometry.clone();
        let turned = normal.into_inner() + axis[0] * tangents[0] + axis[1] * tangents[1];
        other.plane.normal = Unit::new_normalize(turned);
        other.plane.distance_m += axis[2];
        others.push(other);
    }
    if let Some(quality) = &geometry.camera_quality {
        let num = quality.parameters.len();
        if num > 0 && quality.covariance.len() == num * num {
            for axis in axes(num, &quality.covariance) {
                let mut other = geometry.clone();
                for (name, by) in quality.parameters.iter().zip(axis) {
                    shift(&mut other.camera, name, by);
                }
                others.push(other);
            }
        }
    }
    let rays = |other: CameraAndPlane| Rays {
        camera_from_laser: geometry.camera_from_laser(direction),
        camera: geometry.camera,
        other_laser_from_camera: other.camera_from_laser(direction).inverse(),
        other,
    };
    Ok(others.into_iter().map(|other| Perturbation(Map::Rays(Box::new(rays(other))))).collect())
}

/// Moves a value of the camera by its name in the file.
fn shift(camera: &mut Camera, name: &str, by: f64) {
    let value = match name {
        "fx" => Some(&mut camera.fx_px),
        "fy" => Some(&mut camera.fy_px),
        "cx" => Some(&mut camera.cx_px),
        "cy" => Some(&mut camera.cy_px),
        "tau_x" => Some(&mut camera.tilt_rad[0]),
        "tau_y" => Some(&mut camera.tilt_rad[1]),
        _ => coefficient(&mut camera.distortion, name),
    };
    if let Some(value) = value {
        *value += by;
    }
}

fn coefficient<'a>(distortion: &'a mut Distortion, name: &str) -> Option<&'a mut f64> {
    match distortion {
        Distortion::None => None,
        Distortion::PlumbBob { k1, k2, p1, p2, k3 } => match name {
            "k1" => Some(k1),
            "k2" => Some(k2),
            "k3" => Some(k3),
            "p1" => Some(p1),
            "p2" => Some(p2),
            _ => None,
        },
        Distortion::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 } => match name {
            "k1" => Some(k1),
            "k2" => Some(k2),
            "k3" => Some(k3),
            "k4" => Some(k4),
            "k5" => Some(k5),
            "k6" => Some(k6),
            "p1" => Some(p1),
            "p2" => Some(p2),
            _ => None,
        },
    }
}

/// The principal axes of a covariance, each as long as one standard deviation along it; those of rounding left out. The
/// values have different units: they are scaled to their own standard deviations first.
fn axes(num: usize, covariance: &[f64]) -> Vec<Vec<f64>> {
    let matrix = DMatrix::from_row_slice(num, num, covariance);
    let sigmas: Vec<f64> = (0..num).map(|i| matrix[(i, i)].max(0.0).sqrt()).collect();
    let scaled = DMatrix::from_fn(num, num, |i, j| {
        let scale = sigmas[i] * sigmas[j];
        if scale > 0.0 { matrix[(i, j)] / scale } else { 0.0 }
    });
    let eigen = SymmetricEigen::new(scaled);
    let kept = (0..num).filter(|i| eigen.eigenvalues[*i] > 1e-9);
    kept.map(|i| {
        let length = eigen.eigenvalues[i].sqrt();
        (0..num).map(|j| length * eigen.eigenvectors[(j, i)] * sigmas[j]).collect()
    })
    .collect()
}

impl Perturbation {
    /// Where the points would have been measured with the other calibration; those that it does not see are NaN.
    #[must_use]
    pub fn apply(&self, surface: &Surface) -> Surface {
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let points = surface.points.iter().map(|point| self.point(point).unwrap_or(nowhere));
        Surface { width: surface.width, points: points.collect() }
    }

    fn point(&self, point: &Point3<f64>) -> Option<Point3<f64>> {
        match &self.0 {
            Map::Projective(map) => {
                let moved = map * Vector3::new(point.x, point.z, 1.0);
                (moved.z > 0.0).then(|| Point3::new(moved.x / moved.z, point.y, moved.y / moved.z))
            }
            Map::Rays(rays) => {
                let seen = rays.camera_from_laser * Point3::new(point.x, 0.0, point.z);
                let ray = rays.other.camera.ray(rays.camera.project(seen)?)?;
                let moved = rays.other_laser_from_camera * rays.other.plane.meet(ray)?;
                Some(Point3::new(moved.x, point.y, moved.z))
            }
        }
    }
}

#[cfg(test)]
mod tests;
