//! The frame of the gauges: the origin is where the optical axis meets the laser plane, x runs along the stripe, z in
//! the plane towards the camera, y along the plane's normal.

use nalgebra::Vector3;

use super::Rig;

/// Axes and origin of that frame in the camera's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct World {
    origin_m: Vector3<f64>,
    axes: [Vector3<f64>; 3],
}

impl World {
    pub(super) fn new(rig: &Rig) -> Self {
        let normal = Vector3::from(rig.laser_normal).normalize();
        let line = if rig.is_vertical { Vector3::y() } else { Vector3::x() };
        let along = (line - normal.scale(normal.dot(&line))).normalize();
        // In the plane, at right angles to the stripe; the camera is on the side of -z.
        let mut up = along.cross(&normal);
        if up.z > 0.0 {
            up.neg_mut();
        }
        let origin_m = Vector3::new(0.0, 0.0, rig.laser_distance_m / normal.z);
        Self { origin_m, axes: [along, up.cross(&along), up] }
    }

    /// Returns a direction.
    pub(super) fn camera_from_world(&self, direction: Vector3<f64>) -> Vector3<f64> {
        self.axes[0] * direction.x + self.axes[1] * direction.y + self.axes[2] * direction.z
    }

    /// Returns the image (column, row) of a point of the laser plane.
    pub(super) fn seen(&self, rig: &Rig, x_m: f64, z_m: f64) -> Option<[f64; 2]> {
        let point = self.origin_m + self.camera_from_world(Vector3::new(x_m, 0.0, z_m));
        rig.lens.project(point.into())
    }

    /// Returns the position of the lens, metres.
    pub(super) fn lens_m(&self) -> [f64; 3] {
        self.axes.map(|axis| -axis.dot(&self.origin_m))
    }
}
