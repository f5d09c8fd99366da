//! Surfaces that a calibrated rig measures, and the errors of what is found.

use nalgebra::{Matrix3, Point3, Vector3};

use super::{rig::SimulatedRig, *};
use crate::{
    metrology::{Surface, calibration_error::perturbations},
    scanner::{calibration::Calibration, camera::DistortedPixel},
};

/// What is measured on an inclined plane, another one above it, and along a profile.
pub(super) const FIGURES: [&str; 5] =
    ["slope along the stripe", "slope across", "height", "step", "length along the stripe"];
/// One number for each of [`FIGURES`].
pub(super) type Figures = [f64; 5];

/// Points of a profile.
const WIDTH: u32 = 21;
/// Profiles.
const PROFILES: u32 = 10;
/// Slopes of the planes along and across.
const SLOPES: [f64; 2] = [0.1, 0.05];
/// Half of the planes' width, and the step between them, as shares of the laser plane's distance.
const HALF: f64 = 0.1;
const STEP: f64 = 0.03;

impl SimulatedRig {
    /// Returns the errors of what a calibration measures, in units of their stated standard deviations.
    pub(super) fn judged(&self, found: &CameraAndPlane) -> Figures {
        let truth = [0.0, STEP * self.distance_m].map(|height_m| self.surface(height_m));
        let measured = truth.each_ref().map(|surface| self.measured(found, surface));
        let (wanted, values) = (figures(&truth), figures(&measured));
        let calibration = Calibration::CameraAndPlane(Box::new(found.clone()));
        let mut squares = [0.0; FIGURES.len()];
        for other in perturbations(&calibration, self.direction).unwrap() {
            let moved = figures(&measured.each_ref().map(|surface| other.apply(surface, &[])));
            for (square, (moved, value)) in squares.iter_mut().zip(moved.iter().zip(&values)) {
                *square += (moved - value).powi(2);
            }
        }
        std::array::from_fn(|at| (values[at] - wanted[at]) / squares[at].sqrt())
    }

    /// Returns an inclined plane that moves along the laser plane's normal.
    fn surface(&self, height_m: f64) -> Surface {
        let half_m = HALF * self.distance_m;
        let off = |at: u32, count: u32| half_m * (2.0 * f64::from(at) / f64::from(count - 1) - 1.0);
        let places = (0..PROFILES).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let points = places.map(|(x, y)| {
            let (x, y) = (off(x, WIDTH), off(y, PROFILES));
            Point3::new(x, y, height_m + SLOPES[0] * x + SLOPES[1] * y)
        });
        Surface { width: WIDTH as usize, points: points.collect() }
    }

    /// Returns the same points as the calibration places them.
    fn measured(&self, found: &CameraAndPlane, surface: &Surface) -> Surface {
        // The pose of the laser's frame depends on the plane alone.
        let truth = CameraAndPlane { plane: self.plane(), ..found.clone() };
        let from = truth.camera_from_laser(self.direction);
        let to = found.camera_from_laser(self.direction).inverse();
        let points = surface.points.iter().map(|point| {
            let seen = self.sees(from * Point3::new(point.x, 0.0, point.z)).unwrap();
            let ray = found.camera.ray(DistortedPixel(seen)).unwrap();
            let placed = to * found.plane.meet(ray).unwrap();
            Point3::new(placed.x, point.y, placed.z)
        });
        Surface { width: surface.width, points: points.collect() }
    }
}

fn figures(both: &[Surface; 2]) -> Figures {
    let [low, high] = both.each_ref().map(plane_of);
    let first = &both[0].points;
    let length_m = (first[WIDTH as usize - 1] - first[0]).norm();
    [low.y, low.z, low.x, high.x - low.x, length_m]
}

/// Height at the origin, and slopes along x and y, by least squares.
fn plane_of(surface: &Surface) -> Vector3<f64> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for point in &surface.points {
        let row = Vector3::new(1.0, point.x, point.y);
        normal += row * row.transpose();
        right += row * point.z;
    }
    normal.try_inverse().unwrap() * right
}
