//! The axis that moves the part under the camera.

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

/// What an axis does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisKind {
    /// It shifts the part.
    Prismatic,
    /// It turns the part.
    Revolute,
}

impl AxisKind {
    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Prismatic => "prismatic",
            Self::Revolute => "revolute",
        }
    }

    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Prismatic, Self::Revolute].into_iter().find(|kind| kind.name() == name)
    }
}

/// A linear or rotary axis in the camera's frame (x right, y down, z forward, metres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Whether it shifts or turns.
    pub kind: AxisKind,
    /// A point that does not move when the part turns, metres; without meaning for a prismatic axis.
    pub point_m: Point3<f64>,
    /// Where the part goes when the position grows; for a revolute axis the turn is right-handed about it.
    pub direction: Unit<Vector3<f64>>,
    /// Metres (radians, for a revolute axis) that one unit of the position means: 1, or what a calibration found.
    pub scale: f64,
}

impl Axis {
    /// How the part has moved since position 0, in the camera's frame: `point_now = pose(position) * point_at_0`.
    /// `position` is in metres (radians) divided by [`scale`](Self::scale).
    pub fn pose(&self, position: f64) -> Isometry3<f64> {
        let moved = position * self.scale;
        match self.kind {
            AxisKind::Prismatic => Translation3::from(self.direction.into_inner() * moved).into(),
            AxisKind::Revolute => Isometry3::rotation_wrt_point(
                UnitQuaternion::from_axis_angle(&self.direction, moved),
                self.point_m,
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_linear_axis_shifts() {
        let direction = Unit::new_normalize(Vector3::new(3.0, 0.0, 4.0));
        let (kind, point_m) = (AxisKind::Prismatic, Point3::new(9.0, 9.0, 9.0));
        let axis = Axis { kind, point_m, direction, scale: 0.001 };
        let moved = axis.pose(5.0) * Point3::new(1.0, 2.0, 3.0);
        assert!((moved - Point3::new(1.003, 2.0, 3.004)).norm() < 1e-15, "{moved}");
    }

    #[test]
    fn a_rotary_axis_turns_by_the_right_hand() {
        let (kind, point_m) = (AxisKind::Revolute, Point3::new(1.0, 0.0, 5.0));
        let axis = Axis { kind, point_m, direction: Vector3::z_axis(), scale: 1.0 };
        let moved = axis.pose(FRAC_PI_2) * Point3::new(2.0, 0.0, 7.0);
        assert!((moved - Point3::new(1.0, 1.0, 7.0)).norm() < 1e-15, "{moved}");
        assert!((axis.pose(1.0) * point_m - point_m).norm() < 1e-15);
    }
}
