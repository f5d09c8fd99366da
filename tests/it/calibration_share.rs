//! Coverage of the calibration's share in the uncertainty of `measure`: with a rotary axis, with a tilted axis, and by
//! formula 6.
//!
//! A true rig sees two points of a part at two positions: a lens and rotations that are written here project them. A
//! calibration that is off by a random draw of its stated covariance measures their distance.

use laser_profiler::{
    metrology::{calibration_error::perturbations, surface::Surface},
    scanner::{
        axis::{Axis, AxisKind, RawPosition},
        calibration::{
            AxisQuality, Calibration, CameraAndPlane, CameraQuality, Lines, PlaneQuality,
            StepsQuality, VerticalIncidence,
        },
        camera::{Camera, Distortion},
        laser_plane::LaserPlane,
        motion::{Position, placement::Placement},
        params::StripeDirection,
        profile::Profile,
        stripe::Centerline,
    },
    simulate::noise::frame_rng,
};
use nalgebra::{DMatrix, DVector, Isometry3, Point3, Rotation3, Unit, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use crate::coverage::lens;

const TRIALS: u64 = 500;
const DIRECTION: StripeDirection = StripeDirection::Horizontal;
const SIZE: (u32, u32) = (1280, 1024);
const CAMERA_SIGMA: [f64; 6] = [1.1, 1.1, 0.6, 0.5, 0.004, 0.02];
const PLANE_SIGMA: [f64; 3] = [4e-4, 3e-4, 1.5e-4];
const DIRECTION_SIGMA_RAD: f64 = 6e-4;
const POINT_SIGMA_M: f64 = 3e-4;
const SCALE_SIGMA: f64 = 4e-4;
/// Standard deviations of a, b, β and the base row.
const VERTICAL_SIGMA: [f64; 4] = [0.0, 4e-4, 2e-3, 0.4];

/// Returns a covariance of these standard deviations, with the first two values correlated.
fn covariance(sigma: &[f64], correlation: f64) -> DMatrix<f64> {
    let mut all =
        DMatrix::from_fn(
            sigma.len(),
            sigma.len(),
            |i, j| {
                if i == j { sigma[i] * sigma[i] } else { 0.0 }
            },
        );
    let (i, j) = (sigma.len() - 2, sigma.len() - 1);
    for (a, b) in [(0, 1), (i, j)] {
        all[(a, b)] = correlation * sigma[a] * sigma[b];
        all[(b, a)] = all[(a, b)];
    }
    all
}

/// A draw of values of that covariance.
fn draw(random: &mut impl Rng, covariance: &DMatrix<f64>) -> DVector<f64> {
    let eigen = covariance.clone().symmetric_eigen();
    let lengths = eigen.eigenvalues.map(|square| square.max(0.0).sqrt());
    let normal = DVector::from_fn(lengths.len(), |_, _| StandardNormal.sample(random));
    eigen.eigenvectors * lengths.component_mul(&normal)
}

fn between(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.random::<f64>()
}

/// Returns x and z of a pixel, metres.
fn measured(calibration: &Calibration, [u, v]: [f64; 2]) -> [f64; 2] {
    let centerline = Centerline {
        u_px: vec![u as f32],
        v_px: vec![v as f32],
        intensity: vec![1.0],
        sigma_px: vec![0.1],
        flags: vec![0],
        ..Centerline::default()
    };
    let lines = Lines { direction: DIRECTION, first: 0, count: SIZE.0 as usize };
    let mut profile = Profile::default();
    calibration.triangulate(&centerline, &lines, 255, &mut profile);
    [f64::from(profile.x_m[u as usize]), f64::from(profile.z_m[u as usize])]
}

fn length(surface: &Surface) -> f64 {
    (surface.points[0] - surface.points[1]).norm()
}

/// Returns measured minus true length, and the stated standard deviation, metres.
fn judged(
    calibration: &Calibration,
    points: [Point3<f64>; 2],
    positions: &[f64],
    true_m: f64,
) -> [f64; 2] {
    let surface = Surface { width: 1, points: points.to_vec() };
    let measured_m = length(&surface);
    let all = perturbations(calibration, DIRECTION).unwrap();
    let moved = all.iter().map(|other| length(&other.apply(&surface, positions)) - measured_m);
    [measured_m - true_m, moved.map(|by| by * by).sum::<f64>().sqrt()]
}

/// Two points of a part on an axis, seen 0.02 m apart in the image or more.
fn moved_part(number: u64, kind: AxisKind) -> [f64; 2] {
    let random = &mut frame_rng(2027, number);
    let values = [1600.0, 1605.0, 640.0, 510.0, -0.1, 0.05];
    let normal = Vector3::new(between(random, -0.3, 0.3), -0.8, between(random, 0.5, 0.9));
    let plane = LaserPlane { normal: Unit::new_normalize(normal), distance_m: 0.25 };
    let lean = Vector3::new(between(random, -0.5, 0.5), between(random, -0.5, 0.5), 0.0);
    let axis = match kind {
        AxisKind::Revolute => Vector3::new(0.0, -0.9, -0.4) + 0.3 * lean,
        AxisKind::Prismatic => plane.normal.into_inner() + lean,
    };
    let axis = Unit::new_normalize(axis);
    let on_axis_m = Point3::new(0.02, 0.05, 0.35);
    let positions = match kind {
        AxisKind::Revolute => [between(random, -3.0, 3.0), between(random, -3.0, 3.0)],
        AxisKind::Prismatic => [between(random, -0.1, 0.1), between(random, -0.1, 0.1)],
    };
    // The true rig.
    let [first, second] = plane.tangents();
    let lens = lens(&values);
    let origin = Point3::new(0.0, 0.0, plane.distance_m / plane.normal.z);
    let mut seen = || loop {
        let [a, b] = [between(random, -0.08, 0.08), between(random, -0.08, 0.08)];
        let point = origin + first * a + second * b;
        let Some([u, v]) = lens.project(point.into()) else { continue };
        let is_inside = |value: f64, size: u32| (1.0..f64::from(size) - 2.0).contains(&value);
        if is_inside(u, SIZE.0) && is_inside(v, SIZE.1) {
            return (point, [u, v]);
        }
    };
    let pair = [seen(), seen()];
    // Back to where both were at position 0.
    let at_0 = |(point, position): (Point3<f64>, f64)| match kind {
        AxisKind::Revolute => {
            on_axis_m + Rotation3::from_axis_angle(&axis, -position) * (point - on_axis_m)
        }
        AxisKind::Prismatic => point - axis.into_inner() * position,
    };
    let true_m = (at_0((pair[0].0, positions[0])) - at_0((pair[1].0, positions[1]))).norm();
    // The rig as calibrated.
    let rig = off(
        random,
        &values,
        &plane,
        &Axis { kind, point_m: on_axis_m, direction: axis, scale: 1.0 },
    );
    let mut placement = Placement::new(rig.camera_from_laser(DIRECTION), rig.axis);
    let calibration = Calibration::CameraAndPlane(Box::new(rig));
    let points = [0, 1].map(|k| {
        let part_from_laser: Isometry3<f64> =
            placement.place(&mut Position::at(RawPosition(positions[k])));
        let [x_m, z_m] = measured(&calibration, pair[k].1);
        part_from_laser * Point3::new(x_m, 0.0, z_m)
    });
    judged(&calibration, points, &positions, true_m)
}

/// A rig with errors drawn from its stated covariance.
fn off(random: &mut impl Rng, camera: &[f64], plane: &LaserPlane, axis: &Axis) -> CameraAndPlane {
    let of_camera = covariance(&CAMERA_SIGMA, 0.9);
    let found = DVector::from_row_slice(camera) + draw(random, &of_camera);
    let of_plane = covariance(&PLANE_SIGMA, -0.5);
    let [t1, t2] = plane.tangents();
    let change = draw(random, &of_plane);
    let normal = plane.normal.into_inner() + t1 * change[0] + t2 * change[1];
    let mut across = |sigma: f64| {
        let [a, b, c] = [0; 3].map(|_| -> f64 { StandardNormal.sample(random) });
        let any = Vector3::new(a, b, c) * sigma;
        any - axis.direction.into_inner() * axis.direction.dot(&any)
    };
    let (turn, shift) = (across(DIRECTION_SIGMA_RAD), across(POINT_SIGMA_M));
    let scale: f64 = StandardNormal.sample(random);
    CameraAndPlane {
        frame_id: "laser".into(),
        camera_name: "camera".into(),
        camera: Camera {
            width_px: SIZE.0,
            height_px: SIZE.1,
            fx_px: found[0],
            fy_px: found[1],
            cx_px: found[2],
            cy_px: found[3],
            distortion: Distortion::PlumbBob {
                k1: found[4],
                k2: found[5],
                p1: 0.0,
                p2: 0.0,
                k3: 0.0,
            },
            tilt_rad: [0.0; 2],
        },
        camera_quality: Some(CameraQuality {
            rms_px: 0.1,
            views_used: 20,
            views_rejected: 0,
            parameters: ["fx", "fy", "cx", "cy", "k1", "k2"].map(str::to_owned).into(),
            covariance: of_camera.as_slice().to_vec(),
            volume: None,
        }),
        plane: LaserPlane {
            normal: Unit::new_normalize(normal),
            distance_m: plane.distance_m + change[2],
        },
        plane_quality: Some(PlaneQuality {
            rms_m: 3e-4,
            boards_used: 20,
            covariance: of_plane.as_slice().try_into().ok(),
            camera_response: None,
            volume: None,
        }),
        alignment: None,
        part: None,
        axis: Some(Axis {
            direction: Unit::new_normalize(axis.direction.into_inner() + turn),
            point_m: axis.point_m + shift,
            scale: 1.0 + SCALE_SIGMA * scale,
            ..*axis
        }),
        axis_quality: Some(AxisQuality {
            positions_used: 40,
            direction_sigma_rad: Some(DIRECTION_SIGMA_RAD),
            point_sigma_m: Some(POINT_SIGMA_M),
            scale_sigma: Some(SCALE_SIGMA),
            ..AxisQuality::default()
        }),
        calibrated_at: None,
    }
}

/// Two points of the laser plane, seen by a pinhole that is written with vectors, not by formula 6.
fn formula_6(number: u64) -> [f64; 2] {
    let random = &mut frame_rng(2028, number);
    let truth = VerticalIncidence {
        frame_id: "laser".into(),
        image_distance_m: 0.026,
        object_distance_m: between(random, 0.2, 0.4),
        beta_rad: between(random, 0.4, 0.8),
        pixel_pitch_m: 5e-6,
        base_row_px: 512.0,
        center_column_px: 640.0,
        height_sign: -1,
        quality: None,
    };
    let (sin, cos) = truth.beta_rad.sin_cos();
    let lens = Vector3::new(0.0, sin, cos) * truth.object_distance_m;
    let up = Vector3::x().cross(&lens.normalize());
    let mut seen = || loop {
        let [x, z] = [between(random, -0.03, 0.03), between(random, -0.02, 0.02)];
        let ray = Vector3::new(x, 0.0, z) - lens;
        let scale = truth.image_distance_m / -ray.dot(&lens.normalize()) / truth.pixel_pitch_m;
        let [u, v] = [640.0 + scale * ray.x, 512.0 - scale * ray.dot(&up)];
        if (1.0..1278.0).contains(&u) && (1.0..1022.0).contains(&v) {
            return ([x, z], [u, v]);
        }
    };
    let pair = [seen(), seen()];
    let [one, other] = pair.map(|(place, _)| place);
    let true_m = (one[0] - other[0]).hypot(one[1] - other[1]);
    let of_all = covariance(&VERTICAL_SIGMA, 0.6);
    let by = draw(random, &of_all);
    let quality = StepsQuality {
        rms_m: 1e-5,
        heights_used: 5,
        covariance: of_all.as_slice().to_vec(),
        volume: None,
        bow: None,
    };
    let found = truth.moved([by[0], by[1], by[2], by[3]]);
    let calibration = VerticalIncidence { quality: Some(quality), ..found };
    // As it is written and read.
    let text = Calibration::VerticalIncidence(calibration).to_yaml();
    let calibration = Calibration::from_yaml(&text).unwrap();
    let points = pair.map(|(_, pixel)| {
        let [x_m, z_m] = measured(&calibration, pixel);
        Point3::new(x_m, 0.0, z_m)
    });
    judged(&calibration, points, &[], true_m)
}

/// The 95 % interval holds the truth in 95 ± 2 of 100; one of half the width, or without the axis, would not.
fn holds(trial: impl Fn(u64) -> [f64; 2]) {
    let trials: Vec<_> = (0..TRIALS).map(trial).collect();
    let share = |factor: f64| {
        let held = trials.iter().filter(|[error_m, sigma_m]| error_m.abs() <= factor * sigma_m);
        held.count() as f64 / TRIALS as f64
    };
    assert!((share(1.96) - 0.95).abs() <= 0.02, "{}", share(1.96));
    assert!(share(0.98) < 0.75, "{}", share(0.98));
}

#[test]
fn of_a_turning_part() {
    holds(|number| moved_part(number, AxisKind::Revolute));
}

#[test]
fn of_a_part_on_a_leaning_axis() {
    holds(|number| moved_part(number, AxisKind::Prismatic));
}

#[test]
fn of_formula_6() {
    holds(formula_6);
}
