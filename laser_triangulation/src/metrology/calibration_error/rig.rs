//! Maps a point of the part to the image with one rig, and back with another.

use nalgebra::{Isometry3, Point2, Point3};

use crate::scanner::{
    axis::RawPosition,
    calibration::CameraAndPlane,
    motion::{Position, placement::Placement},
    params::StripeDirection,
};

/// A rig and the resulting positions of points.
#[derive(Clone, Debug)]
pub(super) struct Rig {
    geometry: CameraAndPlane,
    camera_from_laser: Isometry3<f64>,
    placement: Placement,
}

impl Rig {
    pub(super) fn new(geometry: &CameraAndPlane, direction: StripeDirection) -> Self {
        let camera_from_laser = geometry.camera_from_laser(direction);
        let plain = Placement::new(camera_from_laser, geometry.axis);
        let placement = match &geometry.part {
            Some(part) => plain.with_part(&part.pose()),
            None => plain,
        };
        Self { geometry: geometry.clone(), camera_from_laser, placement }
    }

    /// Returns the laser plane's frame in the part's frame at a position.
    fn part_from_laser(&self, position: f64) -> Isometry3<f64> {
        self.placement.clone().place(&mut Position::at(RawPosition(position)))
    }

    /// Returns the pose of the part in the laser plane's frame. Without a position, y is the position: it is left out.
    pub(super) fn laser_from_part(&self, position: Option<f64>) -> Isometry3<f64> {
        position.map_or_else(Isometry3::identity, |at| self.part_from_laser(at).inverse())
    }

    /// Returns the pixel that sees a point of the laser plane; `None` if the camera does not.
    pub(super) fn seen(&self, [x_m, z_m]: [f64; 2]) -> Option<Point2<f64>> {
        let in_camera = self.camera_from_laser * Point3::new(x_m, 0.0, z_m);
        Some(self.geometry.camera.project(in_camera)?.0)
    }
}

/// Returns a profile's points as measured with the second rig instead of the first. Without a position, y is the
/// position and stays.
pub(super) fn row(
    [nominal, other]: &[Rig; 2],
    row: &[Point3<f64>],
    position: Option<f64>,
) -> Vec<Option<Point3<f64>>> {
    let poses = position.map(|position| {
        (nominal.part_from_laser(position).inverse(), other.part_from_laser(position))
    });
    let other_laser_from_camera = other.camera_from_laser.inverse();
    let moved = |point: &Point3<f64>| {
        let in_laser = poses.map_or(*point, |(laser_from_part, _)| laser_from_part * point);
        let in_camera = nominal.camera_from_laser * Point3::new(in_laser.x, 0.0, in_laser.z);
        let ray = other.geometry.camera.ray(nominal.geometry.camera.project(in_camera)?)?;
        let found = other_laser_from_camera * other.geometry.plane.meet(ray)?;
        Some(match poses {
            Some((_, part_from_laser)) => part_from_laser * found,
            None => Point3::new(found.x, point.y, found.z),
        })
    };
    row.iter().map(moved).collect()
}
