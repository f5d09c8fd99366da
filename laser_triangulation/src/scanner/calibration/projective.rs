//! The image of the laser plane as a homography: all that known heights can determine of a camera without distortion.

use nalgebra::{DMatrix, Matrix3, Point2};

use super::{Bow, CalibratedVolume, CalibrationError, PlacedPoint, StepsQuality, file::Id};
use crate::scanner::{camera::View, params::StripeDirection};

/// A plane seen by a pinhole camera: with `(x, z, w) = H (column, row, 1)`, the point is at x/w and z/w.
#[derive(Clone, Debug, PartialEq)]
pub struct Projective {
    /// Name of the laser plane's frame: x along the stripe, z up, y normal to the plane.
    pub frame_id: String,
    /// Columns of the images.
    pub width_px: u32,
    /// Rows of the images.
    pub height_px: u32,
    /// H, row-major: from pixels to metres. Points with w of 0 or less are not measured.
    pub homography: [f64; 9],
    /// Quality of the homography.
    pub quality: Option<StepsQuality>,
    /// Time of the calibration, as in the file.
    pub calibrated_at: Option<String>,
}

impl Projective {
    /// Returns the point seen at that position and its derivative across the stripe.
    pub(super) fn place(
        &self,
        direction: StripeDirection,
        along_px: f64,
        across_px: f64,
    ) -> Option<PlacedPoint> {
        let h = &self.homography;
        let (u, v, across) = match direction {
            StripeDirection::Horizontal => (along_px, across_px, 1),
            StripeDirection::Vertical => (across_px, along_px, 0),
        };
        let row = |r: usize| h[3 * r] * u + h[3 * r + 1] * v + h[3 * r + 2];
        let w = row(2);
        if w.is_nan() || w <= 0.0 {
            return None;
        }
        let (x_m, z_m) = (row(0) / w, row(1) / w);
        let slope = |r: usize, value: f64| (h[3 * r + across] - value * h[6 + across]) / w;
        let (x_m_per_px, z_m_per_px) = (slope(0, x_m), slope(1, z_m));
        Some(PlacedPoint { x_m, z_m, x_m_per_px, z_m_per_px, flags: 0 })
    }

    /// The same map for images of a part of the sensor.
    pub(super) fn seen_through(&self, view: &View) -> Self {
        let shift = view.on_sensor(Point2::origin());
        let [bx, by] = view.binning.map(f64::from);
        let seen = |entries: &mut [f64]| {
            for row in entries.chunks_exact_mut(3) {
                row[2] += row[0] * shift.x + row[1] * shift.y;
                row[0] *= bx;
                row[1] *= by;
            }
        };
        let mut homography = self.homography;
        seen(&mut homography);
        let [width_px, height_px] = view.size_px;
        let mut quality = self.quality.clone();
        if let Some(quality) = &mut quality {
            quality.covariance = seen_covariance(&quality.covariance, seen);
            quality.volume = quality.volume.map(|volume| volume.seen_through(view));
        }
        Self { width_px, height_px, homography, quality, ..self.clone() }
    }

    pub(super) fn volume(&self) -> Option<&CalibratedVolume> {
        self.quality.as_ref()?.volume.as_ref()
    }

    pub(super) fn id(&self) -> String {
        Id::new("projective")
            .text(&self.frame_id)
            .numbers([f64::from(self.width_px), f64::from(self.height_px)])
            .numbers(self.homography)
            .finish()
    }

    pub(super) fn check(&self) -> Result<(), CalibrationError> {
        let h = Matrix3::from_row_slice(&self.homography);
        let scale = h.amax();
        let determinant = (h / scale).determinant();
        if !(self.homography.iter().all(|value| value.is_finite())
            && determinant.abs() > f64::MIN_POSITIVE)
        {
            return Err(CalibrationError::value(
                "homography",
                format!("{:?}", self.homography),
                "nine finite numbers of a matrix that can be inverted",
            ));
        }
        Bow::check(self.quality.as_ref())?;
        CalibratedVolume::check(self.volume(), "steps_quality.volume")
    }
}

/// Returns the covariance of nine entries after a linear map of them; empty if it is unknown.
fn seen_covariance(covariance: &[f64], map: impl Fn(&mut [f64])) -> Vec<f64> {
    if covariance.len() != 81 {
        return Vec::new();
    }
    let mut matrix = DMatrix::from_row_slice(9, 9, covariance);
    for _ in 0..2 {
        // Columns lie in memory one after the other.
        matrix.as_mut_slice().chunks_exact_mut(9).for_each(&map);
        matrix = matrix.transpose();
    }
    matrix.as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::calibration::VerticalIncidence;

    /// Formula 6 is a homography: written out, both give the same metres.
    #[test]
    fn formula_6_is_a_homography() {
        let (a, b, beta, pitch) = (0.026, 0.3, 0.5_f64, 4.8e-6);
        let (row, column) = (1024.0, 1295.5);
        let formula = VerticalIncidence {
            frame_id: "laser".into(),
            image_distance_m: a,
            object_distance_m: b,
            beta_rad: beta,
            pixel_pitch_m: pitch,
            base_row_px: row,
            center_column_px: column,
            height_sign: -1,
            quality: None,
        };
        let (sin, cos) = beta.sin_cos();
        // s = (row - v) · pitch; h = s b / (a sin + s cos); x = (u - column) · pitch · b sin / (a sin + s cos).
        let homography = [
            pitch * b * sin,
            0.0,
            -column * pitch * b * sin,
            0.0,
            -pitch * b,
            row * pitch * b,
            0.0,
            -pitch * cos,
            a * sin + row * pitch * cos,
        ];
        let projective = Projective {
            frame_id: "laser".into(),
            width_px: 2592,
            height_px: 2048,
            homography,
            quality: None,
            calibrated_at: None,
        };
        for (u, v) in [(0.0, 0.0), (1295.5, 1024.0), (2591.0, 2047.0), (300.25, 1800.75)] {
            let one = formula.place(u, v).unwrap();
            let other = projective.place(StripeDirection::Horizontal, u, v).unwrap();
            assert!((one.x_m - other.x_m).abs() < 1e-12 && (one.z_m - other.z_m).abs() < 1e-12);
            assert!((one.x_m_per_px - other.x_m_per_px).abs() < 1e-15, "{one:?} {other:?}");
            assert!((one.z_m_per_px - other.z_m_per_px).abs() < 1e-15, "{one:?} {other:?}");
        }
        // Two pixels in one, from (100, 200) on.
        let view = View { offset_px: [100, 200], size_px: [1000, 800], binning: [2, 2] };
        let part = projective.seen_through(&view);
        let on_sensor = view.on_sensor(Point2::new(30.0, 40.0));
        let one = part.place(StripeDirection::Horizontal, 30.0, 40.0).unwrap();
        let other =
            projective.place(StripeDirection::Horizontal, on_sensor.x, on_sensor.y).unwrap();
        assert!((one.x_m - other.x_m).abs() < 1e-12 && (one.z_m - other.z_m).abs() < 1e-12);
        assert!(
            (one.z_m_per_px - 2.0 * other.z_m_per_px).abs() < 1e-12,
            "a pixel is twice as large"
        );
        // The image of the plane's horizon, and beyond.
        let parallel_px = row + a * beta.tan() / pitch;
        let beyond = projective.place(StripeDirection::Horizontal, 0.0, parallel_px + 1.0);
        assert_eq!(beyond, None);
    }
}
