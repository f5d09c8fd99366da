//! The camera model against points that OpenCV projected: `tests/data/opencv`.

use laser_profiler::{
    scanner::camera::{Camera, DistortedPixel, Distortion},
    simulate::rig::Lens,
};
use nalgebra::{Point2, Point3};

/// Returns the lines of the table: the camera, a point, and its projection by OpenCV.
fn projections() -> Vec<(Camera, Point3<f64>, Point2<f64>)> {
    let table = include_str!("../data/opencv/projections.csv");
    let lines = table.lines().filter(|line| !line.starts_with(['#', 'c']));
    lines
        .map(|line| {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            let &[_, fx_px, fy_px, cx_px, cy_px, k1, k2, p1, p2, k3, k4, k5, k6, tau_x, tau_y, ..] =
                values.as_slice()
            else {
                panic!("{line}");
            };
            let distortion = if [k4, k5, k6].iter().all(|coefficient| *coefficient == 0.0) {
                Distortion::PlumbBob { k1, k2, p1, p2, k3 }
            } else {
                Distortion::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 }
            };
            let tilt_rad = [tau_x, tau_y];
            let (width_px, height_px) = (2592, 2048);
            let camera =
                Camera { width_px, height_px, fx_px, fy_px, cx_px, cy_px, distortion, tilt_rad };
            let point = Point3::new(values[15], values[16], values[17]);
            (camera, point, Point2::new(values[18], values[19]))
        })
        .collect()
}

#[test]
fn points_are_seen_where_opencv_sees_them() {
    let projections = projections();
    assert_eq!(projections.len(), 240);
    for (camera, point, expected) in projections {
        let DistortedPixel(seen) = camera.project(point).unwrap();
        assert!((seen - expected).norm() < 1e-8, "{camera:?}: {seen}, OpenCV states {expected}");
    }
}

#[test]
fn a_pixel_looks_at_the_point_that_opencv_projected_there() {
    for (camera, point, pixel) in projections() {
        let ray = camera.ray(DistortedPixel(pixel)).unwrap();
        let error = (ray - point.coords / point.z).xy().norm() * camera.fx_px;
        assert!(error < 1e-6, "{camera:?}: {ray} for {point}: {error} px");
    }
}

/// The renderer is an independent implementation of the same formulas.
#[test]
fn the_simulated_lens_is_that_of_opencv() {
    for (camera, point, expected) in projections() {
        let mut distortion = [0.0; 8];
        let coefficients = camera.distortion.coefficients();
        distortion[..coefficients.len()].copy_from_slice(&coefficients);
        let lens = Lens {
            focal_px: [camera.fx_px, camera.fy_px],
            center_px: [camera.cx_px, camera.cy_px],
            distortion,
            equidistant: None,
            tilt_rad: camera.tilt_rad,
        };
        let seen = Point2::from(lens.project(point.into()).unwrap());
        assert!((seen - expected).norm() < 1e-8, "{lens:?}: {seen}, OpenCV states {expected}");
    }
}

/// Returns the lines of the table of fisheyes: the camera, a point, and its projection by OpenCV.
fn fisheyes() -> Vec<(Camera, Point3<f64>, Point2<f64>)> {
    let table = include_str!("../data/opencv/fisheye.csv");
    let lines = table.lines().filter(|line| !line.starts_with(['#', 'c']));
    lines
        .map(|line| {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            let &[_, fx_px, fy_px, cx_px, cy_px, k1, k2, k3, k4, x, y, z, column, row] =
                values.as_slice()
            else {
                panic!("{line}");
            };
            let distortion = Distortion::Equidistant { k1, k2, k3, k4 };
            let (width_px, height_px, tilt_rad) = (2592, 2048, [0.0; 2]);
            let camera =
                Camera { width_px, height_px, fx_px, fy_px, cx_px, cy_px, distortion, tilt_rad };
            (camera, Point3::new(x, y, z), Point2::new(column, row))
        })
        .collect()
}

/// Forwards and backwards, from the axis to the edge of the field of view: 82 degrees off the axis.
#[test]
fn a_fisheye_is_that_of_opencv() {
    let fisheyes = fisheyes();
    assert_eq!(fisheyes.len(), 160);
    for (camera, point, expected) in fisheyes {
        let DistortedPixel(seen) = camera.project(point).unwrap();
        assert!((seen - expected).norm() < 1e-8, "{camera:?}: {seen}, OpenCV states {expected}");
        let ray = camera.ray(DistortedPixel(expected)).unwrap();
        let error = (ray.normalize() - point.coords.normalize()).norm() * camera.fx_px;
        assert!(error < 1e-6, "{camera:?}: {ray} for {point}: {error} px");

        let Distortion::Equidistant { k1, k2, k3, k4 } = camera.distortion else { panic!() };
        let lens = Lens {
            focal_px: [camera.fx_px, camera.fy_px],
            center_px: [camera.cx_px, camera.cy_px],
            distortion: [0.0; 8],
            equidistant: Some([k1, k2, k3, k4]),
            tilt_rad: [0.0; 2],
        };
        let simulated = Point2::from(lens.project(point.into()).unwrap());
        assert!((simulated - expected).norm() < 1e-8, "{simulated}, OpenCV states {expected}");
    }
}
