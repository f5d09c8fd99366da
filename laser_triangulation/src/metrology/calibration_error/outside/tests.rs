use nalgebra::{Point3, Unit};

use super::*;
use crate::scanner::{
    calibration::{
        CalibratedVolume, CameraAndPlane, CameraQuality, Lines, PlaneQuality, Projective,
        StepsQuality, VerticalIncidence,
    },
    camera::{Camera, Distortion, View},
    laser_plane::LaserPlane,
    profile::Profile,
    stripe::{Centerline, flag},
};

/// Columns 100 to 500 and rows 80 to 400, whose limits are crossed by the lines of [`profile`].
const VOLUME: CalibratedVolume = CalibratedVolume {
    columns_px: [100.0, 500.0],
    rows_px: [80.0, 400.0],
    heights_m: None,
    depths_m: None,
};

fn steps(volume: CalibratedVolume) -> StepsQuality {
    StepsQuality {
        rms_m: 0.0,
        heights_used: 5,
        covariance: vec![],
        volume: Some(volume),
        bow: None,
    }
}

fn projective() -> Calibration {
    Calibration::Projective(Box::new(Projective {
        frame_id: "laser_plane".into(),
        width_px: 640,
        height_px: 480,
        homography: [1e-4, 0.0, -0.032, 0.0, -2e-4, 0.05, 0.0, 1e-4, 1.0],
        quality: Some(steps(VOLUME)),
        calibrated_at: None,
    }))
}

fn vertical() -> Calibration {
    Calibration::VerticalIncidence(VerticalIncidence {
        frame_id: "laser_plane".into(),
        image_distance_m: 0.012,
        object_distance_m: 0.2,
        beta_rad: 0.6,
        pixel_pitch_m: 6e-6,
        base_row_px: 300.0,
        center_column_px: 319.5,
        height_sign: -1,
        quality: Some(steps(VOLUME)),
    })
}

/// The camera knows its lens in a part of the image, the plane is known in another.
fn camera_and_plane(of_plane: CalibratedVolume) -> Calibration {
    let camera = Camera {
        width_px: 640,
        height_px: 480,
        fx_px: 900.0,
        fy_px: 900.0,
        cx_px: 319.5,
        cy_px: 239.5,
        distortion: Distortion::PlumbBob { k1: -0.1, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 },
        tilt_rad: [0.0; 2],
    };
    Calibration::CameraAndPlane(Box::new(CameraAndPlane {
        frame_id: "laser_plane".into(),
        camera_name: "camera".into(),
        camera,
        camera_quality: Some(CameraQuality {
            rms_px: 0.1,
            views_used: 20,
            views_rejected: 0,
            parameters: vec![],
            covariance: vec![],
            volume: Some(VOLUME),
        }),
        plane: LaserPlane {
            normal: Unit::new_normalize(Vector3::new(0.05, -0.8, 0.6)),
            distance_m: 0.18,
        },
        plane_quality: Some(PlaneQuality {
            rms_m: 1e-4,
            boards_used: 20,
            covariance: None,
            camera_response: None,
            volume: Some(of_plane),
        }),
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: None,
    }))
}

/// A stripe on the diagonal of the image, triangulated: its profile, and the pixel (column, row) of each entry.
fn profile(calibration: &Calibration, direction: StripeDirection) -> (Profile, Vec<[f64; 2]>) {
    let count = if direction == StripeDirection::Horizontal { 640_u16 } else { 480 };
    let pixels: Vec<[f64; 2]> = (0..count)
        .map(f64::from)
        .map(|along| match direction {
            StripeDirection::Horizontal => [along, 0.75 * along],
            StripeDirection::Vertical => [along / 0.75, along],
        })
        .collect();
    let line = Centerline {
        u_px: pixels.iter().map(|[u, _]| *u as f32).collect(),
        v_px: pixels.iter().map(|[_, v]| *v as f32).collect(),
        intensity: vec![100.0; pixels.len()],
        sigma_px: vec![0.1; pixels.len()],
        flags: vec![flag::CLIPPED; pixels.len()],
        ..Centerline::default()
    };
    let mut profile = Profile::default();
    let lines = Lines { direction, first: 0, count: pixels.len() };
    calibration.triangulate(&line, &lines, 255, &mut profile);
    (profile, pixels)
}

fn is_flagged(flags: u8) -> bool {
    flags & flag::OUTSIDE_CALIBRATION != 0
}

fn surface(profile: &Profile) -> Surface {
    let both = profile.x_m.iter().zip(&profile.z_m);
    let points =
        both.map(|(x, z)| Point3::new(f64::from(*x), 0.0, f64::from(*z))).collect::<Vec<_>>();
    Surface { width: points.len(), points }
}

/// True where a pixel lies clearly inside, false where clearly outside, `None` within the margin.
fn is_inside([u, v]: [f64; 2]) -> Option<bool> {
    let within =
        |by: f64| (100.0 - by..=500.0 + by).contains(&u) && (80.0 - by..=400.0 + by).contains(&v);
    if within(0.0) { Some(true) } else { (!within(25.0)).then_some(false) }
}

#[test]
fn points_outside_the_image_of_the_gauge_are_flagged_and_counted() {
    for calibration in [projective(), vertical(), camera_and_plane(VOLUME)] {
        for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
            // The fields of formula 6 are named for a horizontal stripe.
            let is_formula = matches!(calibration, Calibration::VerticalIncidence(_));
            if is_formula && direction == StripeDirection::Vertical {
                continue;
            }
            let (profile, pixels) = profile(&calibration, direction);
            for (pixel, flags) in pixels.iter().zip(&profile.flags) {
                assert_eq!(flags & flag::CLIPPED, flag::CLIPPED, "the centre's flags stay");
                if let Some(inside) = is_inside(*pixel) {
                    assert_eq!(is_flagged(*flags), !inside, "{pixel:?} {direction:?}");
                }
            }
            let counted = num_outside(&calibration, direction, &surface(&profile), &[]).unwrap();
            let flagged = profile.num_outside_calibration();
            assert!(counted.abs_diff(flagged) <= 2 && flagged > 100, "{counted} {flagged}");
        }
    }
}

#[test]
fn depths_and_heights_limit_the_volume_too() {
    let direction = StripeDirection::Horizontal;
    let everywhere = CalibratedVolume { columns_px: [0.0, 639.0], rows_px: [0.0, 479.0], ..VOLUME };
    let shallow = CalibratedVolume { depths_m: Some([0.25, 0.32]), ..everywhere };
    let calibration = camera_and_plane(shallow);
    let Calibration::CameraAndPlane(geometry) = &calibration else { panic!() };
    let (profile_of_rig, pixels) = profile(&calibration, direction);
    let mut seen = [0, 0];
    for (i, [column, row]) in pixels.iter().enumerate() {
        // By the definition of depth, from the point itself.
        let at = [f64::from(profile_of_rig.x_m[i]), 0.0, f64::from(profile_of_rig.z_m[i])];
        let depth_m = (geometry.camera_from_laser(direction) * Point3::from(at)).z;
        let is_known = (0.25..=0.32).contains(&depth_m) && is_inside([*column, *row]) == Some(true);
        let is_strange = !(0.246..=0.324).contains(&depth_m);
        assert!(!(is_known && is_flagged(profile_of_rig.flags[i])), "{depth_m}");
        assert!(!is_strange || is_flagged(profile_of_rig.flags[i]), "{depth_m}");
        seen[0] += u32::from(is_known);
        seen[1] += u32::from(is_strange);
    }
    assert!(seen.iter().all(|num| *num > 20), "{seen:?}");

    let Calibration::Projective(mut map) = projective() else { panic!() };
    map.quality = Some(steps(CalibratedVolume { heights_m: Some([0.0, 0.02]), ..everywhere }));
    let (profile_of_map, _) = profile(&Calibration::Projective(map), direction);
    for (z_m, flags) in profile_of_map.z_m.iter().zip(&profile_of_map.flags) {
        assert!(!((0.0..=0.02).contains(z_m) && is_flagged(*flags)), "{z_m}");
        assert!((-0.0011..=0.0211).contains(z_m) || is_flagged(*flags), "{z_m}");
    }
}

#[test]
fn an_image_of_a_part_of_the_sensor_has_the_same_volume() {
    let view = View { offset_px: [50, 40], size_px: [280, 200], binning: [2, 2] };
    for calibration in [projective(), camera_and_plane(VOLUME)] {
        let bounds = calibration.seen_through(&view).bounds(StripeDirection::Horizontal).unwrap();
        let whole = calibration.bounds(StripeDirection::Horizontal).unwrap();
        for pixel in [[30.0, 100.0], [20.0, 30.0], [200.0, 100.0], [237.0, 100.0], [100.0, 179.0]] {
            let [u, v] = pixel;
            let on_sensor = [2.0 * u + 50.5, 2.0 * v + 40.5];
            let at_m = [0.0, 0.0];
            assert_eq!(bounds.contain(pixel, at_m), whole.contain(on_sensor, at_m), "{pixel:?}");
        }
    }
}

#[test]
fn a_calibration_without_a_volume_flags_nothing() {
    let Calibration::Projective(mut map) = projective() else { panic!() };
    map.quality = None;
    let calibration = Calibration::Projective(map);
    let (profile, _) = profile(&calibration, StripeDirection::Horizontal);
    assert_eq!(profile.num_outside_calibration(), 0);
    let surface = surface(&profile);
    assert_eq!(num_outside(&calibration, StripeDirection::Horizontal, &surface, &[]), None);
    let reversed = CalibratedVolume { rows_px: [400.0, 80.0], ..VOLUME };
    let Calibration::Projective(mut map) = projective() else { panic!() };
    map.quality = Some(steps(reversed));
    let error = Calibration::from_yaml(&Calibration::Projective(map).to_yaml()).unwrap_err();
    assert!(error.to_string().contains("steps_quality.volume"), "{error}");
}
