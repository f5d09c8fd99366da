//! The values of a camera as a file states them, before they are checked.

use crate::scanner::{
    calibration::{CalibrationError, CameraCalibration},
    camera::{Camera, Distortion},
};

/// Number of coefficients before the tilt of the sensor in `OpenCV`'s list of fourteen.
const BEFORE_TILT: usize = 12;

/// Values of a camera in any kind of file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawCamera {
    pub(super) camera_name: String,
    pub(super) width_px: u32,
    pub(super) height_px: u32,
    /// K, row by row, pixels.
    pub(super) matrix: Vec<f64>,
    /// Name of the distortion model.
    pub(super) model: String,
    /// Coefficients of the model, in `OpenCV`'s order.
    pub(super) coefficients: Vec<f64>,
    /// τx and τy, if stated apart from the coefficients.
    pub(super) tilt_rad: [f64; 2],
}

impl RawCamera {
    /// Checks the values.
    pub(super) fn calibration(self) -> Result<CameraCalibration, CalibrationError> {
        let camera = self.camera()?;
        Ok(CameraCalibration {
            camera_name: self.camera_name,
            camera,
            quality: None,
            calibrated_at: None,
        })
    }

    pub(super) fn camera(&self) -> Result<Camera, CalibrationError> {
        for (key, size) in [("image_width", self.width_px), ("image_height", self.height_px)] {
            if !(1..=65_535).contains(&size) {
                return Err(CalibrationError::value(key, size.to_string(), "1 to 65535 pixels"));
            }
        }
        let k = &self.matrix;
        let wrong = |allowed| CalibrationError::value("camera_matrix", format!("{k:?}"), allowed);
        let &[fx_px, skew, cx_px, zero, fy_px, cy_px, ref last @ ..] = k.as_slice() else {
            return Err(wrong("3 rows and 3 columns of 9 numbers"));
        };
        if last.len() != 3 {
            return Err(wrong("3 rows and 3 columns of 9 numbers"));
        }
        let is_pinhole = (skew, zero) == (0.0, 0.0) && last == [0.0, 0.0, 1.0];
        let is_finite = k.iter().all(|value| value.is_finite());
        if !(is_pinhole && is_finite && fx_px > 0.0 && fy_px > 0.0) {
            return Err(wrong("[fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx and fy above 0"));
        }
        let tilt_rad = self.tilt()?;
        Ok(Camera {
            width_px: self.width_px,
            height_px: self.height_px,
            fx_px,
            fy_px,
            cx_px,
            cy_px,
            distortion: self.distortion()?,
            tilt_rad,
        })
    }

    /// Returns the tilt of the sensor: the entry of its own, or the last two of fourteen coefficients.
    fn tilt(&self) -> Result<[f64; 2], CalibrationError> {
        let is_zero = |angles: &[f64]| angles.iter().all(|angle| *angle == 0.0);
        let tilt_rad = match self.coefficients.get(BEFORE_TILT..) {
            Some(&[x, y]) if !is_zero(&[x, y]) && self.is_rational() => {
                if !is_zero(&self.tilt_rad) {
                    let value = format!("{:?}", self.tilt_rad);
                    let allowed = "left out: the coefficients state it already";
                    return Err(CalibrationError::value("tilt_rad", value, allowed));
                }
                [x, y]
            }
            _ => self.tilt_rad,
        };
        // A tilt of half a turn would look backwards.
        let is_tilt = |angle: &f64| angle.abs() < std::f64::consts::FRAC_PI_4;
        if !tilt_rad.iter().all(is_tilt) {
            let value = format!("{tilt_rad:?}");
            return Err(CalibrationError::value("tilt_rad", value, "two angles within ±π/4"));
        }
        Ok(tilt_rad)
    }

    fn is_rational(&self) -> bool {
        self.model == "rational_polynomial"
    }

    fn distortion(&self) -> Result<Distortion, CalibrationError> {
        let d = &self.coefficients;
        let wrong =
            |allowed| CalibrationError::value("distortion_coefficients", format!("{d:?}"), allowed);
        if !d.iter().all(|value| value.is_finite()) {
            return Err(wrong("finite numbers"));
        }
        let is_tilted = d.len() == BEFORE_TILT + 2 && self.is_rational();
        let of_lens = if is_tilted { &d[..BEFORE_TILT] } else { d };
        // OpenCV's name of the model.
        let model = if self.model == "fisheye" { "equidistant" } else { &self.model };
        Distortion::from_coefficients(model, of_lens).map_err(|allowed| match allowed {
            Some(allowed) => wrong(allowed),
            None => CalibrationError::value(
                "distortion_model",
                self.model.clone(),
                "plumb_bob, rational_polynomial or equidistant",
            ),
        })
    }
}
