//! Light other than the stripe, which a profiler must ignore. Grey levels are those of the bit depth.

use serde::Deserialize;

use super::scenario_error::{ScenarioError, check_entries, check_range};

/// Everything in the image except the stripe.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Clutter {
    /// Grey level of the ambient light in the middle of the image.
    pub(crate) ambient: f64,
    /// Increase from the first to the last column, grey levels.
    pub(crate) ambient_gain_across_columns: f64,
    /// Increase from the first to the last row, grey levels.
    pub(crate) ambient_gain_across_rows: f64,
    /// Weaker copies of the stripe.
    pub(crate) reflections: Vec<Reflection>,
    /// Bright round spots.
    pub(crate) spots: Vec<Spot>,
}

/// A weaker copy of the stripe, as a glossy part reflects it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reflection {
    /// Distance from the stripe, pixels; positive towards higher rows (columns, for a vertical stripe).
    pub(crate) offset_px: f64,
    /// Brightness as a share of the stripe's.
    pub(crate) share: f64,
    /// First column (row, for a vertical stripe) in which it is visible.
    pub(crate) first: u32,
    /// Last column (row, for a vertical stripe) in which it is visible.
    pub(crate) last: u32,
}

/// A round Gaussian spot at a fixed position.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Spot {
    /// Column of its centre, pixels.
    pub(crate) column_px: f64,
    /// Row of its centre, pixels.
    pub(crate) row_px: f64,
    /// Standard deviation, pixels.
    pub(crate) sigma_px: f64,
    /// Grey level at its centre.
    pub(crate) level: f64,
    /// First frame in which it is visible.
    pub(crate) first_frame: u32,
    /// Last frame in which it is visible.
    pub(crate) last_frame: u32,
}

impl Clutter {
    /// Returns the grey level at (column, row) of an image of `size_px` (width, height) in a frame, without
    /// reflections.
    pub(crate) fn level(&self, frame: u32, size_px: [u32; 2], at_px: [u32; 2]) -> f64 {
        // From -½ at the first to ½ at the last pixel.
        let [u, v] = [0, 1].map(|axis| {
            f64::from(at_px[axis]) / f64::from(size_px[axis].saturating_sub(1).max(1)) - 0.5
        });
        let spots = self.spots.iter().map(|spot| spot.level_at(frame, at_px.map(f64::from)));
        self.ambient
            + self.ambient_gain_across_columns * u
            + self.ambient_gain_across_rows * v
            + spots.sum::<f64>()
    }

    /// Rejects clutter that cannot be rendered.
    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        for (key, level) in [
            ("ambient", self.ambient),
            ("ambient_gain_across_columns", self.ambient_gain_across_columns),
            ("ambient_gain_across_rows", self.ambient_gain_across_rows),
        ] {
            check_range(&format!("clutter.{key}"), level, -1e6, 1e6)?;
        }
        check_entries("clutter.reflections", &self.reflections)?;
        check_entries("clutter.spots", &self.spots)?;
        for (index, reflection) in self.reflections.iter().enumerate() {
            let key = |name: &str| format!("clutter.reflections[{index}].{name}");
            check_range(&key("offset_px"), reflection.offset_px, -8192.0, 8192.0)?;
            check_range(&key("share"), reflection.share, 0.0, 10.0)?;
        }
        for (index, spot) in self.spots.iter().enumerate() {
            let key = |name: &str| format!("clutter.spots[{index}].{name}");
            check_range(&key("column_px"), spot.column_px, -8192.0, 16_384.0)?;
            check_range(&key("row_px"), spot.row_px, -8192.0, 16_384.0)?;
            check_range(&key("sigma_px"), spot.sigma_px, 0.1, 1000.0)?;
            check_range(&key("level"), spot.level, 0.0, 1e6)?;
        }
        Ok(())
    }
}

impl Spot {
    fn level_at(&self, frame: u32, [column_px, row_px]: [f64; 2]) -> f64 {
        if !(self.first_frame..=self.last_frame).contains(&frame) {
            return 0.0;
        }
        let (dx, dy) = (column_px - self.column_px, row_px - self.row_px);
        self.level * libm::exp(-0.5 * (dx * dx + dy * dy) / (self.sigma_px * self.sigma_px))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ambient_light_is_linear_and_spots_have_a_lifetime() {
        let spot = Spot {
            column_px: 10.0,
            row_px: 5.0,
            sigma_px: 2.0,
            level: 80.0,
            first_frame: 3,
            last_frame: 4,
        };
        let clutter = Clutter {
            ambient: 20.0,
            ambient_gain_across_columns: 10.0,
            ambient_gain_across_rows: -4.0,
            spots: vec![spot],
            ..Clutter::default()
        };
        let level = |frame, at| clutter.level(frame, [101, 51], at);
        assert!((level(0, [0, 0]) - 17.0).abs() < 1e-12);
        assert!((level(0, [100, 50]) - 23.0).abs() < 1e-12);
        let added = |at| level(3, at) - level(2, at);
        assert!((added([10, 5]) - 80.0).abs() < 1e-12);
        assert!((added([12, 5]) - 80.0 * (-0.5_f64).exp()).abs() < 1e-12);
        assert!((level(5, [10, 5]) - level(0, [10, 5])).abs() < 1e-12);
    }
}
