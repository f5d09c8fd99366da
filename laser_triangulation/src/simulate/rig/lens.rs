//! Projection through a lens, after OpenCV's formulas, used only for rendering.

use serde::Deserialize;

use crate::simulate::scenario_error::{ScenarioError, check_range, range_error};

/// Pinhole, distortion and a tilted sensor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// fx and fy, pixels.
    pub focal_px: [f64; 2],
    /// cx and cy: column and row of the principal point, pixels.
    pub center_px: [f64; 2],
    /// k1, k2, p1, p2, k3, k4, k5, k6.
    #[serde(default)]
    pub distortion: [f64; 8],
    /// k1, k2, k3, k4 of a fisheye (`equidistant`), in place of `distortion`.
    #[serde(default)]
    pub equidistant: Option<[f64; 4]>,
    /// τx and τy, the tilt of the sensor, radians.
    #[serde(default)]
    pub tilt_rad: [f64; 2],
}

impl Lens {
    /// Returns the image (column, row) of a point in the camera's frame; `None` behind the lens.
    pub fn project(&self, [x_m, y_m, z_m]: [f64; 3]) -> Option<[f64; 2]> {
        if z_m.is_nan() || z_m <= 0.0 {
            return None;
        }
        let straight = [x_m / z_m, y_m / z_m];
        let bent = match self.equidistant {
            Some(coefficients) => fisheye(coefficients, straight),
            None => self.bent(straight),
        };
        let [u, v] = self.tilted(bent);
        let [fx, fy] = self.focal_px;
        let [cx, cy] = self.center_px;
        Some([fx * u + cx, fy * v + cy])
    }

    fn bent(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.distortion;
        let r2 = x * x + y * y;
        let (r4, r6) = (r2 * r2, r2 * r2 * r2);
        let radial = (1.0 + k1 * r2 + k2 * r4 + k3 * r6) / (1.0 + k4 * r2 + k5 * r4 + k6 * r6);
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// Returns the point of the plane z = 1 that a pixel would see if all coefficients were 0: where a search starts.
    pub(super) fn without_coefficients(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let x = (column - self.center_px[0]) / self.focal_px[0];
        let y = (row - self.center_px[1]) / self.focal_px[1];
        let angle = libm::hypot(x, y);
        if self.equidistant.is_none() || angle == 0.0 {
            return [x, y];
        }
        // Short of a right angle.
        let stretch = libm::tan(angle.min(1.5)) / angle;
        [x * stretch, y * stretch]
    }

    /// Tilted sensor: the ray is rotated into the sensor's frame and scaled to its distance.
    fn tilted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [tx, ty] = self.tilt_rad;
        let (sx, cx) = (libm::sin(tx), libm::cos(tx));
        let (sy, cy) = (libm::sin(ty), libm::cos(ty));
        let turned = [cy * x + sy * sx * y - sy * cx, cx * y + sx, sy * x - cy * sx * y + cy * cx];
        let [r13, r23, r33] = [-sy * cx, sx, cy * cx];
        [
            (r33 * turned[0] - r13 * turned[2]) / turned[2],
            (r33 * turned[1] - r23 * turned[2]) / turned[2],
        ]
    }

    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        for (key, values, min, max) in [
            ("focal_px", &self.focal_px[..], 1.0, 1e6),
            ("center_px", &self.center_px, -16_384.0, 16_384.0),
            ("distortion", &self.distortion, -100.0, 100.0),
            ("equidistant", self.equidistant.as_ref().map_or(&[], |k| &k[..]), -100.0, 100.0),
            ("tilt_rad", &self.tilt_rad, -0.7, 0.7),
        ] {
            for (index, value) in values.iter().enumerate() {
                check_range(&format!("rig.lens.{key}[{index}]"), *value, min, max)?;
            }
        }
        if self.equidistant.is_some() && self.distortion.iter().any(|value| *value != 0.0) {
            let value = format!("{:?}", self.distortion);
            let allowed = "zeros beside equidistant".to_owned();
            return Err(range_error("rig.lens.distortion", value, allowed));
        }
        Ok(())
    }
}

/// A polynomial in the angle from the axis.
fn fisheye([k1, k2, k3, k4]: [f64; 4], [x, y]: [f64; 2]) -> [f64; 2] {
    let r = libm::hypot(x, y);
    if r == 0.0 {
        return [0.0; 2];
    }
    let angle = libm::atan(r);
    let powers = [3, 5, 7, 9].map(|power| libm::pow(angle, f64::from(power)));
    let bent = angle + k1 * powers[0] + k2 * powers[1] + k3 * powers[2] + k4 * powers[3];
    [x * bent / r, y * bent / r]
}
