use nalgebra::{Point2, Point3, Unit, Vector3};
use proptest::prelude::*;

use super::*;
use crate::scanner::{
    axis::{Axis, AxisKind},
    camera::{Camera, DistortedPixel, Distortion},
    laser_plane::LaserPlane,
    params::StripeDirection,
};

pub(super) fn camera() -> Camera {
    Camera {
        width_px: 640,
        height_px: 480,
        fx_px: 625.0,
        fy_px: 623.5,
        cx_px: 317.5,
        cy_px: 242.25,
        distortion: Distortion::PlumbBob {
            k1: 0.1277,
            k2: -0.2795,
            p1: -0.00017,
            p2: -0.00293,
            k3: 0.148,
        },
        tilt_rad: [0.01, -0.02],
    }
}

pub(in crate::scanner) fn rig() -> CameraAndPlane {
    CameraAndPlane {
        frame_id: "laser_plane".into(),
        camera_name: "left \"one\"".into(),
        camera: camera(),
        camera_quality: None,
        plane: LaserPlane {
            normal: Unit::new_normalize(Vector3::new(0.911, -0.139, 0.387)),
            distance_m: 0.1667,
        },
        plane_quality: None,
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: None,
    }
}

const VOLUME: CalibratedVolume = CalibratedVolume {
    columns_px: [20.5, 600.0],
    rows_px: [12.0, 470.25],
    heights_m: None,
    depths_m: None,
};

/// A calibration with every optional entry.
fn full() -> CameraAndPlane {
    CameraAndPlane {
        camera_quality: Some(CameraQuality {
            rms_px: 0.122,
            views_used: 139,
            views_rejected: 15,
            parameters: vec!["fx".into(), "k1".into()],
            covariance: vec![1.0, 0.1, 0.1, 0.02],
            volume: Some(VOLUME),
        }),
        plane_quality: Some(PlaneQuality {
            rms_m: 0.00048,
            boards_used: 22,
            covariance: Some([1e-8, 0.0, 0.0, 0.0, 1e-8, 0.0, 0.0, 0.0, 1e-9]),
            camera_response: Some(vec![1e-4, 0.5, -2e-5, 0.25, 1e-4, -0.125]),
            volume: Some(CalibratedVolume { depths_m: Some([0.3, 0.5]), ..VOLUME }),
        }),
        alignment: Some(Alignment { origin_m: [0.01, -0.25], angle_rad: 0.1 }),
        part: Some(PartPose { origin_m: [0.01, -0.25, 1e-3], rotation_rad: [0.1, -0.2, 1e-3] }),
        axis: Some(Axis {
            kind: AxisKind::Revolute,
            point_m: Point3::new(0.017, 0.054, 0.417),
            direction: Unit::new_normalize(Vector3::new(0.033, -0.922, -0.386)),
            scale: 1.0,
        }),
        axis_quality: Some(AxisQuality {
            rms_px: Some(0.37),
            positions_used: 40,
            camera_response: Some(vec![0.25; 10]),
            ..AxisQuality::default()
        }),
        calibrated_at: Some("2026-11-22T12:00:00Z".into()),
        ..rig()
    }
}

fn fisheye(k1: f64) -> Distortion {
    Distortion::Equidistant { k1, k2: 0.0, k3: 0.0, k4: 0.0 }
}

fn boxed(geometry: CameraAndPlane) -> Calibration {
    Calibration::CameraAndPlane(Box::new(geometry))
}

#[test]
fn a_file_gives_back_what_was_written() {
    let prismatic =
        Axis { kind: AxisKind::Prismatic, point_m: Point3::origin(), ..full().axis.unwrap() };
    let wide = Distortion::RationalPolynomial {
        k1: 8.2,
        k2: 4.6,
        p1: -0.0002,
        p2: 0.0007,
        k3: 0.21,
        k4: 8.6,
        k5: 7.4,
        k6: 1.2,
    };
    for geometry in [
        rig(),
        full(),
        CameraAndPlane { axis: Some(prismatic), ..full() },
        CameraAndPlane { camera: Camera { distortion: wide, ..camera() }, ..rig() },
        CameraAndPlane { camera: Camera { distortion: fisheye(0.02), ..camera() }, ..rig() },
        CameraAndPlane { camera: Camera { distortion: fisheye(0.0), ..camera() }, ..rig() },
        CameraAndPlane {
            camera: Camera { distortion: Distortion::None, tilt_rad: [0.0; 2], ..camera() },
            ..rig()
        },
    ] {
        let calibration = boxed(geometry.clone());
        let yaml = calibration.to_yaml();
        assert_eq!(Calibration::from_yaml(&yaml).unwrap(), calibration, "{yaml}");
        let camera = CameraCalibration::from_yaml(&yaml).unwrap();
        assert_eq!((camera.camera, &camera.quality), (geometry.camera, &geometry.camera_quality));
        assert_eq!(CameraCalibration::from_yaml(&camera.to_yaml()).unwrap(), camera);
    }
    let homography = [1e-4, 0.0, -0.05, 0.0, -2e-4, 0.1, 0.0, 1e-3, 1.0];
    let quality = StepsQuality {
        rms_m: 1e-6,
        heights_used: 4,
        covariance: vec![],
        volume: Some(CalibratedVolume { heights_m: Some([-1e-3, 0.02]), ..VOLUME }),
        bow: Some(Box::new(Bow {
            x_m: [-0.05, 0.05],
            z_m: [0.0, 0.012],
            deviations_m: vec![[1e-6; 9]; 2],
        })),
    };
    let calibration = Calibration::Projective(Box::new(Projective {
        frame_id: "laser".into(),
        width_px: 640,
        height_px: 480,
        homography,
        quality: Some(quality),
        calibrated_at: Some("2026-11-22T12:00:00Z".into()),
    }));
    assert_eq!(Calibration::from_yaml(&calibration.to_yaml()).unwrap(), calibration);
}

/// A camera file as written by ROS's calibrators.
const ROS: &str = "
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.783367, 0.000000, 305.593336, 0.000000, 437.302876, 243.738352, 0.000000, 0.000000, 1.000000]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.999978, 0.002789, -0.006046, -0.002816, 0.999986, -0.004401, 0.006034, 0.004417, 0.999972]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.653800, 0.000000, 322.797939, 0.000000, 0.000000, 393.653800, 241.090902, 0.000000, 0.000000, 0.000000, 1.000000, 0.000000]
";

#[test]
fn a_file_of_ros_is_a_camera_but_measures_nothing() {
    let camera = CameraCalibration::from_yaml(ROS).unwrap();
    assert_eq!((camera.camera.width_px, camera.camera.fy_px), (640, 437.302_876));
    assert_eq!(camera.camera.distortion.coefficients()[..2], [-0.361_976, 0.110_510]);
    for text in [ROS.to_owned(), camera.to_yaml()] {
        let error = Calibration::from_yaml(&text).unwrap_err().to_string();
        assert!(error.contains("calibrate plane"), "{error}");
    }
}

#[test]
fn wrong_values_are_refused_by_name() {
    let yaml = boxed(full()).to_yaml();
    let yaml = yaml.lines().filter(|line| !line.starts_with("id:")).collect::<Vec<_>>().join("\n");
    Calibration::from_yaml(&yaml).unwrap();
    for (from, to, named) in [
        ("type: camera_and_plane", "type: camera_and_planes", "camera_and_planes"),
        ("type: camera_and_plane\n", "", "calibrate plane"),
        ("image_width: 640", "image_width: 0", "image_width"),
        ("image_width: 640", "image_with: 640", "image_with"),
        ("data: [625.0,", "data: [-625.0,", "camera_matrix"),
        ("data: [625.0, 0.0,", "data: [625.0, 3.0,", "camera_matrix"),
        ("data: [625.0, 0.0,", "data: [625.0,", "camera_matrix"),
        ("distortion_model: plumb_bob", "distortion_model: equidistant", "four"),
        ("distortion_model: plumb_bob", "distortion_model: fov", "fov"),
        ("data: [0.1277, -0.2795, -0.00017", "data: [0.1277", "five"),
        ("data: [0.1277,", "data: [.nan,", "distortion_coefficients"),
        ("\"fx\"", "\"focus\"", "focus"),
        ("\"covariance\":[1.0,", "\"covariance\":[", "camera_quality.covariance"),
        ("_response\":[0.0001,", "_response\":[", "plane_quality.camera_response"),
        ("_response\":[0.25,", "_response\":[", "axis_quality.camera_response"),
        ("tilt_rad: [0.01,", "tilt_rad: [1.5,", "tilt_rad"),
        ("laser_plane: {normal: [0.9", "laser_plane: {normal: [9.9", "laser_plane.normal"),
        (", 0.387", ", -0.387", "laser_plane.normal"),
        ("distance_m: 0.1667", "distance_m: -0.1667", "laser_plane.distance_m"),
        ("kind: revolute", "kind: spherical", "spherical"),
        ("point_m: [0.017, 0.054, 0.417], ", "", "axis.point_m"),
        ("scale: 1.0", "scale: 0.0", "axis.scale"),
        ("frame_id: \"laser_plane\"", "frame_id: ''", "frame_id"),
        ("frame_id: \"laser_plane\"\n", "", "frame_id"),
        ("angle_rad: 0.1", "angle_rad: .inf", "alignment"),
        ("laser_plane: {", "plane: {", "plane"),
    ] {
        let text = yaml.replacen(from, to, 1);
        assert_ne!(text, yaml, "{from}");
        let error = Calibration::from_yaml(&text).unwrap_err().to_string();
        assert!(error.contains(named), "{to}: {error}");
    }
}

#[test]
fn an_edited_file_is_refused() {
    let yaml = boxed(full()).to_yaml();
    let edited = yaml.replace("distance_m: 0.1667", "distance_m: 0.1668");
    let error = Calibration::from_yaml(&edited).unwrap_err().to_string();
    assert!(error.contains("edited") && error.contains(&boxed(full()).id()), "{error}");
    // Entries about quality and date do not change the id.
    let dated = yaml.replace("2026-11-22", "2026-11-23");
    Calibration::from_yaml(&dated).unwrap();
}

#[test]
fn the_id_changes_with_every_value() {
    let mut ids = vec![boxed(full()).id()];
    let mut change = |edit: &dyn Fn(&mut CameraAndPlane)| {
        let mut geometry = full();
        edit(&mut geometry);
        ids.push(boxed(geometry).id());
    };
    change(&|g| g.frame_id.push('2'));
    change(&|g| g.camera.width_px += 1);
    change(&|g| g.camera.cy_px += 1e-9);
    change(&|g| g.camera.distortion = Distortion::None);
    change(&|g| g.camera.distortion = fisheye(0.0));
    change(&|g| g.camera.distortion = fisheye(1e-9));
    change(&|g| g.camera.tilt_rad[1] += 1e-9);
    change(&|g| g.plane.distance_m += 1e-9);
    change(&|g| g.plane.normal = Unit::new_normalize(Vector3::new(0.911, -0.139, 0.388)));
    change(&|g| g.alignment = None);
    change(&|g| g.alignment = Some(Alignment { origin_m: [0.01, -0.25], angle_rad: 0.2 }));
    change(&|g| g.part = None);
    change(&|g| g.part.as_mut().unwrap().origin_m[2] += 1e-9);
    change(&|g| g.part.as_mut().unwrap().rotation_rad[0] += 1e-9);
    change(&|g| g.axis = None);
    change(&|g| g.axis.as_mut().unwrap().point_m.z += 1e-9);
    change(&|g| g.axis.as_mut().unwrap().kind = AxisKind::Prismatic);
    change(&|g| g.axis.as_mut().unwrap().scale = 2.0);
    let number = ids.len();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), number, "one id a change");
}

fn directions() -> impl Strategy<Value = StripeDirection> {
    prop::sample::select(vec![StripeDirection::Horizontal, StripeDirection::Vertical])
}

proptest! {
    /// A point of the plane, projected by the camera, is measured at its place.
    #[test]
    fn what_is_seen_is_measured_where_it_is(
        x_m in -0.06..0.06_f64, z_m in -0.06..0.06_f64, direction in directions(),
        is_aligned in any::<bool>(), n_x in -0.9..0.9_f64, n_y in -0.9..0.9_f64,
    ) {
        let mut rig = if is_aligned { full() } else { rig() };
        rig.alignment = rig.alignment.map(|alignment| Alignment { origin_m: [0.01, -0.02], ..alignment });
        let normal = Unit::new_normalize(Vector3::new(n_x, n_y, 0.4));
        rig.plane = LaserPlane { normal, distance_m: 0.5 * normal.z };
        let point = rig.camera_from_laser(direction) * Point3::new(x_m, 0.0, z_m);
        prop_assert!((rig.plane.normal.dot(&point.coords) - rig.plane.distance_m).abs() < 1e-12);
        let Some(DistortedPixel(seen)) = rig.camera.project(point) else { return Ok(()) };
        let (along, across) = match direction {
            StripeDirection::Horizontal => (seen.x, seen.y),
            StripeDirection::Vertical => (seen.y, seen.x),
        };
        let mut cuts = rig.cuts(direction);
        // From a neighbour, too.
        cuts.place(along + 1.0, across - 1.0);
        let placed = cuts.place(along, across).unwrap();
        prop_assert!((placed.x_m - x_m).abs() < 1e-9 && (placed.z_m - z_m).abs() < 1e-9, "{placed:?}");
        let step_px = 1e-3;
        let [after, before] = [1.0, -1.0].map(|s| rig.cuts(direction).place(along, across + s * step_px).unwrap());
        let slope = |a: f64, b: f64| (a - b) / (2.0 * step_px);
        prop_assert!((slope(after.x_m, before.x_m) - placed.x_m_per_px).abs() < 1e-7, "{placed:?}");
        prop_assert!((slope(after.z_m, before.z_m) - placed.z_m_per_px).abs() < 1e-7, "{placed:?}");
    }

    /// For any path along the stripe, starting from a neighbour leads to the same ray as starting from scratch.
    #[test]
    fn a_neighbour_leads_to_the_same_ray(
        lens in 0..3, steps in prop::collection::vec((0.0..640.0_f64, 0.0..480.0_f64), 2..20),
    ) {
        let distortion = match lens {
            0 => Distortion::PlumbBob { k1: -0.45, k2: 0.25, p1: 0.002, p2: -0.003, k3: -0.06 },
            _ => Distortion::Equidistant { k1: -0.0071, k2: 0.0427, k3: -0.0402, k4: 0.0074 },
        };
        // Rays up to 76 degrees off the axis.
        let (fx_px, fy_px) = if lens == 2 { (300.0, 300.0) } else { (camera().fx_px, camera().fy_px) };
        let rig = CameraAndPlane {
            camera: Camera { fx_px, fy_px, distortion, ..camera() },
            plane: LaserPlane { normal: Vector3::z_axis(), distance_m: 1.0 },
            ..rig()
        };
        let mut cuts = rig.cuts(StripeDirection::Horizontal);
        for (u, v) in steps {
            let near = cuts.place(u, v);
            let ray = rig.camera.ray(DistortedPixel(Point2::new(u, v)));
            // On this plane a point is its ray; z grows upwards there.
            let origin = rig.camera_from_laser(StripeDirection::Horizontal).inverse();
            let exact = ray.map(|ray| origin * Point3::from(ray));
            prop_assert_eq!(near.is_some(), exact.is_some());
            if let (Some(near), Some(exact)) = (near, exact) {
                // An angle looks larger on the plane the farther it lies off the axis.
                let stretch = if lens == 0 { 1.0 } else { 1.0 + ray.unwrap().xy().norm_squared() };
                let error_px = (near.x_m - exact.x).hypot(near.z_m - exact.z) * fx_px / stretch;
                prop_assert!(error_px < 1e-6, "{error_px}");
            }
        }
    }

    /// Without distortion, formula 6 and the intersection of ray and plane give the same geometry.
    #[test]
    fn formula_6_agrees_with_ray_and_plane(
        along in 0.0..2592.0_f64, across in 0.0..2048.0_f64, beta_rad in 0.15..1.2_f64,
        height_sign in prop::sample::select(vec![-1_i8, 1]), direction in directions(),
    ) {
        let formula = VerticalIncidence {
            frame_id: "laser".into(),
            image_distance_m: 0.026,
            object_distance_m: 0.3,
            beta_rad,
            pixel_pitch_m: 4.8e-6,
            base_row_px: 1024.0,
            center_column_px: 1295.5,
            height_sign,
            quality: None,
        };
        let rays = formula.camera_and_plane(direction, (2592, 2592));
        let pose = Calibration::VerticalIncidence(formula.clone()).camera_from_laser(direction).unwrap();
        let other = rays.camera_from_laser(direction);
        prop_assert!((pose.to_homogeneous() - other.to_homogeneous()).amax() < 1e-12, "{} {}", pose, other);
        match (formula.place(along, across), rays.cuts(direction).place(along, across)) {
            (Some(one), Some(other)) => {
                let scale = 1.0_f64.max(one.z_m.abs()).max(one.x_m.abs());
                prop_assert!((one.x_m - other.x_m).abs() < 1e-9 * scale * scale, "{one:?} {other:?}");
                prop_assert!((one.z_m - other.z_m).abs() < 1e-9 * scale * scale, "{one:?} {other:?}");
            }
            (one, other) => prop_assert!(one.is_none() && other.is_none(), "{one:?} {other:?}"),
        }
    }
}

/// With distortion they disagree, because formula 6 has none. The difference is the effect of the distortion.
#[test]
fn formula_6_is_wrong_where_the_lens_bends() {
    let calibration = Calibration::from_yaml(
        "{type: vertical_incidence, frame_id: laser, image_distance_m: 0.026, object_distance_m: 0.3, \
         beta_rad: 0.5236, pixel_pitch_m: 4.8e-6, base_row_px: 1024.0, center_column_px: 1295.5, height_sign: -1}",
    );
    let Ok(Calibration::VerticalIncidence(formula)) = calibration else {
        panic!("{calibration:?}")
    };
    let mut rays = formula.camera_and_plane(StripeDirection::Horizontal, (2592, 2048));
    rays.camera.distortion = Distortion::PlumbBob { k1: -0.1, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
    let apart = |u: f64, v: f64| {
        let one = formula.place(u, v).unwrap();
        let other = rays.cuts(StripeDirection::Horizontal).place(u, v).unwrap();
        (one.x_m - other.x_m).hypot(one.z_m - other.z_m)
    };
    assert!(apart(1295.5, 1024.0) < 1e-12, "on the optical axis there is no distortion");
    assert!(
        apart(2591.0, 0.0) > 1e-4,
        "in a corner it is more than 100 µm: {}",
        apart(2591.0, 0.0)
    );
}
