//! The axis that moves the part under the camera.

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use super::pose::perpendicular_basis;

/// Kind of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisKind {
    /// Shifts the part.
    Prismatic,
    /// Turns the part.
    Revolute,
}

impl AxisKind {
    /// Returns the name in files.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Prismatic => "prismatic",
            Self::Revolute => "revolute",
        }
    }

    /// Returns the kind with that name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        [Self::Prismatic, Self::Revolute].into_iter().find(|kind| kind.name() == name)
    }
}

/// Position of an axis as its joint or encoder states it: nominally metres, radians on a revolute axis, but before
/// [`Axis::scale`]. Only [`Axis::travel`] turns it into a length or an angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct RawPosition(pub f64);

/// Signed travel along an axis, after its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisTravel {
    /// Travel of a prismatic axis, metres.
    Metres(f64),
    /// Travel of a revolute axis, radians.
    Radians(f64),
}

impl AxisTravel {
    /// Metres or radians.
    pub const fn value(self) -> f64 {
        match self {
            Self::Metres(value) | Self::Radians(value) => value,
        }
    }

    /// Returns another travel in the same unit.
    #[must_use]
    pub const fn with_value(self, value: f64) -> Self {
        match self {
            Self::Metres(_) => Self::Metres(value),
            Self::Radians(_) => Self::Radians(value),
        }
    }

    /// True if this is a length of at least `length_m` in either direction. An angle never is.
    pub fn reaches_m(self, length_m: f64) -> bool {
        matches!(self, Self::Metres(travel_m) if travel_m.abs() >= length_m)
    }
}

/// A linear or rotary axis in the camera's frame (x right, y down, z forward, metres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Shift or turn.
    pub kind: AxisKind,
    /// A point of a revolute axis, metres; unused for a prismatic axis.
    pub point_m: Point3<f64>,
    /// Direction of motion for growing positions; a revolute axis turns right-handed about it.
    pub direction: Unit<Vector3<f64>>,
    /// Metres (radians, for a revolute axis) in one unit of the raw position: 1, or the calibrated value. Not 0.
    pub scale: f64,
}

impl Axis {
    /// Returns the travel from position 0. The only place that applies [`scale`](Self::scale).
    pub fn travel(&self, position: RawPosition) -> AxisTravel {
        let travel = position.0 * self.scale;
        match self.kind {
            AxisKind::Prismatic => AxisTravel::Metres(travel),
            AxisKind::Revolute => AxisTravel::Radians(travel),
        }
    }

    /// Returns the axis with its direction tilted along its `perpendicular_basis` by the first two numbers, radians, moved
    /// along the same by the next two, metres, and its scale larger by the last.
    pub(crate) fn moved(&self, by: [f64; 5]) -> Self {
        let [first, second] = perpendicular_basis(&self.direction);
        let tilted = self.direction.into_inner() + by[0] * first + by[1] * second;
        Self {
            direction: Unit::new_normalize(tilted),
            point_m: self.point_m + by[2] * first + by[3] * second,
            scale: self.scale + by[4],
            ..*self
        }
    }

    /// Returns the motion of the part since position 0, in the camera's frame: `point_now = pose(position) *
    /// point_at_0`.
    pub fn pose(&self, position: RawPosition) -> Isometry3<f64> {
        match self.travel(position) {
            AxisTravel::Metres(length_m) => {
                Translation3::from(self.direction.into_inner() * length_m).into()
            }
            AxisTravel::Radians(angle_rad) => Isometry3::rotation_wrt_point(
                UnitQuaternion::from_axis_angle(&self.direction, angle_rad),
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
        let moved = axis.pose(RawPosition(5.0)) * Point3::new(1.0, 2.0, 3.0);
        assert!((moved - Point3::new(1.003, 2.0, 3.004)).norm() < 1e-15, "{moved}");
    }

    #[test]
    fn a_revolute_axis_turns_right_handed() {
        let (kind, point_m) = (AxisKind::Revolute, Point3::new(1.0, 0.0, 5.0));
        let axis = Axis { kind, point_m, direction: Vector3::z_axis(), scale: 1.0 };
        let moved = axis.pose(RawPosition(FRAC_PI_2)) * Point3::new(2.0, 0.0, 7.0);
        assert!((moved - Point3::new(1.0, 1.0, 7.0)).norm() < 1e-15, "{moved}");
        assert!((axis.pose(RawPosition(1.0)) * point_m - point_m).norm() < 1e-15);
    }
}
