//! Intersects the rays of one frame's stripe with the laser plane.

use nalgebra::{Matrix2, Matrix3, Point2, Vector2, Vector3};

use super::CameraAndPlane;
use crate::scanner::{
    calibration::PlacedPoint,
    camera::{Camera, DistortedPoint, Distortion, UndistortedPoint},
    params::StripeDirection,
};

/// Newton's method squares the error: from here one more step leaves less than 1e-6 px.
const LAST_STEP_PX: f64 = 5e-3;
/// Maximum steps from a neighbour's ray before the search restarts without it.
const MAX_STEPS: u32 = 5;

/// Intersects one ray after another. Each starts from its neighbour's, so one evaluation of the distortion nearly
/// always suffices.
pub(in crate::scanner::calibration) struct Cuts<'a> {
    camera: &'a Camera,
    direction: StripeDirection,
    /// Size of a pixel along columns and rows on the plane z = 1.
    per_px: [f64; 2],
    /// From the inclined sensor to the plane z = 1.
    untilt: Option<Matrix3<f64>>,
    /// Squared radius, on the plane z = 1, beyond which the lens is not measured.
    limit: f64,
    last_step: f64,
    neighbour: Option<Ray>,
    /// Row vectors that multiply a ray: the inverse depth of the plane along it; and x and z of the intersection over
    /// that depth.
    inverse_depth: Vector3<f64>,
    x: Vector3<f64>,
    z: Vector3<f64>,
}

/// A ray, its undistorted image, and the derivative of the image.
#[derive(Clone, Copy)]
struct Ray {
    bent: DistortedPoint,
    straight: UndistortedPoint,
    straight_per_bent: Matrix2<f64>,
}

impl CameraAndPlane {
    /// Starts a frame.
    pub(in crate::scanner::calibration) fn cuts(&self, direction: StripeDirection) -> Cuts<'_> {
        let camera = &self.camera;
        let camera_from_laser = self.camera_from_laser(direction);
        let origin = camera_from_laser.translation.vector;
        let inverse_depth = self.plane.normal.into_inner() / self.plane.distance_m;
        // (p - origin) · axis, with p = ray / (inverse_depth · ray).
        let coordinate = |axis: Vector3<f64>| {
            let axis = camera_from_laser.rotation * axis;
            axis - inverse_depth * origin.dot(&axis)
        };
        Cuts {
            camera,
            direction,
            per_px: [1.0 / camera.fx_px, 1.0 / camera.fy_px],
            untilt: camera.untilt(),
            limit: camera.distortion.largest_radius().powi(2),
            last_step: LAST_STEP_PX / camera.fx_px.max(camera.fy_px),
            neighbour: None,
            inverse_depth,
            x: coordinate(Vector3::x()),
            z: coordinate(Vector3::z()),
        }
    }
}

impl Cuts<'_> {
    /// Returns the point of the laser plane seen at that position and its derivative across the stripe. `None` if the
    /// ray is unknown or does not meet the plane.
    pub(in crate::scanner::calibration) fn place(
        &mut self,
        along_px: f64,
        across_px: f64,
    ) -> Option<PlacedPoint> {
        let [per_column, per_row] = self.per_px;
        let (column, row, across) = match self.direction {
            StripeDirection::Horizontal => (along_px, across_px, Vector2::new(0.0, per_row)),
            StripeDirection::Vertical => (across_px, along_px, Vector2::new(per_column, 0.0)),
        };
        let Camera { cx_px, cy_px, .. } = *self.camera;
        let on_sensor = Point2::new((column - cx_px) * per_column, (row - cy_px) * per_row);
        let (bent, bent_per_px) = self.untilted(on_sensor, across)?;
        let ray = self.ray(bent)?;
        let straight_per_px = ray.straight_per_bent * bent_per_px;

        let direction = ray.straight.0.coords.push(1.0);
        let inverse_depth = self.inverse_depth.dot(&direction);
        if inverse_depth.is_nan() || inverse_depth <= 0.0 {
            return None;
        }
        let depth = 1.0 / inverse_depth;
        let depth_slope = self.inverse_depth.xy().dot(&straight_per_px);
        let cut = |axis: &Vector3<f64>| {
            let value_m = axis.dot(&direction) * depth;
            (value_m, (axis.xy().dot(&straight_per_px) - value_m * depth_slope) * depth)
        };
        let ((x_m, x_m_per_px), (z_m, z_m_per_px)) = (cut(&self.x), cut(&self.z));
        Some(PlacedPoint { x_m, z_m, x_m_per_px, z_m_per_px, flags: 0 })
    }

    /// Maps a position on the sensor and a step there to the plane z = 1.
    fn untilted(
        &self,
        on_sensor: Point2<f64>,
        step: Vector2<f64>,
    ) -> Option<(DistortedPoint, Vector2<f64>)> {
        let Some(untilt) = &self.untilt else {
            return Some((DistortedPoint(on_sensor), step));
        };
        let seen = untilt * on_sensor.to_homogeneous();
        let bent = Point2::from_homogeneous(seen).filter(|_| seen.z > 0.0)?;
        let moved = untilt * step.push(0.0);
        Some((DistortedPoint(bent), (moved.xy() - bent.coords * moved.z) / seen.z))
    }

    fn ray(&mut self, bent: DistortedPoint) -> Option<Ray> {
        let lens = &self.camera.distortion;
        if *lens == Distortion::None {
            let straight = UndistortedPoint(bent.0);
            return Some(Ray { bent, straight, straight_per_bent: Matrix2::identity() });
        }
        let ray = self.beside_neighbour(bent).or_else(|| {
            let straight = lens.undistort(bent)?;
            let straight_per_bent = lens.bend(straight).1.try_inverse()?;
            Some(Ray { bent, straight, straight_per_bent })
        });
        self.neighbour = ray;
        ray
    }

    /// Newton's method, extrapolating from the neighbour's ray. `None` if it does not converge.
    fn beside_neighbour(&self, bent: DistortedPoint) -> Option<Ray> {
        let neighbour = self.neighbour.as_ref()?;
        let step = neighbour.straight_per_bent * (bent.0 - neighbour.bent.0);
        let mut straight = UndistortedPoint(neighbour.straight.0 + step);
        for _ in 0..MAX_STEPS {
            let (seen, jacobian) = self.camera.distortion.bend(straight);
            let straight_per_bent = jacobian.try_inverse()?;
            let missing = bent.0 - seen.0;
            straight.0 += straight_per_bent * missing;
            if missing.norm_squared() < self.last_step * self.last_step {
                let is_known = straight.0.coords.norm_squared() <= self.limit;
                return is_known.then_some(Ray { bent, straight, straight_per_bent });
            }
        }
        None
    }
}
