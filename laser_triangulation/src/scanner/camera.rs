//! The camera model: projects points to pixels and pixels to rays.
//!
//! Camera frame, as ROS has optical frames: x right, y down, z forward, metres. Image positions: (column, row), (0, 0) is
//! the centre of the top-left pixel. The model is OpenCV's (calib3d documentation, "Detailed Description"): pinhole,
//! distortion (or its fisheye camera model), tilted sensor, K.

mod distortion;
mod point;
mod tilt;
mod view;

use nalgebra::{Matrix3, Point2, Point3, Vector3};

pub use distortion::Distortion;
pub use point::{DistortedPixel, DistortedPoint, UndistortedPoint};
pub use view::View;

/// Intrinsic parameters of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Columns of its images.
    pub width_px: u32,
    /// Rows of its images.
    pub height_px: u32,
    /// Focal length across the columns, pixels.
    pub fx_px: f64,
    /// Focal length across the rows, pixels.
    pub fy_px: f64,
    /// Column of the principal point, pixels.
    pub cx_px: f64,
    /// Row of the principal point, pixels.
    pub cy_px: f64,
    /// Lens distortion.
    pub distortion: Distortion,
    /// Inclination of the sensor after Scheimpflug, OpenCV's τx and τy, radians; zeros for an ordinary camera.
    pub tilt_rad: [f64; 2],
}

impl Camera {
    /// Projects a point to a pixel, which may lie outside the image. `None` for a point behind the lens or where the
    /// distortion model folds back.
    pub fn project(&self, point: Point3<f64>) -> Option<DistortedPixel> {
        if point.z.is_nan() || point.z <= 0.0 {
            return None;
        }
        let straight = UndistortedPoint(Point2::new(point.x / point.z, point.y / point.z));
        let bent = self.distortion.distort(straight)?;
        let on_sensor = tilt::tilt(self.tilt_rad, bent)?;
        let seen = Point2::new(
            self.fx_px * on_sensor.x + self.cx_px,
            self.fy_px * on_sensor.y + self.cy_px,
        );
        (seen.x.is_finite() && seen.y.is_finite()).then_some(DistortedPixel(seen))
    }

    /// Returns the ray of a pixel, scaled to z = 1; inverts [`project`](Self::project) to below 1e-6 px. `None` where
    /// the distortion model cannot be inverted.
    pub fn ray(&self, pixel: DistortedPixel) -> Option<Vector3<f64>> {
        let UndistortedPoint(straight) = self.distortion.undistort(self.bent(pixel)?)?;
        Some(Vector3::new(straight.x, straight.y, 1.0))
    }

    /// Returns a calibrated value by its name in a covariance: fx, fy, cx, cy, `tau_x`, `tau_y` or a distortion
    /// coefficient.
    pub(crate) fn value_mut(&mut self, name: &str) -> Option<&mut f64> {
        match name {
            "fx" => Some(&mut self.fx_px),
            "fy" => Some(&mut self.fy_px),
            "cx" => Some(&mut self.cx_px),
            "cy" => Some(&mut self.cy_px),
            "tau_x" => Some(&mut self.tilt_rad[0]),
            "tau_y" => Some(&mut self.tilt_rad[1]),
            _ => self.distortion.coefficient_mut(name),
        }
    }

    /// Returns the map from the tilted sensor to the plane z = 1; `None` if the sensor is not tilted.
    pub(super) fn untilt(&self) -> Option<Matrix3<f64>> {
        let is_inclined = self.tilt_rad.iter().any(|angle| *angle != 0.0);
        is_inclined.then(|| tilt::matrix(self.tilt_rad).try_inverse())?
    }

    /// Returns the distorted position on the plane z = 1 that a pixel sees.
    fn bent(&self, DistortedPixel(pixel): DistortedPixel) -> Option<DistortedPoint> {
        let on_sensor =
            Point2::new((pixel.x - self.cx_px) / self.fx_px, (pixel.y - self.cy_px) / self.fy_px);
        tilt::untilt(self.tilt_rad, on_sensor)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn camera(distortion: Distortion, tilt_rad: [f64; 2]) -> Camera {
        Camera {
            width_px: 2592,
            height_px: 2048,
            fx_px: 2400.0,
            fy_px: 2410.0,
            cx_px: 1300.5,
            cy_px: 1010.25,
            distortion,
            tilt_rad,
        }
    }

    fn distortions() -> impl Strategy<Value = Distortion> {
        prop::sample::select(vec![
            Distortion::None,
            Distortion::PlumbBob { k1: -0.35, k2: 0.15, p1: 0.003, p2: -0.002, k3: -0.02 },
            Distortion::RationalPolynomial {
                k1: 0.9,
                k2: 0.05,
                p1: 0.001,
                p2: -0.001,
                k3: 0.02,
                k4: 1.2,
                k5: 0.1,
                k6: 0.01,
            },
            Distortion::Equidistant { k1: -0.0071, k2: 0.0427, k3: -0.0402, k4: 0.0074 },
        ])
    }

    proptest! {
        #[test]
        fn project_undoes_ray_all_over_the_image(
            column in 0.0..2591.0_f64, row in 0.0..2047.0_f64, distortion in distortions(),
            tau_x in -0.2..0.2_f64, tau_y in -0.2..0.2_f64, depth_m in 0.1..10.0_f64,
        ) {
            let camera = camera(distortion, [tau_x, tau_y]);
            let pixel = Point2::new(column, row);
            let ray = camera.ray(DistortedPixel(pixel)).unwrap();
            let DistortedPixel(seen) = camera.project(Point3::from(ray * depth_m)).unwrap();
            prop_assert!((seen - pixel).norm() < 1e-6, "{seen} for {pixel}");
        }
    }

    #[test]
    fn behind_the_lens_nothing_is_seen() {
        let camera = camera(Distortion::None, [0.0, 0.0]);
        for z in [0.0, -1.0, f64::NAN] {
            assert!(camera.project(Point3::new(0.1, 0.1, z)).is_none());
        }
        let middle = DistortedPixel(Point2::new(1300.5, 1010.25));
        assert_eq!(camera.project(Point3::new(0.0, 0.0, 2.0)), Some(middle));
    }
}
