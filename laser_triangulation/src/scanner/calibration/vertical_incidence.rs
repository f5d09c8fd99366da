//! The camera of Yao et al. 2023: formula 6.

use super::{Bow, CalibratedVolume, CalibrationError, PlacedPoint, StepsQuality, file::Id};

/// Vertical-incidence triangulation, formula 6 of Yao et al. 2023 (doi 10.3390/app13179831), after Figure 2 there:
/// the laser plane is vertical; the camera's optical axis meets it at the base point under the angle β.
///
/// With s the displacement on the sensor across the stripe, counted from the base line,
/// `h = s·b / (a·sin β + s·cos β)`.
#[derive(Clone, Debug, PartialEq)]
pub struct VerticalIncidence {
    /// Name of the laser plane's frame: x along the stripe, z up, y normal to the plane.
    pub frame_id: String,
    /// a: from the lens centre to the image point of the base point, metres.
    pub image_distance_m: f64,
    /// b: from the base point to the lens centre, metres.
    pub object_distance_m: f64,
    /// β: between the laser plane and the optical axis, radians, inside (0, π/2).
    pub beta_rad: f64,
    /// Distance between neighbouring pixels on the sensor, metres.
    pub pixel_pitch_m: f64,
    /// Position of the stripe at height 0, pixels: a row, or a column for a vertical stripe.
    pub base_row_px: f64,
    /// Position of the optical axis along the stripe, pixels: a column, or a row for a vertical stripe.
    pub center_column_px: f64,
    /// Direction in which the stripe moves in the image when the surface rises: -1 towards smaller rows (columns), 1
    /// towards larger.
    pub height_sign: i8,
    /// Quality; the covariance is that of [`VALUES`](Self::VALUES).
    pub quality: Option<StepsQuality>,
}

/// A height and its derivative with respect to the image position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Height {
    /// Above the base plane, metres.
    pub z_m: f64,
    /// dh/d(pixel), metres a pixel: error propagation, `σ_z = |dh/dp| · σ_p`.
    pub m_per_px: f64,
}

impl VerticalIncidence {
    /// Names of the estimated values, in the order of the covariance.
    pub const VALUES: [&str; 4] =
        ["image_distance_m", "object_distance_m", "beta_rad", "base_row_px"];

    /// Returns the same geometry with the estimated values changed, in the order of [`VALUES`](Self::VALUES).
    #[must_use]
    pub fn moved(&self, by: [f64; 4]) -> Self {
        Self {
            image_distance_m: self.image_distance_m + by[0],
            object_distance_m: self.object_distance_m + by[1],
            beta_rad: self.beta_rad + by[2],
            base_row_px: self.base_row_px + by[3],
            ..self.clone()
        }
    }

    /// Applies formula 6 at a position across the stripe, pixels; `None` if the ray does not meet the plane in front of
    /// the lens.
    pub fn height(&self, position_px: f64) -> Option<Height> {
        let (sin, cos) = self.beta_rad.sin_cos();
        let s_m =
            f64::from(self.height_sign) * (position_px - self.base_row_px) * self.pixel_pitch_m;
        let denominator = self.image_distance_m * sin + s_m * cos;
        let z_m = s_m * self.object_distance_m / denominator;
        if denominator <= 0.0 || self.depth(z_m) <= 0.0 || !z_m.is_finite() {
            return None;
        }
        let slope = self.object_distance_m * self.image_distance_m * sin / denominator.powi(2);
        Some(Height { z_m, m_per_px: f64::from(self.height_sign) * self.pixel_pitch_m * slope })
    }

    /// Returns the point seen at that position and its derivative across the stripe.
    pub(super) fn place(&self, along_px: f64, across_px: f64) -> Option<PlacedPoint> {
        let Height { z_m, m_per_px } = self.height(across_px)?;
        let x_m_per_px = -m_per_px
            * self.beta_rad.cos()
            * (along_px - self.center_column_px)
            * self.pixel_pitch_m
            / self.image_distance_m;
        let x_m = self.lateral(along_px, z_m);
        Some(PlacedPoint { x_m, z_m, x_m_per_px, z_m_per_px: m_per_px, flags: 0 })
    }

    /// Returns the position along the stripe of a pixel column (row) that sees height `z_m`, metres.
    pub fn lateral(&self, along_px: f64, z_m: f64) -> f64 {
        (along_px - self.center_column_px) * self.pixel_pitch_m * self.depth(z_m)
            / self.image_distance_m
    }

    /// The inverse: returns the pixel (along, across) that sees a point of the laser plane; `None` at or behind the
    /// lens.
    pub fn project(&self, x_m: f64, z_m: f64) -> Option<(f64, f64)> {
        let depth_m = self.depth(z_m);
        if depth_m <= 0.0 || !depth_m.is_finite() {
            return None;
        }
        let magnification = self.image_distance_m / depth_m;
        let across_m = magnification * z_m * self.beta_rad.sin();
        Some((
            self.center_column_px + x_m * magnification / self.pixel_pitch_m,
            self.base_row_px + f64::from(self.height_sign) * across_m / self.pixel_pitch_m,
        ))
    }

    /// Returns the distance from the lens along the optical axis of a point at height `z_m`, metres.
    fn depth(&self, z_m: f64) -> f64 {
        self.object_distance_m - z_m * self.beta_rad.cos()
    }

    pub(super) fn volume(&self) -> Option<&CalibratedVolume> {
        self.quality.as_ref()?.volume.as_ref()
    }

    pub(super) fn id(&self) -> String {
        Id::new("vertical_incidence")
            .text(&self.frame_id)
            .numbers([
                self.image_distance_m,
                self.object_distance_m,
                self.beta_rad,
                self.pixel_pitch_m,
                self.base_row_px,
                self.center_column_px,
                f64::from(self.height_sign),
            ])
            .finish()
    }

    pub(super) fn check(&self) -> Result<(), CalibrationError> {
        let wrong = |key, value: &dyn ToString, allowed| {
            Err(CalibrationError::value(key, value.to_string(), allowed))
        };
        for (key, value) in [
            ("image_distance_m", self.image_distance_m),
            ("object_distance_m", self.object_distance_m),
            ("pixel_pitch_m", self.pixel_pitch_m),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return wrong(key, &value, "a finite number above 0");
            }
        }
        if !(self.beta_rad > 0.0 && self.beta_rad < std::f64::consts::FRAC_PI_2) {
            return wrong("beta_rad", &self.beta_rad, "between 0 and π/2 = 1.5708, both excluded");
        }
        for (key, value) in
            [("base_row_px", self.base_row_px), ("center_column_px", self.center_column_px)]
        {
            if !value.is_finite() {
                return wrong(key, &value, "a finite number");
            }
        }
        if ![-1, 1].contains(&self.height_sign) {
            return wrong("height_sign", &self.height_sign, "-1 or 1");
        }
        let covariance = self.quality.as_ref().map_or(&[][..], |quality| &quality.covariance);
        if ![0, 16].contains(&covariance.len()) || !covariance.iter().all(|c| c.is_finite()) {
            let value = format!("{covariance:?}");
            let allowed = "4 x 4 finite numbers, of a, b, beta and the base row, or none";
            return wrong("steps_quality.covariance", &value, allowed);
        }
        if self.frame_id.is_empty() {
            return wrong("frame_id", &"\"\"", "a frame name, as in laser_plane");
        }
        Bow::check(self.quality.as_ref())?;
        CalibratedVolume::check(self.volume(), "steps_quality.volume")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::scanner::{
        calibration::{Calibration, Lines},
        params::StripeDirection,
        profile::Profile,
        stripe::Centerline,
    };

    const RIG: &str = "
type: vertical_incidence
frame_id: laser_plane
image_distance_m: 0.026
object_distance_m: 0.3
beta_rad: 0.5235987755982988
pixel_pitch_m: 4.8e-6
base_row_px: 1024.0
center_column_px: 1295.5
height_sign: -1
";

    fn rig() -> VerticalIncidence {
        let calibration = Calibration::from_yaml(RIG).unwrap();
        let Calibration::VerticalIncidence(geometry) = calibration else {
            panic!("{calibration:?}")
        };
        geometry
    }

    /// Projects a point of the laser plane with a camera built from vectors, not from formula 6.
    fn seen_by_a_pinhole(geometry: &VerticalIncidence, x_m: f64, z_m: f64) -> (f64, f64) {
        use nalgebra::Vector3;
        let (sin, cos) = geometry.beta_rad.sin_cos();
        // World: x along the stripe, y normal to the laser plane, z up; the lens lies in the y-z plane.
        let lens = Vector3::new(0.0, sin, cos) * geometry.object_distance_m;
        let axis = -lens.normalize();
        let right = Vector3::x();
        let up = right.cross(&Vector3::new(0.0, sin, cos));
        let ray = Vector3::new(x_m, 0.0, z_m) - lens;
        let scale = geometry.image_distance_m / ray.dot(&axis) / geometry.pixel_pitch_m;
        (
            geometry.center_column_px + scale * ray.dot(&right),
            geometry.base_row_px - scale * ray.dot(&up),
        )
    }

    proptest! {
        #[test]
        fn formula_6_is_a_pinhole_camera(x_m in -0.05..0.05_f64, z_m in -0.05..0.05_f64) {
            let (along_px, across_px) = seen_by_a_pinhole(&rig(), x_m, z_m);
            let height = rig().height(across_px).unwrap();
            prop_assert!((height.z_m - z_m).abs() < 1e-12);
            prop_assert!((rig().lateral(along_px, height.z_m) - x_m).abs() < 1e-12);
        }

        #[test]
        fn project_undoes_triangulation(along_px in 0.0..2592.0_f64, across_px in 0.0..2048.0_f64, sign in prop::sample::select(vec![-1_i8, 1])) {
            let rig = VerticalIncidence { height_sign: sign, ..rig() };
            let height = rig.height(across_px).unwrap();
            let (along, across) = rig.project(rig.lateral(along_px, height.z_m), height.z_m).unwrap();
            prop_assert!((along - along_px).abs() < 1e-6 && (across - across_px).abs() < 1e-6);
        }

        #[test]
        fn the_slope_is_the_derivative(across_px in 0.0..2048.0_f64) {
            let step_px = 1e-3;
            let at = |px: f64| rig().height(px).unwrap();
            let difference = (at(across_px + step_px).z_m - at(across_px - step_px).z_m) / (2.0 * step_px);
            prop_assert!((at(across_px).m_per_px - difference).abs() < 1e-9);
        }
    }

    #[test]
    fn rays_that_never_meet_the_plane_have_no_height() {
        let rig = rig();
        // s = -a·tan β: the ray is parallel to the laser plane.
        let parallel_px =
            rig.base_row_px + rig.image_distance_m * rig.beta_rad.tan() / rig.pixel_pitch_m;
        assert!(rig.height(parallel_px + 1.0).is_none());
        assert!(rig.height(parallel_px - 1.0).is_some());
        assert!(rig.project(0.0, rig.object_distance_m / rig.beta_rad.cos()).is_none());

        let centerline = Centerline {
            u_px: vec![7.0, 8.0],
            v_px: vec![parallel_px as f32 + 1.0, rig.base_row_px as f32],
            intensity: vec![100.0, 51.0],
            sigma_px: vec![0.1, 0.1],
            flags: vec![1, 2],
            ..Centerline::default()
        };
        let lines = Lines { direction: StripeDirection::Horizontal, first: 7, count: 3 };
        let mut profile = Profile::default();
        Calibration::VerticalIncidence(rig).triangulate(&centerline, &lines, 255, &mut profile);
        assert_eq!(profile.valid_count, 1);
        assert_eq!(profile.z_m.iter().map(|z| z.is_nan()).collect::<Vec<_>>(), [true, false, true]);
        assert_eq!(
            (&profile.intensity[..], &profile.flags[..]),
            (&[0.0, 0.2, 0.0][..], &[0, 2, 0][..])
        );
    }

    #[test]
    fn points_outside_the_lines_are_left_out() {
        let centerline = Centerline {
            u_px: vec![6.0, 7.0, 9.0, 10.0],
            v_px: vec![1000.0; 4],
            intensity: vec![100.0; 4],
            sigma_px: vec![0.1; 4],
            flags: vec![0; 4],
            ..Centerline::default()
        };
        let lines = Lines { direction: StripeDirection::Horizontal, first: 7, count: 3 };
        let mut profile = Profile::default();
        Calibration::VerticalIncidence(rig()).triangulate(&centerline, &lines, 255, &mut profile);
        let measured: Vec<_> = profile.z_m.iter().map(|z| z.is_finite()).collect();
        assert_eq!((profile.valid_count, &measured[..]), (2, &[true, false, true][..]));
    }

    #[test]
    fn what_32_bits_cannot_hold_is_not_measured() {
        let huge = VerticalIncidence { object_distance_m: 1e300, ..rig() };
        let centerline = Centerline {
            u_px: vec![0.0],
            v_px: vec![huge.base_row_px as f32 - 100.0],
            intensity: vec![1.0],
            sigma_px: vec![1.0],
            flags: vec![0],
            ..Centerline::default()
        };
        let lines = Lines { direction: StripeDirection::Horizontal, first: 0, count: 1 };
        let mut profile = Profile::default();
        Calibration::VerticalIncidence(huge).triangulate(&centerline, &lines, 255, &mut profile);
        assert!(profile.valid_count == 0 && profile.z_m[0].is_nan() && profile.x_m[0].is_nan());
    }

    #[test]
    fn wrong_values_are_refused_by_name() {
        for (from, to, named) in [
            ("image_distance_m: 0.026", "image_distance_m: -1.0", "image_distance_m"),
            ("beta_rad: 0.5235987755982988", "beta_rad: 30.0", "beta_rad"),
            ("base_row_px: 1024.0", "base_row_px: .nan", "base_row_px"),
            ("height_sign: -1", "height_sign: 2", "height_sign"),
            ("frame_id: laser_plane", "frame_id: ''", "frame_id"),
            ("frame_id: laser_plane", "frame: laser_plane", "frame"),
            ("type: vertical_incidence", "type: oblique", "oblique"),
        ] {
            let error = Calibration::from_yaml(&RIG.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(named), "{to}: {error}");
        }
    }

    #[test]
    fn the_id_changes_with_every_value() {
        let id = |yaml: &str| Calibration::from_yaml(yaml).unwrap().id();
        assert_eq!((id(RIG).len(), id(RIG)), (16, id(RIG)));
        let mut ids = vec![id(RIG)];
        for (from, to) in [
            ("laser_plane", "laser"),
            ("0.026", "0.027"),
            ("0.3", "0.31"),
            ("0.52", "0.53"),
            ("4.8e-6", "4.9e-6"),
            ("1024.0", "1024.5"),
            ("1295.5", "1295.0"),
            ("-1", "1"),
        ] {
            ids.push(id(&RIG.replacen(from, to, 1)));
        }
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), 9, "one id a change");
    }
}
