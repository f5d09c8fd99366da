//! The camera: a pinhole whose optical axis meets the vertical laser plane at the base point at the angle β.
//!
//! A point of the plane at height h and lateral position x has the depth Zc = b − h · cos β along the optical axis. Its
//! image is s = a · h · sin β / Zc across the stripe from the base line (formula 6 of Yao et al. 2023, solved for s)
//! and a · x / Zc along it. Rows run across and columns along the stripe; a vertical stripe swaps the two.

use std::fmt::Write;

use serde::{Deserialize, Deserializer, de::Error};

use super::{
    part::Part,
    scenario_error::{ScenarioError, check_range, range_error},
    sensor::{BitDepth, Sensor},
};
use crate::scanner::params::StripeDirection;

/// Samples along a line of sight within the part's extent.
const SIGHT_SAMPLES: u32 = 128;
/// Most iterations for a column. Only a wall keeps it from converging.
const MAX_ROUNDS: u32 = 64;

/// Sensor and geometry of a simulated camera.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedCamera {
    /// Width, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
    /// Bits per sample: 8, 12 or 16.
    #[serde(default)]
    pub(crate) bit_depth: BitDepth,
    /// Direction of the stripe.
    #[serde(default = "horizontal", deserialize_with = "direction")]
    pub(crate) stripe_direction: StripeDirection,
    /// Standard deviation of the read noise, grey levels.
    #[serde(default)]
    pub(crate) read_noise: f64,
    /// Variance of the shot noise per grey level, grey levels.
    #[serde(default)]
    pub(crate) shot_gain: f64,
    /// a: from the lens centre to the image, metres.
    pub(crate) image_distance_m: f64,
    /// b: from the base point to the lens centre, metres.
    pub(crate) object_distance_m: f64,
    /// β: angle between laser and camera axis, radians.
    pub(crate) beta_rad: f64,
    /// Pixel pitch on the sensor, metres.
    pub(crate) pixel_pitch_m: f64,
    /// Row (column, for a vertical stripe) of the base line, at height 0, pixels.
    pub(crate) base_row_px: f64,
    /// Column (row, for a vertical stripe) of the optical axis, pixels.
    pub(crate) center_column_px: f64,
    /// 1 if heights grow with the row (column, for a vertical stripe), -1 if they fall.
    pub(crate) height_sign: i8,
}

/// A point in the laser plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlanePoint {
    /// Along the stripe, metres.
    pub(crate) x_m: f64,
    /// Above the table, metres.
    pub(crate) height_m: f64,
}

impl SimulatedCamera {
    /// Returns the number of pixels along the stripe, which is the number of its cross-sections.
    pub(crate) const fn length_px(&self) -> u32 {
        match self.stripe_direction {
            StripeDirection::Horizontal => self.width_px,
            StripeDirection::Vertical => self.height_px,
        }
    }

    /// Returns the number of pixels across the stripe.
    pub(crate) const fn across_px(&self) -> u32 {
        match self.stripe_direction {
            StripeDirection::Horizontal => self.height_px,
            StripeDirection::Vertical => self.width_px,
        }
    }

    /// Returns the sensor.
    pub(crate) const fn sensor(&self) -> Sensor {
        Sensor { bit_depth: self.bit_depth, read_noise: self.read_noise, shot_gain: self.shot_gain }
    }

    /// Returns the image (column, row) of a point of the laser plane; (row, column) for a vertical stripe.
    pub(crate) fn project(&self, point: PlanePoint) -> (f64, f64) {
        let depth_m = self.depth_m(point.height_m);
        let across_m = self.image_distance_m * point.height_m * libm::sin(self.beta_rad) / depth_m;
        let along_m = self.image_distance_m * point.x_m / depth_m;
        (
            self.center_column_px + along_m / self.pixel_pitch_m,
            self.base_row_px + f64::from(self.height_sign) * across_m / self.pixel_pitch_m,
        )
    }

    /// Returns the point of the part that the laser lights at `position_m` and that `column` shows; `None` if the part
    /// hides it from the camera or the column shows a wall. If a column shows two lit points, the higher one counts.
    pub(crate) fn lit_point(
        &self,
        part: &Part,
        position_m: f64,
        column: u32,
    ) -> Option<PlanePoint> {
        let offset_m = (f64::from(column) - self.center_column_px) * self.pixel_pitch_m;
        let x_at = |height_m: f64| offset_m * self.depth_m(height_m) / self.image_distance_m;
        let mut height_m = part.ceiling_m();
        for _ in 0..MAX_ROUNDS {
            let x_m = x_at(height_m);
            let surface_m = part.surface(x_m, position_m).height_m;
            if (surface_m - height_m).abs() < 1e-12 {
                let point = PlanePoint { x_m, height_m: surface_m };
                return self.sees(part, position_m, point).then_some(point);
            }
            height_m = surface_m;
        }
        None
    }

    /// Returns true if the line of sight from a point to the lens, which is at positive y, stays above the part.
    fn sees(&self, part: &Part, position_m: f64, point: PlanePoint) -> bool {
        let to_lens_y_m = self.object_distance_m * libm::sin(self.beta_rad);
        let to_lens_z_m = self.object_distance_m * libm::cos(self.beta_rad) - point.height_m;
        let free_share = (part.ceiling_m() - point.height_m) / to_lens_z_m;
        (1..=SIGHT_SAMPLES).all(|sample| {
            let share = free_share * f64::from(sample) / f64::from(SIGHT_SAMPLES);
            let surface = part.surface(point.x_m * (1.0 - share), position_m + share * to_lens_y_m);
            surface.height_m <= point.height_m + share * to_lens_z_m + 1e-9
        })
    }

    /// Returns Zc, the depth of a point of the laser plane along the optical axis, metres.
    fn depth_m(&self, height_m: f64) -> f64 {
        self.object_distance_m - height_m * libm::cos(self.beta_rad)
    }

    /// Returns the calibration file for this camera.
    pub fn calibration_yaml(&self) -> String {
        let mut yaml = String::from("type: vertical_incidence\nframe_id: laser_plane\n");
        for (key, value) in [
            ("image_distance_m", self.image_distance_m),
            ("object_distance_m", self.object_distance_m),
            ("beta_rad", self.beta_rad),
            ("pixel_pitch_m", self.pixel_pitch_m),
            ("base_row_px", self.base_row_px),
            ("center_column_px", self.center_column_px),
        ] {
            // `{:?}` writes the shortest text that reads back as the same number, and always as a float.
            writeln!(yaml, "{key}: {value:?}").unwrap_or_default();
        }
        writeln!(yaml, "height_sign: {}", self.height_sign).unwrap_or_default();
        yaml
    }

    /// Rejects an impossible camera.
    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        for (key, value, min, max) in [
            ("width_px", f64::from(self.width_px), 8.0, 8192.0),
            ("height_px", f64::from(self.height_px), 8.0, 8192.0),
            ("read_noise", self.read_noise, 0.0, 65_535.0),
            ("shot_gain", self.shot_gain, 0.0, 1000.0),
            ("image_distance_m", self.image_distance_m, 1e-4, 1.0),
            ("object_distance_m", self.object_distance_m, 1e-3, 100.0),
            ("beta_rad", self.beta_rad, 0.01, 1.5),
            ("pixel_pitch_m", self.pixel_pitch_m, 1e-7, 1e-3),
            ("base_row_px", self.base_row_px, -16_384.0, 16_384.0),
            ("center_column_px", self.center_column_px, -16_384.0, 16_384.0),
        ] {
            check_range(&format!("camera.{key}"), value, min, max)?;
        }
        if self.height_sign.abs() != 1 {
            let allowed = "-1 or 1".to_owned();
            return Err(range_error("camera.height_sign", self.height_sign, allowed));
        }
        Ok(())
    }

    /// Rejects a part that reaches up to the lens.
    pub(super) fn check_above(&self, part: &Part) -> Result<(), ScenarioError> {
        let max_m = 0.5 * self.object_distance_m * libm::cos(self.beta_rad);
        check_range("part (cell, film and defects together)", part.ceiling_m(), 0.0, max_m)
    }
}

const fn horizontal() -> StripeDirection {
    StripeDirection::Horizontal
}

fn direction<'de, D: Deserializer<'de>>(deserializer: D) -> Result<StripeDirection, D::Error> {
    let name = String::deserialize(deserializer)?;
    StripeDirection::from_name(&name).ok_or_else(|| {
        D::Error::custom(format!(
            "stripe_direction is {name}: allowed is {}",
            StripeDirection::NAMES.join(" or ")
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::scenario::{EXAMPLE, Scenario};

    fn scenario() -> Scenario {
        Scenario::from_yaml(EXAMPLE).unwrap()
    }

    #[test]
    fn formula_6_converts_rows_back_to_heights() {
        let (a, b, beta, pitch) = (0.026, 0.3, 30f64.to_radians(), 9.6e-6);
        for (x_m, height_m) in [(0.0, 0.0), (0.004, 0.0042), (-0.006, 0.010), (0.001, -0.002)] {
            let (column, row) = scenario().camera.project(PlanePoint { x_m, height_m });
            let s = (75.0 - row) * pitch;
            let h = s * b / (a * beta.sin() + s * beta.cos());
            assert!((h - height_m).abs() < 1e-12, "{h} for {height_m}");
            let x = (column - 79.5) * pitch * (b - h * beta.cos()) / a;
            assert!((x - x_m).abs() < 1e-12, "{x} for {x_m}");
        }
    }

    #[test]
    fn a_lit_point_is_on_the_part_and_in_its_column() {
        let Scenario { camera, part, .. } = scenario();
        for column in 0..160 {
            let point = camera.lit_point(&part, 0.005, column).unwrap();
            let (seen_in, _) = camera.project(point);
            assert!((seen_in - f64::from(column)).abs() < 1e-6);
            assert!((part.surface(point.x_m, 0.005).height_m - point.height_m).abs() < 1e-9);
        }
    }

    #[test]
    fn the_walls_of_a_tall_cell_hide_the_table_beside_them() {
        let Scenario { camera, mut part, .. } = scenario();
        (part.cell.height_m, part.cell.length_m) = (0.04, 0.1);
        // Rim at x = 6 mm, 265.4 mm deep: 61.2 px from the axis. The lens stands 259.8 mm high, so the table is seen
        // from 6 mm · 259.8 / 219.8 = 7.09 mm on: 64.0 px. Between them lie the columns at 61.5, 62.5 and 63.5 px.
        let hidden: Vec<u32> =
            (0..160).filter(|&column| camera.lit_point(&part, 0.005, column).is_none()).collect();
        assert_eq!(hidden, [16, 17, 18, 141, 142, 143]);
    }

    #[test]
    fn the_cell_hides_the_table_from_the_camera_in_front_of_it_and_not_behind() {
        let Scenario { camera, part, .. } = scenario();
        // Height of the rim 4 mm, axis at 30 degrees: a shadow of 4 mm · tan 30° = 2.31 mm before the first edge.
        let sees_table = |y_m| camera.lit_point(&part, y_m, 80).is_some();
        for (y_m, seen) in [(-0.0028, true), (-0.0020, false), (-0.0001, false), (0.0101, true)] {
            assert_eq!(sees_table(y_m), seen, "{y_m}");
        }
    }

    #[test]
    fn the_calibration_file_states_the_camera() {
        assert_eq!(
            scenario().camera.calibration_yaml(),
            "type: vertical_incidence\nframe_id: laser_plane\nimage_distance_m: 0.026\nobject_distance_m: 0.3\n\
             beta_rad: 0.5235987755982988\npixel_pitch_m: 9.6e-6\nbase_row_px: 75.0\ncenter_column_px: 79.5\n\
             height_sign: -1\n"
        );
    }
}
