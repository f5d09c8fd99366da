//! The laser plane's pose as a static transform.

use nalgebra::Isometry3;

use crate::msg::{
    builtin_interfaces::Time,
    geometry_msgs::{Quaternion, Transform, TransformStamped, Vector3},
    std_msgs::Header,
};

/// Returns the entry of `/tf_static` for the pose of frame `child` in frame `parent`; `stamp_ns`: nanoseconds since the
/// epoch.
pub(crate) fn transform<'a>(
    stamp_ns: i64,
    parent: &'a str,
    child: &'a str,
    parent_from_child: &Isometry3<f64>,
) -> TransformStamped<'a> {
    let (origin, rotation) = (&parent_from_child.translation, &parent_from_child.rotation);
    TransformStamped {
        header: Header { stamp: Time::from_ns(stamp_ns), frame_id: parent.into() },
        child_frame_id: child.into(),
        transform: Transform {
            translation: Vector3 { x: origin.x, y: origin.y, z: origin.z },
            rotation: Quaternion { x: rotation.i, y: rotation.j, z: rotation.k, w: rotation.w },
        },
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn a_quarter_turn_about_z() {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let pose = Isometry3::from_parts(Translation3::new(1.0, 2.0, 3.0), turn);
        let stated = transform(1_500_000_000, "camera", "laser_plane", &pose);
        assert_eq!(stated.header.stamp, Time { sec: 1, nanosec: 500_000_000 });
        assert_eq!((&*stated.header.frame_id, &*stated.child_frame_id), ("camera", "laser_plane"));
        let (origin, rotation) = (stated.transform.translation, stated.transform.rotation);
        assert_eq!((origin.x, origin.y, origin.z), (1.0, 2.0, 3.0));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!((rotation.z - half).abs() < 1e-15 && (rotation.w - half).abs() < 1e-15);
        assert_eq!((rotation.x, rotation.y), (0.0, 0.0));
    }
}
