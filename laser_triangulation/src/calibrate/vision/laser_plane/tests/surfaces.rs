//! Surfaces that a calibrated rig measures, and the errors of what is found.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::{rig::SimulatedRig, *};
use crate::{
    metrology::{Surface, calibration_error::perturbations},
    scanner::{
        axis::{AxisKind, RawPosition},
        calibration::Calibration,
        camera::DistortedPixel,
        motion::{Position, placement::Placement},
    },
};

/// Measurements on an inclined plane, another one above it, and along a profile.
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
        let truth = CameraAndPlane { plane: self.plane(), axis: self.axis, ..found.clone() };
        let seen = [0.0, STEP * self.distance_m].map(|height_m| self.surface(&truth, height_m));
        let placed = seen.each_ref().map(|surface| self.placed(&truth, surface));
        let measured = seen
            .each_ref()
            .map(|surface| self.placed(found, &self.measured(&truth, found, surface)));
        let (wanted, values) = (figures(&placed), figures(&measured));
        let calibration = Calibration::CameraAndPlane(Box::new(found.clone()));
        let positions = self.positions();
        let mut squares = [0.0; FIGURES.len()];
        for other in perturbations(&calibration, self.direction).unwrap() {
            let moved =
                figures(&measured.each_ref().map(|surface| other.apply(surface, &positions)));
            for (square, (moved, value)) in squares.iter_mut().zip(moved.iter().zip(&values)) {
                *square += (moved - value).powi(2);
            }
        }
        std::array::from_fn(|at| (values[at] - wanted[at]) / squares[at].sqrt())
    }

    /// Returns the positions of the profiles, metres or radians.
    fn positions(&self) -> Vec<f64> {
        let is_turning = self.axis.is_some_and(|axis| axis.kind == AxisKind::Revolute);
        let reach = if is_turning { 0.5 } else { HALF * self.distance_m };
        let last = f64::from(PROFILES - 1);
        (0..PROFILES).map(|profile| reach * (2.0 * f64::from(profile) / last - 1.0)).collect()
    }

    /// Returns the pose of the laser plane's frame in the part's at a position.
    fn part_from_laser(&self, rig: &CameraAndPlane, position: f64) -> Isometry3<f64> {
        let placement = Placement::new(rig.camera_from_laser(self.direction), rig.axis);
        placement.clone().place(&mut Position::at(RawPosition(position)))
    }

    /// Returns the points of an inclined plane of the part, in the laser plane's frame.
    fn surface(&self, truth: &CameraAndPlane, height_m: f64) -> Surface {
        let upwards = Vector3::new(-SLOPES[0], -SLOPES[1], 1.0);
        let middle = self.part_from_laser(truth, 0.0) * Point3::origin();
        let mut points = Vec::new();
        for position in self.positions() {
            let part_from_laser = self.part_from_laser(truth, position);
            let up = upwards.dot(&(part_from_laser * Vector3::z()));
            for place in 0..WIDTH {
                let share = 2.0 * f64::from(place) / f64::from(WIDTH - 1) - 1.0;
                let x = share * HALF * self.distance_m;
                let from = part_from_laser * Point3::new(x, 0.0, 0.0) - middle;
                points.push(Point3::new(x, 0.0, (height_m - upwards.dot(&from)) / up));
            }
        }
        Surface { width: WIDTH as usize, points }
    }

    /// Returns points of the laser plane in the part's frame.
    fn placed(&self, rig: &CameraAndPlane, surface: &Surface) -> Surface {
        let rows = surface.rows().zip(self.positions());
        let points = rows.flat_map(|(row, position)| {
            let part_from_laser = self.part_from_laser(rig, position);
            row.iter().map(move |point| part_from_laser * point)
        });
        Surface { width: surface.width, points: points.collect() }
    }

    /// Returns the same points as the calibration places them.
    fn measured(
        &self,
        truth: &CameraAndPlane,
        found: &CameraAndPlane,
        surface: &Surface,
    ) -> Surface {
        let from = truth.camera_from_laser(self.direction);
        let to = found.camera_from_laser(self.direction).inverse();
        let points = surface.points.iter().map(|point| {
            let seen = self.sees(from * point).unwrap();
            let ray = found.camera.ray(DistortedPixel(seen)).unwrap();
            to * found.plane.meet(ray).unwrap()
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
