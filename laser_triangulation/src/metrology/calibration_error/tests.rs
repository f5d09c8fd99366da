use super::*;
use crate::{
    metrology::noise::surface,
    scanner::{
        calibration::{Lines, PlaneQuality, Projective, StepsQuality, Triangulator},
        camera::{Camera, Distortion},
        laser_plane::LaserPlane,
        profile::Profile,
        stripe::Centerline,
    },
};

fn geometry(covariance: Option<[f64; 9]>) -> CameraAndPlane {
    CameraAndPlane {
        frame_id: "laser_plane".into(),
        camera_name: "camera".into(),
        camera: Camera {
            width_px: 640,
            height_px: 480,
            fx_px: 1000.0,
            fy_px: 1000.0,
            cx_px: 319.5,
            cy_px: 239.5,
            distortion: Distortion::PlumbBob { k1: 0.1, k2: -0.1, p1: 0.0, p2: 0.0, k3: 0.0 },
            tilt_rad: [0.0; 2],
        },
        camera_quality: None,
        plane: LaserPlane {
            normal: Unit::new_normalize(Vector3::new(0.0, -0.8, 0.6)),
            distance_m: 0.18,
        },
        plane_quality: Some(PlaneQuality {
            rms_m: 0.0,
            boards_used: 20,
            covariance,
            camera_response: None,
            volume: None,
        }),
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: None,
    }
}

#[test]
fn a_plane_at_another_distance_scales_the_scene() {
    let mut covariance = [0.0; 9];
    covariance[8] = (0.18e-3_f64).powi(2);
    let calibration = Calibration::CameraAndPlane(Box::new(geometry(Some(covariance))));
    let found = perturbations(&calibration, StripeDirection::Horizontal).unwrap();
    assert_eq!(found.len(), 1);
    let scene = surface(|x, _| 1e-3 + 0.2 * x, 0.0, 1, 0);
    let moved = found[0].apply(&scene, &[]);
    for (before, after) in scene.points.iter().zip(&moved.points) {
        // Rays from the lens to a parallel plane a thousandth farther (or nearer) away.
        let ratio = [after.x / before.x, after.z / before.z];
        assert!(ratio.iter().all(|r| ((r - 1.0).abs() - 1e-3).abs() < 1e-7), "{ratio:?}");
        assert!((after.y - before.y).abs() < 1e-15);
    }
}

#[test]
fn a_homography_with_one_uncertain_entry_moves_along_it() {
    // x = 1e-4 u, z = 2e-4 v; the scale of z is known to one percent.
    let mut covariance = vec![0.0; 81];
    covariance[4 * 9 + 4] = (2e-6_f64).powi(2);
    let map = Projective {
        frame_id: "laser_plane".into(),
        width_px: 640,
        height_px: 480,
        homography: [1e-4, 0.0, 0.0, 0.0, 2e-4, 0.0, 0.0, 0.0, 1.0],
        quality: Some(StepsQuality {
            rms_m: 0.0,
            heights_used: 5,
            covariance,
            volume: None,
            bow: None,
        }),
        calibrated_at: None,
    };
    let calibration = Calibration::Projective(Box::new(map));
    let found = perturbations(&calibration, StripeDirection::Horizontal).unwrap();
    assert_eq!(found.len(), 1);
    let scene = surface(|x, y| 1e-3 + x + y, 0.0, 1, 0);
    for (before, after) in scene.points.iter().zip(&found[0].apply(&scene, &[]).points) {
        assert!((after.x - before.x).abs() < 1e-12);
        assert!(((after.z - before.z).abs() - 0.01 * before.z.abs()).abs() < 1e-12);
    }
}

/// Profiles state the error of their heights that these perturbations cause.
#[test]
fn profiles_state_the_same() {
    let direction = StripeDirection::Horizontal;
    let mut covariance = vec![0.0; 81];
    (covariance[4 * 9 + 4], covariance[7 * 9 + 7]) = (4e-14, 1e-12);
    let map = Projective {
        frame_id: "laser_plane".into(),
        width_px: 640,
        height_px: 480,
        homography: [1e-4, 0.0, -0.03, 0.0, -1e-4, 0.03, 0.0, -2e-4, 1.0],
        quality: Some(StepsQuality {
            rms_m: 0.0,
            heights_used: 5,
            covariance,
            volume: None,
            bow: None,
        }),
        calibrated_at: None,
    };
    let plane = [1e-8, 2e-9, 0.0, 2e-9, 4e-8, 1e-9, 0.0, 1e-9, 1e-8];
    for calibration in [
        Calibration::Projective(Box::new(map)),
        Calibration::CameraAndPlane(Box::new(geometry(Some(plane)))),
    ] {
        // Without its table, which interpolates: `height_sigma` tests how well.
        let triangulator = Triangulator::new(calibration.clone());
        let centerline = Centerline {
            u_px: vec![20.0, 311.0, 600.0],
            v_px: vec![100.25, 240.5, 400.75],
            intensity: vec![100.0; 3],
            sigma_px: vec![0.1; 3],
            flags: vec![0; 3],
            ..Centerline::default()
        };
        let lines = Lines { direction, first: 0, count: 640 };
        let mut profile = Profile::default();
        triangulator.triangulate(&centerline, &lines, 255, &mut profile);
        for line in [20, 311, 600] {
            let [x, z] = [profile.x_m[line], profile.z_m[line]].map(f64::from);
            let scene = Surface { width: 1, points: vec![Point3::new(x, 0.0, z)] };
            let all = perturbations(&calibration, direction).unwrap();
            let squares = all.iter().map(|one| (one.apply(&scene, &[]).points[0].z - z).powi(2));
            let wanted = squares.sum::<f64>().sqrt();
            let stated = f64::from(profile.calibration_sigma_z_m[line]);
            assert!((stated / wanted - 1.0).abs() < 1e-3, "{line}: {stated} {wanted}");
        }
    }
}

#[test]
fn a_file_without_covariance_is_an_error() {
    let calibration = Calibration::CameraAndPlane(Box::new(geometry(None)));
    let error = perturbations(&calibration, StripeDirection::Horizontal).unwrap_err();
    assert!(error.contains("laser plane"), "{error}");
}
