//! From positions of the axis to places in the scan.

use nalgebra::Isometry3;

use super::{
    Motion, Position, doubt, placement::Placement, standstill::Standstill, travel::Travel,
};
use crate::scanner::{
    axis::{AxisTravel, RawPosition},
    calibration::Calibration,
    params::{MotionParams, Params, StripeDirection},
};

/// Place of a profile in its scan.
#[derive(Clone, Copy, Debug)]
pub struct Located {
    /// Position along the scan, with its doubts.
    pub position: Position,
    /// The laser plane's frame in the part's, metres.
    pub part_from_laser: Isometry3<f64>,
    /// Distance from the first position of the scan, never negative.
    pub travelled: AxisTravel,
    /// True if it lies where the profile before it in the scan lies: the axis did not move.
    pub stands: bool,
}

/// Locates the profiles of one scan after the other.
#[derive(Clone, Debug)]
pub struct Locator {
    motion: Motion,
    placement: Placement,
    travel: Travel,
    standstill: Standstill,
}

impl Locator {
    /// A locator before the first frame of a scan. Without a calibration the part moves along the laser plane's normal.
    pub fn new(
        params: MotionParams,
        direction: StripeDirection,
        calibration: Option<&Calibration>,
    ) -> Self {
        let axis = calibration.and_then(Calibration::axis).copied();
        let placement = Placement::new(camera_from_laser(direction, calibration), axis);
        Self {
            motion: Motion::new(params),
            placement: match calibration.and_then(Calibration::part) {
                Some(part) => placement.with_part(&part.pose()),
                None => placement,
            },
            travel: Travel::new(params.direction, params.backlash),
            standstill: Standstill::new(params.backlash),
        }
    }

    /// The same locator for measured poses of the laser plane instead of the camera.
    #[must_use]
    pub fn with_laser_tracked(self) -> Self {
        Self { placement: self.placement.with_laser_tracked(), ..self }
    }

    /// Applies other parameters: a constant motion starts again, and the laser plane's frame follows the stripe direction.
    pub fn reconfigure(&mut self, old: &Params, new: &Params, calibration: Option<&Calibration>) {
        if old.motion != new.motion {
            self.motion = Motion::new(new.motion);
            self.travel = Travel::new(new.motion.direction, new.motion.backlash);
            self.standstill = Standstill::new(new.motion.backlash);
        }
        if old.stripe_direction != new.stripe_direction {
            let camera_from_laser = camera_from_laser(new.stripe_direction, calibration);
            self.placement = self.placement.clone().with_camera_from_laser(camera_from_laser);
        }
    }

    /// Starts a new scan: the next frame is its first.
    pub fn restart(&mut self) {
        self.motion.restart();
        self.travel.restart();
        self.standstill.restart();
        self.placement.restart();
    }

    /// Position of a frame according to the parameters; `None` if positions are measured.
    pub fn expected_position(&mut self, frame_number: u64, stamp_ns: i64) -> Option<Position> {
        self.motion.position(frame_number, stamp_ns)
    }

    /// Locates the next frame of the scan and flags a reversed motion.
    pub fn locate(&mut self, mut position: Position) -> Located {
        let part_from_laser = self.placement.place(&mut position);
        let RawPosition(raw) = position.value;
        let travel = self.placement.travel(&position);
        // The scan direction is that of the raw positions, whatever the sign of the scale.
        let along = travel.value().abs().copysign(raw);
        // The position of a pose has no sign: it already is the distance from the first frame.
        let travelled = if position.part_from_sensor.is_some() {
            along
        } else {
            if self.travel.is_reversed(along) {
                position.doubts |= doubt::REVERSED;
            }
            self.travel.distance(along)
        };
        let (travelled, stands) =
            (travel.with_value(travelled), self.standstill.stands(&part_from_laser));
        Located { position, part_from_laser, travelled, stands }
    }
}

fn camera_from_laser(
    direction: StripeDirection,
    calibration: Option<&Calibration>,
) -> Isometry3<f64> {
    calibration.and_then(|calibration| calibration.camera_from_laser(direction)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::scanner::{
        axis::{Axis, AxisKind},
        calibration::{CameraAndPlane, tests::rig},
        params::{MotionSource, ScanDirection},
    };

    fn locator(kind: AxisKind, scale: f64, direction: ScanDirection) -> Locator {
        let point_m = Point3::new(0.0, 0.0, 0.5);
        let axis = Some(Axis { kind, point_m, direction: Vector3::y_axis(), scale });
        let calibration = Calibration::CameraAndPlane(Box::new(CameraAndPlane { axis, ..rig() }));
        let motion = MotionParams { direction, backlash: 0.01, ..MotionParams::default() };
        Locator::new(motion, StripeDirection::Vertical, Some(&calibration))
    }

    fn at(locator: &mut Locator, raw: f64) -> Located {
        locator.locate(Position::at(RawPosition(raw)))
    }

    #[test]
    fn the_scale_of_a_prismatic_axis_applies_once_to_pose_travel_and_backlash() {
        // A joint in millimetres.
        let mut locator = locator(AxisKind::Prismatic, 1e-3, ScanDirection::Auto);
        let first = at(&mut locator, 100.0);
        assert_eq!(first.travelled, AxisTravel::Metres(0.0));
        let later = at(&mut locator, 350.0);
        assert!(later.travelled.reaches_m(0.2499) && !later.travelled.reaches_m(0.2501));
        let moved =
            later.part_from_laser.translation.vector - first.part_from_laser.translation.vector;
        assert!((moved.norm() - 0.25).abs() < 1e-12, "{moved}");
        assert_eq!(later.position.value, RawPosition(350.0), "published as stated");
        assert_eq!(at(&mut locator, 341.0).position.doubts, 0, "9 mm are backlash");
        assert_eq!(at(&mut locator, 339.0).position.doubts, doubt::REVERSED, "11 mm are not");
    }

    #[test]
    fn an_angle_never_is_a_length() {
        // A joint in quarters of a turn.
        let mut locator = locator(AxisKind::Revolute, FRAC_PI_2, ScanDirection::Auto);
        let first = at(&mut locator, 1.0);
        let later = at(&mut locator, 2.0);
        assert_eq!(later.travelled, AxisTravel::Radians(FRAC_PI_2));
        assert!(!later.travelled.reaches_m(1e-9));
        let turned = first.part_from_laser.rotation.angle_to(&later.part_from_laser.rotation);
        assert!((turned - FRAC_PI_2).abs() < 1e-12, "{turned}");
    }

    #[test]
    fn a_constant_step_is_an_angle_on_a_revolute_axis() {
        let point_m = Point3::new(0.0, 0.0, 0.5);
        let axis =
            Axis { kind: AxisKind::Revolute, point_m, direction: Vector3::y_axis(), scale: 1.0 };
        let calibration =
            Calibration::CameraAndPlane(Box::new(CameraAndPlane { axis: Some(axis), ..rig() }));
        let source = MotionSource::Constant;
        for motion in [
            MotionParams { source, step: Some(0.1), ..MotionParams::default() },
            MotionParams { source, velocity: Some(0.1), ..MotionParams::default() },
        ] {
            let mut locator = Locator::new(motion, StripeDirection::Vertical, Some(&calibration));
            let [first, later] = [0, 5].map(|number: u32| {
                let stamp_ns = i64::from(number) * 1_000_000_000;
                let position = locator.expected_position(u64::from(number), stamp_ns).unwrap();
                locator.locate(position)
            });
            let AxisTravel::Radians(travelled_rad) = later.travelled else { unreachable!() };
            assert!((travelled_rad - 0.5).abs() < 1e-12, "{travelled_rad}");
            let turned = first.part_from_laser.rotation.angle_to(&later.part_from_laser.rotation);
            assert!((turned - 0.5).abs() < 1e-12, "{turned}");
        }
    }

    #[test]
    fn the_scan_direction_is_that_of_the_raw_positions() {
        for scale in [2.0, -2.0] {
            let mut locator = locator(AxisKind::Prismatic, scale, ScanDirection::Forward);
            at(&mut locator, -0.1);
            let up = at(&mut locator, 0.2);
            assert_eq!(up.position.doubts, 0);
            let AxisTravel::Metres(travelled_m) = up.travelled else { unreachable!() };
            assert!((travelled_m - 0.6).abs() < 1e-12);
            assert_eq!(at(&mut locator, 0.1).position.doubts, doubt::REVERSED);
        }
    }

    #[test]
    fn measured_poses_travel_in_metres_on_any_axis() {
        let mut locator = locator(AxisKind::Revolute, 2.0, ScanDirection::Auto);
        let pose = |x_m: f64| Position {
            part_from_sensor: Some(Isometry3::translation(x_m, 0.0, 0.0)),
            ..Position::at(RawPosition(0.0))
        };
        locator.locate(pose(1.0));
        let later = locator.locate(pose(1.25));
        assert!(later.travelled.reaches_m(0.2499) && !later.travelled.reaches_m(0.2501));
        assert_eq!(later.position.doubts, 0);
    }
}
