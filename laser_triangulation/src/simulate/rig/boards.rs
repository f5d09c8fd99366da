//! Checkerboards in front of the camera, with or without the laser line on them.

use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};
use rand::RngExt;
use serde::Deserialize;

use super::{Rig, lens::Lens};
use crate::simulate::{
    exposure::Exposure,
    noise::frame_rng,
    scenario::Laser,
    scenario_error::{ScenarioError, check_range},
};

/// Most random draws until the whole board is in the image.
const MAX_DRAWS: u32 = 10_000;
const NEWTON_STEPS: u32 = 20;
/// Combined blur of lens and pixel, pixels: a pixel alone has √(1/12) = 0.29.
const EDGE_SIGMA_PX: f64 = 0.8;
/// Brightness of the laser line on a black square relative to a white one.
const BLACK_SHARE: f64 = 0.3;

/// One board in many random views.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boards {
    /// Numbers of inner corners along the board's x and y.
    pub(crate) corners: [u32; 2],
    /// Side of a square, metres.
    pub(crate) square_m: f64,
    /// Grey level of white.
    pub(crate) white: f64,
    /// Grey level of black and of everything around the board.
    pub(crate) black: f64,
    /// Nearest and farthest distance of the board's middle, metres.
    pub(crate) distance_m: [f64; 2],
    /// Largest inclination about the camera's x and y, radians.
    pub(crate) max_tilt_rad: f64,
    /// True if the laser is on.
    #[serde(default)]
    pub(crate) has_line: bool,
}

/// Pose of a board: `point_in_camera = rotation · point_on_board + middle`; the origin is the middle of the pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct View {
    /// Rotation from the board to the camera.
    pub(crate) rotation: Rotation3<f64>,
    /// Middle of the pattern in the camera's frame, metres.
    pub(crate) middle_m: Vector3<f64>,
}

impl Boards {
    /// Returns half the size of the pattern with its outer squares, metres.
    fn half_m(&self) -> Vector2<f64> {
        Vector2::new(f64::from(self.corners[0]) + 1.0, f64::from(self.corners[1]) + 1.0)
            * (0.5 * self.square_m)
    }

    /// Returns the view of a frame: the whole pattern is in the image.
    pub(crate) fn view(&self, rig: &Rig, seed: u64, frame: u32) -> View {
        let mut random = frame_rng(seed ^ 0xb0a2d, u64::from(frame));
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let mut view = View { rotation: Rotation3::identity(), middle_m: Vector3::z() };
        for _ in 0..MAX_DRAWS {
            let tilt = self.max_tilt_rad;
            let rotation = Rotation3::from_euler_angles(
                between(-tilt, tilt),
                between(-tilt, tilt),
                between(-0.5, 0.5),
            );
            let z_m = between(self.distance_m[0], self.distance_m[1]);
            let [fx, fy] = rig.lens.focal_px;
            let [cx, cy] = rig.lens.center_px;
            let column = between(0.0, f64::from(rig.width_px));
            let row = between(0.0, f64::from(rig.height_px));
            let middle_m = Vector3::new((column - cx) / fx * z_m, (row - cy) / fy * z_m, z_m);
            view = View { rotation, middle_m };
            if self.is_in_picture(rig, &view) {
                break;
            }
        }
        view
    }

    fn is_in_picture(&self, rig: &Rig, view: &View) -> bool {
        let half = self.half_m();
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)].iter().all(|(x, y)| {
            let corner = Vector3::new(x * half.x, y * half.y, 0.0);
            let seen = rig.lens.project((view.rotation * corner + view.middle_m).into());
            seen.is_some_and(|[column, row]| {
                (3.0..f64::from(rig.width_px) - 4.0).contains(&column)
                    && (3.0..f64::from(rig.height_px) - 4.0).contains(&row)
            })
        })
    }

    /// Returns the image positions of the inner corners, row by row of the board.
    #[cfg(test)]
    pub(crate) fn corners_px(&self, rig: &Rig, view: &View) -> Vec<Option<[f64; 2]>> {
        let [columns, rows] = self.corners;
        let at = |index: u32, count: u32| {
            (f64::from(index) - 0.5 * (f64::from(count) - 1.0)) * self.square_m
        };
        let corners = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        corners
            .map(|(column, row)| {
                let corner = Vector3::new(at(column, columns), at(row, rows), 0.0);
                rig.lens.project((view.rotation * corner + view.middle_m).into())
            })
            .collect()
    }

    /// Draws the board, and the laser line on it.
    pub(super) fn expose(&self, rig: &Rig, laser: &Laser, view: &View, exposure: &mut Exposure) {
        let mut sights = Sights::new(rig, view);
        exposure.add(|column, row| {
            let Some(sight) = sights.look(column, row) else { return self.black as f32 };
            let white = self.whiteness(&sight);
            let mut level = self.black + white * (self.white - self.black);
            if self.has_line && self.is_on_board(&sight) {
                let across_px = sight.off_plane_m / sight.off_plane_per_px.norm();
                let share = BLACK_SHARE + (1.0 - BLACK_SHARE) * white;
                level += laser.amplitude
                    * share
                    * libm::exp(-0.5 * (across_px / laser.sigma_px).powi(2));
            }
            level as f32
        });
    }

    fn is_on_board(&self, sight: &Sight) -> bool {
        let half = self.half_m().add_scalar(self.square_m);
        sight.at_m.x.abs() < half.x && sight.at_m.y.abs() < half.y
    }

    /// Returns 0 for black to 1 for white: squares with edges blurred by the lens, with a white rim of one square. An
    /// edge blurred by a Gaussian is the error function of the distance to it.
    fn whiteness(&self, sight: &Sight) -> f64 {
        let half = self.half_m();
        let side = |axis: usize| {
            let sigma_m = EDGE_SIGMA_PX * sight.at_per_px.row(axis).norm();
            let edge =
                |distance_m: f64| libm::erf(distance_m / sigma_m * std::f64::consts::FRAC_1_SQRT_2);
            let at_m = sight.at_m[axis];
            // Distances inside the pattern, and inside the rim.
            let within = |half_m: f64| 0.5 * (edge(at_m + half_m) - edge(at_m - half_m));
            // Alternates between +1 and -1: the nearest edge decides.
            let squares = (at_m + half[axis]) / self.square_m;
            let nearest = squares.round();
            let sign = if nearest.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
            let turn = sign * edge((squares - nearest) * self.square_m);
            (within(half[axis]), within(half[axis] + self.square_m), turn)
        };
        let ((in_x, rim_x, turn_x), (in_y, rim_y, turn_y)) = (side(0), side(1));
        let pattern = 0.5 * (1.0 - turn_x * turn_y);
        let inside = in_x * in_y;
        (rim_x * rim_y) * (inside * pattern + (1.0 - inside))
    }

    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        for (key, value, min, max) in [
            ("corners[0]", f64::from(self.corners[0]), 2.0, 100.0),
            ("corners[1]", f64::from(self.corners[1]), 2.0, 100.0),
            ("square_m", self.square_m, 1e-5, 1.0),
            ("white", self.white, 0.0, 65_535.0),
            ("black", self.black, 0.0, 65_535.0),
            ("distance_m[0]", self.distance_m[0], 1e-3, 100.0),
            ("distance_m[1]", self.distance_m[1], self.distance_m[0], 100.0),
            ("max_tilt_rad", self.max_tilt_rad, 0.0, 1.2),
        ] {
            check_range(&format!("boards.{key}"), value, min, max)?;
        }
        Ok(())
    }
}

/// The point of the board that a pixel sees.
struct Sight {
    /// Position on the board from the middle of the pattern, metres.
    at_m: Vector2<f64>,
    /// Change of the position with column and row, metres per pixel.
    at_per_px: Matrix2<f64>,
    /// Distance of that point from the laser plane, metres.
    off_plane_m: f64,
    off_plane_per_px: Vector2<f64>,
}

/// Computes the ray of one pixel after another. Each starts from its neighbour's distortion.
struct Sights<'a> {
    lens: &'a Lens,
    view: &'a View,
    normal: Vector3<f64>,
    distance_m: f64,
    /// Deviation of the last pixel's ray from that of a pinhole, on the plane z = 1.
    bend: Vector2<f64>,
}

/// Step of the finite differences, on the plane z = 1 and, in metres, on the board.
const STEP: f64 = 1e-6;

impl<'a> Sights<'a> {
    fn new(rig: &'a Rig, view: &'a View) -> Self {
        let normal = Vector3::from(rig.laser_normal).normalize();
        let distance_m = rig.laser_distance_m;
        Self { lens: &rig.lens, view, normal, distance_m, bend: Vector2::zeros() }
    }

    fn look(&mut self, column: u32, row: u32) -> Option<Sight> {
        let pixel = Vector2::new(f64::from(column), f64::from(row));
        let ray = self.ray(pixel)?.push(1.0);
        let facing = self.view.rotation * Vector3::z();
        let point = ray * (facing.dot(&self.view.middle_m) / facing.dot(&ray));
        if point.z.is_nan() || point.z <= 0.0 {
            return None;
        }
        let at_m = (self.view.rotation.inverse() * (point - self.view.middle_m)).xy();
        let seen = |at_m: Vector2<f64>| {
            let point = self.view.rotation * at_m.push(0.0) + self.view.middle_m;
            self.lens.project(point.into()).map(Vector2::from)
        };
        let at_per_px = slope(seen, at_m)?.try_inverse()?;
        let on_board = self.view.rotation.inverse() * self.normal;
        Some(Sight {
            at_m,
            at_per_px,
            off_plane_m: self.normal.dot(&point) - self.distance_m,
            off_plane_per_px: at_per_px.transpose() * on_board.xy(),
        })
    }

    /// Returns the ray of a pixel, on the plane z = 1, by Newton's method.
    fn ray(&mut self, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let seen = |ray: Vector2<f64>| self.lens.project(ray.push(1.0).into()).map(Vector2::from);
        let start = Vector2::from(self.lens.without_coefficients(pixel.into()));
        let mut ray = start + self.bend;
        for _ in 0..NEWTON_STEPS {
            let missing = pixel - seen(ray)?;
            ray += slope(seen, ray)?.try_inverse()? * missing;
            if missing.norm() < 1e-4 {
                self.bend = ray - start;
                return Some(ray);
            }
        }
        // The next pixel starts from zero.
        self.bend = Vector2::zeros();
        None
    }
}

/// Returns the derivative of a map by finite differences.
fn slope(
    map: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    at: Vector2<f64>,
) -> Option<Matrix2<f64>> {
    let along = |step: Vector2<f64>| Some((map(at + step)? - map(at - step)?) / (2.0 * STEP));
    let columns = [along(Vector2::x() * STEP)?, along(Vector2::y() * STEP)?];
    Some(Matrix2::from_columns(&columns))
}
