//! Converts a position to the pose of the laser plane's frame in the part's frame.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::Position;
use crate::scanner::axis::{Axis, AxisKind, AxisTravel, RawPosition};

/// Places profiles in the part's frame.
///
/// Without an axis, the part moves along the laser plane's normal: the part's frame is the laser plane's at position 0,
/// and y is the position. For a prismatic axis, it is the laser plane's frame at position 0 and moves with the part.
/// For a revolute axis, it turns with the part: z along the axis, towards the camera; the origin is the point of the
/// axis nearest to the origin of the laser plane's frame, and x points from the axis towards that origin at position 0.
/// If the calibration defines the part's frame by a flat, that frame is used instead. Measured poses have their own
/// frame.
#[derive(Clone, Debug)]
pub struct Placement {
    axis: Option<Axis>,
    /// The laser plane's frame in the camera's.
    camera_from_laser: Isometry3<f64>,
    /// The camera's frame in the part's, at position 0.
    part_from_camera: Isometry3<f64>,
    /// The frame defined by axis and laser plane, in the part's.
    part_from_unlaid: Isometry3<f64>,
    /// True if measured poses are those of the laser plane, not of the camera.
    is_laser_tracked: bool,
    /// Origin of the laser plane's frame in the part's frame at the scan's first frame, metres.
    start_m: Option<Point3<f64>>,
}

impl Placement {
    /// Creates a placement for a laser plane at that pose and a part on that axis.
    pub fn new(camera_from_laser: Isometry3<f64>, axis: Option<Axis>) -> Self {
        let part_from_camera = match &axis {
            Some(axis) if axis.kind == AxisKind::Revolute => {
                turning_frame(axis, &camera_from_laser).inverse()
            }
            _ => camera_from_laser.inverse(),
        };
        let (part_from_unlaid, start_m) = (Isometry3::identity(), None);
        let is_laser_tracked = false;
        Self {
            axis,
            camera_from_laser,
            part_from_camera,
            part_from_unlaid,
            is_laser_tracked,
            start_m,
        }
    }

    /// Sets the part's frame, relative to the frame defined by axis and laser plane.
    #[must_use]
    pub(crate) fn with_part(self, unlaid_from_part: &Isometry3<f64>) -> Self {
        Self { part_from_unlaid: unlaid_from_part.inverse(), ..self }
    }

    /// Treats measured poses as those of the laser plane, not of the camera.
    #[must_use]
    pub(crate) const fn with_laser_tracked(self) -> Self {
        Self { is_laser_tracked: true, ..self }
    }

    /// Sets another pose of the laser plane in the camera's frame.
    #[must_use]
    pub(crate) fn with_camera_from_laser(self, camera_from_laser: Isometry3<f64>) -> Self {
        Self {
            is_laser_tracked: self.is_laser_tracked,
            part_from_unlaid: self.part_from_unlaid,
            ..Self::new(camera_from_laser, self.axis)
        }
    }

    /// Starts another scan.
    pub(crate) const fn restart(&mut self) {
        self.start_m = None;
    }

    /// Returns the laser plane's frame in the part's, metres. For a measured pose, it sets the position to the distance
    /// of the laser plane's origin from its place in the scan's first frame.
    pub fn place(&mut self, position: &mut Position) -> Isometry3<f64> {
        if let Some(part_from_sensor) = position.part_from_sensor {
            let part_from_laser = if self.is_laser_tracked {
                part_from_sensor
            } else {
                part_from_sensor * self.camera_from_laser
            };
            let origin_m = part_from_laser * Point3::origin();
            let distance_m = (origin_m - *self.start_m.get_or_insert(origin_m)).norm();
            position.value = RawPosition(distance_m);
            return part_from_laser;
        }
        let unlaid_from_laser = match &self.axis {
            None => Translation3::new(0.0, position.value.0, 0.0).into(),
            Some(axis) => {
                let at_0_from_now = axis.pose(position.value).inverse();
                self.part_from_camera * at_0_from_now * self.camera_from_laser
            }
        };
        self.part_from_unlaid * unlaid_from_laser
    }

    /// Returns the travel from position 0 to a position that [`place`](Self::place) has processed. Without an axis, and
    /// for measured poses, positions are metres.
    pub(crate) fn travel(&self, position: &Position) -> AxisTravel {
        match &self.axis {
            Some(axis) if position.part_from_sensor.is_none() => axis.travel(position.value),
            _ => AxisTravel::Metres(position.value.0),
        }
    }
}

/// Returns the part's frame in the camera's at position 0, for a revolute axis.
fn turning_frame(axis: &Axis, camera_from_laser: &Isometry3<f64>) -> Isometry3<f64> {
    let towards_camera = (Point3::origin() - axis.point_m).dot(&axis.direction) >= 0.0;
    let z = if towards_camera { axis.direction } else { -axis.direction };
    let laser_m = camera_from_laser * Point3::origin();
    let origin_m = axis.point_m + z.into_inner() * z.dot(&(laser_m - axis.point_m));
    let across = |direction: Vector3<f64>| direction - z.into_inner() * z.dot(&direction);
    // If the laser plane's origin lies on the axis, x follows the stripe, or the plane's normal.
    let x =
        [laser_m - origin_m, camera_from_laser * Vector3::x(), camera_from_laser * Vector3::y()]
            .into_iter()
            .find_map(|direction| across(direction).try_normalize(1e-9))
            .unwrap_or_else(Vector3::x);
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z.into_inner()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(origin_m.coords.into(), rotation)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Unit, UnitVector3};
    use proptest::prelude::*;

    use super::*;

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        (prop::array::uniform3(-1.0..1.0_f64), prop::array::uniform3(-3.0..3.0_f64))
            .prop_map(|(origin_m, turn)| Isometry3::new(origin_m.into(), turn.into()))
    }

    fn axis(kind: AxisKind) -> impl Strategy<Value = Axis> {
        let direction = prop::array::uniform3(0.1..1.0_f64)
            .prop_map(|direction| Unit::new_normalize(Vector3::from(direction)));
        (prop::array::uniform3(-1.0..1.0_f64), direction).prop_map(move |(point_m, direction)| {
            Axis { kind, point_m: point_m.into(), direction, scale: 1.0 }
        })
    }

    /// A point of the part, seen at different positions, is found at the same place of the part.
    fn stays(
        camera_from_laser: &Isometry3<f64>,
        axis: Axis,
        at_0_m: Point3<f64>,
        positions: [f64; 2],
    ) -> f64 {
        let mut placement = Placement::new(*camera_from_laser, Some(axis));
        let [a, b] = positions.map(|position| {
            let seen_m = camera_from_laser.inverse() * (axis.pose(RawPosition(position)) * at_0_m);
            placement.place(&mut Position::at(RawPosition(position))) * seen_m
        });
        (a - b).norm()
    }

    proptest! {
        #[test]
        fn a_point_of_the_part_stays_where_it_is(
            laser in pose(), prismatic in axis(AxisKind::Prismatic), revolute in axis(AxisKind::Revolute),
            point in prop::array::uniform3(-1.0..1.0_f64), positions in prop::array::uniform2(-7.0..7.0_f64),
        ) {
            prop_assert!(stays(&laser, prismatic, point.into(), positions) < 1e-12);
            prop_assert!(stays(&laser, revolute, point.into(), positions) < 1e-12);
        }

        #[test]
        fn the_frame_of_a_table_is_that_of_its_axis(laser in pose(), axis in axis(AxisKind::Revolute)) {
            let part_from_camera = turning_frame(&axis, &laser).inverse();
            let on_axis = part_from_camera * (axis.point_m + axis.direction.into_inner() * 0.3);
            prop_assert!(on_axis.x.abs() < 1e-12 && on_axis.y.abs() < 1e-12);
            let direction = part_from_camera * axis.direction.into_inner();
            prop_assert!((direction.z.abs() - 1.0).abs() < 1e-12);
            let camera = part_from_camera * (Point3::origin() - axis.point_m);
            prop_assert!(camera.z >= -1e-12, "z points towards the camera");
            let laser_m = part_from_camera * (laser * Point3::origin());
            prop_assert!(laser_m.x >= 0.0 && laser_m.y.abs() < 1e-12 && laser_m.z.abs() < 1e-12);
            let rotation = part_from_camera.rotation.to_rotation_matrix();
            prop_assert!((rotation.matrix().determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn without_an_axis_the_position_is_y() {
        let mut placement = Placement::new(Isometry3::translation(1.0, 2.0, 3.0), None);
        let placed =
            placement.place(&mut Position::at(RawPosition(0.25))) * Point3::new(0.1, 0.0, 0.3);
        assert_eq!(placed, Point3::new(0.1, 0.25, 0.3), "to the last bit");
    }

    #[test]
    fn a_frame_laid_on_a_flat_moves_every_profile_alike() {
        let down = UnitVector3::new_unchecked(-Vector3::z());
        let (kind, point_m) = (AxisKind::Revolute, Point3::new(0.0, 0.0, 1.0));
        let axis = Axis { kind, point_m, direction: down, scale: 1.0 };
        let mut plain = Placement::new(Isometry3::translation(0.2, 0.0, 1.0), Some(axis));
        let pose = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.01, -0.02, 0.5));
        let mut laid = plain.clone().with_part(&pose);
        for angle in [0.0, 1.0, 2.5] {
            let point_m = Point3::new(0.01, 0.0, 0.02);
            let [was, is] = [&mut plain, &mut laid]
                .map(|placement| placement.place(&mut Position::at(RawPosition(angle))) * point_m);
            assert!((pose * is - was).norm() < 1e-12, "{was} {is}");
        }
    }

    #[test]
    fn a_quarter_of_a_turn_of_the_table() {
        // The camera looks down on a table 1 m below it, which turns about its own z; the laser hits it 0.2 m beside.
        let down = UnitVector3::new_unchecked(-Vector3::z());
        let axis = Axis {
            kind: AxisKind::Revolute,
            point_m: Point3::new(0.0, 0.0, 1.0),
            direction: down,
            scale: 1.0,
        };
        let mut placement = Placement::new(Isometry3::translation(0.2, 0.0, 1.0), Some(axis));
        let at_0 = placement.place(&mut Position::at(RawPosition(0.0))) * Point3::origin();
        assert!((at_0 - Point3::new(0.2, 0.0, 0.0)).norm() < 1e-12, "{at_0}");
        let later = placement.place(&mut Position::at(RawPosition(FRAC_PI_2))) * Point3::origin();
        assert!(
            (later - Point3::new(0.0, -0.2, 0.0)).norm() < 1e-12,
            "the part turned, the laser stayed: {later}"
        );
    }

    #[test]
    fn a_pose_that_was_measured_is_taken_as_it_is() {
        let mounted = Isometry3::translation(0.0, 0.0, 0.5);
        let tracked = |x_m: f64| Position {
            part_from_sensor: Some(Isometry3::translation(x_m, 0.0, 0.0)),
            ..Position::at(RawPosition(0.0))
        };
        let mut camera = Placement::new(mounted, None);
        let mut laser = camera.clone().with_laser_tracked();
        assert_eq!(camera.place(&mut tracked(1.0)) * Point3::origin(), Point3::new(1.0, 0.0, 0.5));
        assert_eq!(laser.place(&mut tracked(1.0)) * Point3::origin(), Point3::new(1.0, 0.0, 0.0));
        let mut later = tracked(1.25);
        camera.place(&mut later);
        assert!((later.value.0 - 0.25).abs() < 1e-15, "so far since the first frame");
    }
}
