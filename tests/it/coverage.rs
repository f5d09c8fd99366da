//! Coverage of the stated uncertainty of a measured length: 500 rigs, each calibrated from its own noisy boards.
//!
//! Boards and points are projected by the simulated lens. A calibration is the least-squares estimate from its noisy
//! corners, to first order, as is its covariance; the plane of light is fitted to noisy points. Then a length in the plane
//! is measured in a noisy image, and its 95 % interval holds the true length or not.

use laser_profiler::{
    metrology::{calibration_error::perturbations, surface::Surface},
    scanner::{
        calibration::{Calibration, CameraAndPlane, CameraQuality, Lines, PlaneQuality},
        camera::{Camera, Distortion},
        laser_plane::LaserPlane,
        params::StripeDirection,
        profile::Profile,
        stripe::Centerline,
    },
    simulate::{noise::frame_rng, rig::Lens},
};
use nalgebra::{DMatrix, DVector, Point3, Rotation3, Unit, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

const RIGS: u64 = 500;
const SIZE: (u32, u32) = (1280, 1024);
const BOARDS: usize = 10;
const CORNER_SIGMA_PX: f64 = 0.1;
const PLANE_POINTS: usize = 200;
const PLANE_SIGMA_M: f64 = 0.0003;
const STRIPE_SIGMA_PX: f64 = 0.1;
/// fx, fy, cx, cy, k1, k2.
const CAMERA_VALUES: usize = 6;

fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}

/// A lens of focal lengths, centre, k1 and k2.
pub(crate) fn lens(values: &[f64]) -> Lens {
    let &[fx, fy, cx, cy, k1, k2, ..] = values else { panic!("{values:?}") };
    let distortion = [k1, k2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (focal_px, center_px) = ([fx, fy], [cx, cy]);
    Lens { focal_px, center_px, distortion, equidistant: None, tilt_rad: [0.0; 2] }
}

/// Corners of all boards for camera values followed by rotation and place of each board.
fn corners(values: &DVector<f64>) -> DVector<f64> {
    let lens = lens(values.as_slice());
    let mut seen = Vec::new();
    for board in values.as_slice()[CAMERA_VALUES..].chunks_exact(6) {
        let rotation = Rotation3::from_scaled_axis(Vector3::from_row_slice(&board[..3]));
        let place = Vector3::from_row_slice(&board[3..]);
        for corner in 0..35 {
            let (x, y) = (f64::from(corner % 7) - 3.0, f64::from(corner / 7) - 2.0);
            let point = rotation * Vector3::new(0.03 * x, 0.03 * y, 0.0) + place;
            seen.extend(lens.project(point.into()).unwrap());
        }
    }
    DVector::from_vec(seen)
}

/// The least-squares estimate of values near the true ones, from errors of the observations, and its covariance.
fn estimate(
    jacobian: &DMatrix<f64>,
    errors: &DVector<f64>,
    sigma: f64,
) -> (DVector<f64>, DMatrix<f64>) {
    // Scaled so that pixels and radians fit into one matrix.
    let scales = DVector::from_iterator(
        jacobian.ncols(),
        jacobian.column_iter().map(|column| 1.0 / column.norm()),
    );
    let scaled = jacobian * DMatrix::from_diagonal(&scales);
    let inverse = (scaled.transpose() * &scaled).try_inverse().unwrap();
    let unscale = DMatrix::from_diagonal(&scales);
    let covariance = &unscale * inverse * &unscale;
    (&covariance * (jacobian.transpose() * errors), covariance * (sigma * sigma))
}

/// A camera, and its calibration from ten noisy views of a board.
fn camera(random: &mut impl Rng) -> (Lens, Camera, CameraQuality) {
    let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let focal_px = between(1200.0, 2500.0);
    let mut values = vec![
        focal_px,
        focal_px * between(0.99, 1.01),
        between(600.0, 680.0),
        between(470.0, 550.0),
        between(-0.2, 0.1),
        between(-0.1, 0.1),
    ];
    for _ in 0..BOARDS {
        values.extend([between(-0.6, 0.6), between(-0.6, 0.6), between(-0.5, 0.5)]);
        values.extend([between(-0.05, 0.05), between(-0.05, 0.05), between(0.4, 0.7)]);
    }
    let values = DVector::from_vec(values);
    let mut jacobian = DMatrix::zeros(BOARDS * 70, values.len());
    for value in 0..values.len() {
        let step = 1e-6 * values[value].abs().max(1.0);
        let at = |sign: f64| {
            let mut moved = values.clone();
            moved[value] += sign * step;
            corners(&moved)
        };
        jacobian.set_column(value, &((at(1.0) - at(-1.0)) / (2.0 * step)));
    }
    let errors = DVector::from_fn(jacobian.nrows(), |_, _| CORNER_SIGMA_PX * normal(random));
    let (change, covariance) = estimate(&jacobian, &errors, CORNER_SIGMA_PX);
    let found = &values + change;
    let camera = Camera {
        width_px: SIZE.0,
        height_px: SIZE.1,
        fx_px: found[0],
        fy_px: found[1],
        cx_px: found[2],
        cy_px: found[3],
        distortion: Distortion::PlumbBob { k1: found[4], k2: found[5], p1: 0.0, p2: 0.0, k3: 0.0 },
        tilt_rad: [0.0; 2],
    };
    let quality = CameraQuality {
        rms_px: CORNER_SIGMA_PX,
        views_used: BOARDS as u32,
        views_rejected: 0,
        parameters: ["fx", "fy", "cx", "cy", "k1", "k2"].map(str::to_owned).into(),
        covariance: covariance
            .view((0, 0), (CAMERA_VALUES, CAMERA_VALUES))
            .iter()
            .copied()
            .collect(),
        volume: None,
    };
    (lens(values.as_slice()), camera, quality)
}

/// A laser plane, and its fit to noisy points.
fn plane(random: &mut impl Rng) -> (LaserPlane, LaserPlane, PlaneQuality) {
    let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let direction = Vector3::new(between(-0.3, 0.3), -0.8, between(0.4, 0.9));
    let truth =
        LaserPlane { normal: Unit::new_normalize(direction), distance_m: between(0.2, 0.35) };
    let [first, second] = truth.tangents();
    let origin = Vector3::z() * (truth.distance_m / truth.normal.z);
    let mut rows = DMatrix::zeros(PLANE_POINTS, 3);
    for mut row in rows.row_iter_mut() {
        let point = origin + first * between(-0.08, 0.08) + second * between(-0.08, 0.08);
        row.copy_from_slice(&[first.dot(&point), second.dot(&point), -1.0]);
    }
    // (n + a t1 + b t2) · p - (d + c) = 0 of points that lie off the plane by their errors.
    let errors = DVector::from_fn(PLANE_POINTS, |_, _| -PLANE_SIGMA_M * normal(random));
    let (change, covariance) = estimate(&rows, &errors, PLANE_SIGMA_M);
    let tilted = truth.normal.into_inner() + first * change[0] + second * change[1];
    let found = LaserPlane {
        normal: Unit::new_normalize(tilted),
        distance_m: truth.distance_m + change[2],
    };
    let quality = PlaneQuality {
        rms_m: PLANE_SIGMA_M,
        boards_used: 10,
        covariance: covariance.as_slice().try_into().ok(),
        camera_response: None,
        volume: None,
    };
    (truth, found, quality)
}

/// Two points of the plane that the camera sees in different columns.
fn points(random: &mut impl Rng, lens: &Lens, plane: &LaserPlane) -> [(Point3<f64>, [f64; 2]); 2] {
    let [first, second] = plane.tangents();
    let origin = Point3::new(0.0, 0.0, plane.distance_m / plane.normal.z);
    let mut draw = || loop {
        let mut between = |half: f64| half * (2.0 * random.random::<f64>() - 1.0);
        let point = origin + first * between(0.08) + second * between(0.08);
        let Some([u, v]) = lens.project(point.into()) else { continue };
        // A stripe's position is known in whole columns.
        if (1.0..f64::from(SIZE.0) - 2.0).contains(&u)
            && (1.0..f64::from(SIZE.1) - 2.0).contains(&v)
        {
            return (point, [u, v]);
        }
    };
    loop {
        let pair = [draw(), draw()];
        if (pair[0].0 - pair[1].0).norm() > 0.02 && (pair[0].1[0] - pair[1].1[0]).abs() > 2.0 {
            return pair;
        }
    }
}

/// x and z of both pixels.
fn measured(rig: &CameraAndPlane, pixels: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    pixels.map(|[u, v]| {
        let centerline = Centerline {
            u_px: vec![u as f32],
            v_px: vec![v as f32],
            intensity: vec![1.0],
            sigma_px: vec![STRIPE_SIGMA_PX as f32],
            flags: vec![0],
            ..Centerline::default()
        };
        let lines =
            Lines { direction: StripeDirection::Horizontal, first: 0, count: SIZE.0 as usize };
        let mut profile = Profile::default();
        let calibration = Calibration::CameraAndPlane(Box::new(rig.clone()));
        calibration.triangulate(&centerline, &lines, 255, &mut profile);
        let entry = u as usize;
        [f64::from(profile.x_m[entry]), f64::from(profile.z_m[entry])]
    })
}

fn length(places: [[f64; 2]; 2]) -> f64 {
    (places[0][0] - places[1][0]).hypot(places[0][1] - places[1][1])
}

/// Error of a measured length and its stated standard deviation, metres: all, and without the calibration's part.
fn trial(number: u64) -> (f64, f64, f64) {
    let random = &mut frame_rng(2026, number);
    let (lens, camera, camera_quality) = camera(random);
    let (truth, plane, plane_quality) = plane(random);
    let rig = CameraAndPlane {
        frame_id: "laser".into(),
        camera_name: "camera".into(),
        camera,
        camera_quality: Some(camera_quality),
        plane,
        plane_quality: Some(plane_quality),
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: None,
    };
    let pair = points(random, &lens, &truth);
    let pixels = pair.map(|(_, [u, v])| [u, v + STRIPE_SIGMA_PX * normal(random)]);
    let places = measured(&rig, pixels);
    let measured_m = length(places);
    let points = places.map(|[x_m, z_m]| Point3::new(x_m, 0.0, z_m)).to_vec();
    let surface = Surface { width: 1, points };
    let calibration = Calibration::CameraAndPlane(Box::new(rig.clone()));
    let of_calibration: f64 = perturbations(&calibration, StripeDirection::Horizontal)
        .unwrap()
        .iter()
        .map(|other| other.apply(&surface, &[]).points)
        .map(|points| ((points[0] - points[1]).norm() - measured_m).powi(2))
        .sum();
    let of_image: f64 = (0..2)
        .map(|point| {
            let mut moved = pixels;
            moved[point][1] += STRIPE_SIGMA_PX;
            (length(measured(&rig, moved)) - measured_m).powi(2)
        })
        .sum();
    let true_m = (pair[0].0 - pair[1].0).norm();
    (measured_m - true_m, (of_calibration + of_image).sqrt(), of_image.sqrt())
}

#[test]
fn the_stated_interval_holds_the_true_length_in_95_of_100_rigs() {
    let trials: Vec<_> = (0..RIGS).map(trial).collect();
    let share = |held: fn(&(f64, f64, f64)) -> bool| {
        trials.iter().filter(|trial| held(trial)).count() as f64 / RIGS as f64
    };
    let covered = share(|(error_m, sigma_m, _)| error_m.abs() <= 1.96 * sigma_m);
    let without = share(|(error_m, _, sigma_m)| error_m.abs() <= 1.96 * sigma_m);
    assert!((covered - 0.95).abs() <= 0.02, "{covered}");
    // The test can fail: noise of the image alone explains too little.
    assert!(without < 0.8, "{without}");
}
