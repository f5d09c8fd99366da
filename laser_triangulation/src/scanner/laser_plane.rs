//! The laser plane.

use nalgebra::{Point3, Unit, Vector3};

use super::pose::perpendicular_basis;

/// All points p of the camera's frame (x right, y down, z forward, metres) with `normal · p = distance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaserPlane {
    /// Unit normal, away from the lens.
    pub normal: Unit<Vector3<f64>>,
    /// From the lens to the plane, metres, above 0.
    pub distance_m: f64,
}

impl LaserPlane {
    /// The `perpendicular_basis` of the normal: the tilts a and b of a normal move it to n + a t₁ + b t₂.
    pub fn tangents(&self) -> [Vector3<f64>; 2] {
        perpendicular_basis(&self.normal)
    }

    /// Returns the plane with its normal tilted along the tangents by the first two numbers, radians, and its distance
    /// larger by the third, metres.
    pub(crate) fn moved(&self, by: [f64; 3]) -> Self {
        let [first, second] = self.tangents();
        let tilted = self.normal.into_inner() + by[0] * first + by[1] * second;
        Self { normal: Unit::new_normalize(tilted), distance_m: self.distance_m + by[2] }
    }

    /// Intersection of a ray from the lens with the plane, metres; `None` if there is none in front of the lens.
    pub fn meet(&self, ray: Vector3<f64>) -> Option<Point3<f64>> {
        let scale = self.distance_m / self.normal.dot(&ray);
        let point = Point3::from(ray * scale);
        (scale > 0.0 && point.iter().all(|value| value.is_finite()) && point.z > 0.0)
            .then_some(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_the_plane_in_front_of_the_lens_or_not_at_all() {
        let normal = Unit::new_normalize(Vector3::new(0.0, 1.0, 1.0));
        let plane = LaserPlane { normal, distance_m: 2.0_f64.sqrt() };
        let point = plane.meet(Vector3::new(0.5, 0.0, 1.0)).unwrap();
        assert!((point - Point3::new(1.0, 0.0, 2.0)).norm() < 1e-15, "{point}");
        // Parallel to the plane, and away from it.
        assert!(plane.meet(Vector3::new(0.0, -1.0, 1.0)).is_none());
        assert!(plane.meet(Vector3::new(0.0, -2.0, 1.0)).is_none());
    }
}
