//! The scanned part: a prismatic cell on a table, covered by a film with defects. Heights are above the table.
//!
//! x runs along the stripe, 0 in the middle of the cell; y along the motion, 0 at the edge that meets the laser first.

use serde::Deserialize;

use super::scenario_error::{ScenarioError, check_entries, check_range};

/// A cell on a table.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Brightness of the stripe on the table as a share of the laser's amplitude; 0: invisible.
    pub table_reflectance: f64,
    /// The cell.
    pub cell: Cell,
    /// The film on the cell.
    pub film: Film,
}

/// A box with vertical walls.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Size along the stripe, metres.
    pub(crate) width_m: f64,
    /// Size along the motion, metres.
    pub(crate) length_m: f64,
    /// Height, metres.
    pub(crate) height_m: f64,
    /// Brightness of the stripe on the bare cell as a share of the laser's amplitude.
    pub(crate) reflectance: f64,
}

/// A film on top of the cell; the heights of its defects add up.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Film {
    /// Bare rim of the cell around the film, metres.
    pub margin_m: f64,
    /// Thickness, metres.
    pub thickness_m: f64,
    /// Brightness of the stripe on the film as a share of the laser's amplitude.
    pub reflectance: f64,
    /// Smooth deviation from flat.
    #[serde(default)]
    pub warp: Warp,
    /// Raised spherical caps.
    #[serde(default)]
    pub bubbles: Vec<Bubble>,
    /// Sunken spherical caps.
    #[serde(default)]
    pub pits: Vec<Pit>,
    /// Ridges.
    #[serde(default)]
    pub folds: Vec<Fold>,
}

/// Second-order height over the cell: `bow_x · u² + bow_y · v² + twist · u · v`, u and v from -1 to 1 edge to edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warp {
    /// Height of the edges parallel to the motion over the middle, metres.
    pub(crate) bow_x_m: f64,
    /// Height of the first and last edge over the middle, metres.
    pub(crate) bow_y_m: f64,
    /// Height of two opposite corners, metres; the other two are as much lower.
    pub(crate) twist_m: f64,
}

/// A raised spherical cap.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bubble {
    /// Centre along the stripe, metres.
    pub x_m: f64,
    /// Centre along the motion, metres.
    pub y_m: f64,
    /// Radius of its rim, metres.
    pub radius_m: f64,
    /// Height of its top, metres; at most the radius.
    pub height_m: f64,
}

/// A sunken spherical cap.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pit {
    /// Centre along the stripe, metres.
    pub x_m: f64,
    /// Centre along the motion, metres.
    pub y_m: f64,
    /// Radius of its rim, metres.
    pub radius_m: f64,
    /// Depth of its bottom, metres; at most the radius.
    pub depth_m: f64,
}

/// A ridge with round ends: `height · cos²(π/2 · distance / half_width)` about a line.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fold {
    /// One end of the line (x, y), metres.
    pub from_m: [f64; 2],
    /// Its other end (x, y), metres.
    pub to_m: [f64; 2],
    /// Distance at which the height reaches 0, metres.
    pub half_width_m: f64,
    /// Height on the line, metres.
    pub height_m: f64,
}

/// A point of the part's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Height above the table, metres.
    pub height_m: f64,
    /// Brightness of the stripe as a share of the laser's amplitude.
    pub reflectance: f64,
}

impl Part {
    /// Returns the surface at (x, y), metres.
    pub fn surface(&self, x_m: f64, y_m: f64) -> Surface {
        let cell = &self.cell;
        // Distance to the nearest wall, positive inside.
        let inside_m = (0.5 * cell.width_m - x_m.abs()).min(y_m.min(cell.length_m - y_m));
        if inside_m < 0.0 {
            return Surface { height_m: 0.0, reflectance: self.table_reflectance };
        }
        if inside_m < self.film.margin_m {
            return Surface { height_m: cell.height_m, reflectance: cell.reflectance };
        }
        let u = 2.0 * x_m / cell.width_m;
        let v = 2.0 * y_m / cell.length_m - 1.0;
        let height_m = cell.height_m + self.film.height_m([x_m, y_m], [u, v]);
        Surface { height_m, reflectance: self.film.reflectance }
    }

    /// Returns a height above every point of the surface, metres.
    pub(crate) fn ceiling_m(&self) -> f64 {
        let film = &self.film;
        let warp = &film.warp;
        self.cell.height_m
            + film.thickness_m
            + warp.bow_x_m.abs()
            + warp.bow_y_m.abs()
            + warp.twist_m.abs()
            + film.bubbles.iter().map(|bubble| bubble.height_m).sum::<f64>()
            + film.folds.iter().map(|fold| fold.height_m).sum::<f64>()
    }

    /// Rejects an impossible part.
    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        let (cell, film) = (&self.cell, &self.film);
        check_range("part.table_reflectance", self.table_reflectance, 0.0, 1.0)?;
        for (key, size_m) in
            [("width_m", cell.width_m), ("length_m", cell.length_m), ("height_m", cell.height_m)]
        {
            check_range(&format!("part.cell.{key}"), size_m, 1e-6, 10.0)?;
        }
        check_range("part.cell.reflectance", cell.reflectance, 0.0, 1.0)?;
        film.check(0.5 * cell.width_m.min(cell.length_m))
    }
}

impl Film {
    /// Returns the height over the cell at `at_m` (x, y), metres; `uv` is the same place from -1 to 1 over the cell.
    fn height_m(&self, at_m: [f64; 2], [u, v]: [f64; 2]) -> f64 {
        let warp = &self.warp;
        let bubbles = self
            .bubbles
            .iter()
            .map(|b| cap_m(distance_m(at_m, [b.x_m, b.y_m]), b.radius_m, b.height_m));
        let pits = self
            .pits
            .iter()
            .map(|p| -cap_m(distance_m(at_m, [p.x_m, p.y_m]), p.radius_m, p.depth_m));
        let folds = self.folds.iter().map(|fold| fold.height_at_m(at_m));
        self.thickness_m
            + warp.bow_x_m * u * u
            + warp.bow_y_m * v * v
            + warp.twist_m * u * v
            + bubbles.chain(pits).chain(folds).sum::<f64>()
    }

    fn check(&self, max_margin_m: f64) -> Result<(), ScenarioError> {
        check_range("part.film.margin_m", self.margin_m, 0.0, max_margin_m)?;
        check_range("part.film.thickness_m", self.thickness_m, 0.0, 1.0)?;
        check_range("part.film.reflectance", self.reflectance, 0.0, 1.0)?;
        check_range("part.film.warp.bow_x_m", self.warp.bow_x_m, -1.0, 1.0)?;
        check_range("part.film.warp.bow_y_m", self.warp.bow_y_m, -1.0, 1.0)?;
        check_range("part.film.warp.twist_m", self.warp.twist_m, -1.0, 1.0)?;
        check_entries("part.film.bubbles", &self.bubbles)?;
        check_entries("part.film.pits", &self.pits)?;
        check_entries("part.film.folds", &self.folds)?;
        for (index, bubble) in self.bubbles.iter().enumerate() {
            let key = format!("part.film.bubbles[{index}]");
            check_disc(&key, bubble.x_m, bubble.y_m, bubble.radius_m)?;
            check_range(&format!("{key}.height_m"), bubble.height_m, 0.0, bubble.radius_m)?;
        }
        for (index, pit) in self.pits.iter().enumerate() {
            let key = format!("part.film.pits[{index}]");
            check_disc(&key, pit.x_m, pit.y_m, pit.radius_m)?;
            check_range(&format!("{key}.depth_m"), pit.depth_m, 0.0, pit.radius_m)?;
        }
        for (index, fold) in self.folds.iter().enumerate() {
            let key = |name: &str| format!("part.film.folds[{index}].{name}");
            for (name, [x_m, y_m]) in [("from_m", fold.from_m), ("to_m", fold.to_m)] {
                check_range(&key(name), x_m, -100.0, 100.0)?;
                check_range(&key(name), y_m, -100.0, 100.0)?;
            }
            check_range(&key("half_width_m"), fold.half_width_m, 1e-6, 1.0)?;
            check_range(&key("height_m"), fold.height_m, 0.0, 1.0)?;
        }
        Ok(())
    }
}

impl Fold {
    fn height_at_m(&self, at_m: [f64; 2]) -> f64 {
        let [x0, y0] = self.from_m;
        let (dx, dy) = (self.to_m[0] - x0, self.to_m[1] - y0);
        let length_squared = dx * dx + dy * dy;
        let along = if length_squared > 0.0 {
            (((at_m[0] - x0) * dx + (at_m[1] - y0) * dy) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let distance = distance_m(at_m, [x0 + along * dx, y0 + along * dy]) / self.half_width_m;
        if distance >= 1.0 {
            return 0.0;
        }
        let fade = libm::cos(std::f64::consts::FRAC_PI_2 * distance);
        self.height_m * fade * fade
    }
}

/// Returns the height of a spherical cap at a distance from its axis; 0 outside its rim.
fn cap_m(distance_m: f64, radius_m: f64, height_m: f64) -> f64 {
    if distance_m >= radius_m || height_m == 0.0 {
        return 0.0;
    }
    let sphere_m = (radius_m * radius_m + height_m * height_m) / (2.0 * height_m);
    (sphere_m * sphere_m - distance_m * distance_m).sqrt() - (sphere_m - height_m)
}

fn distance_m(from: [f64; 2], to: [f64; 2]) -> f64 {
    libm::hypot(from[0] - to[0], from[1] - to[1])
}

/// Checks the place and the radius of a spherical cap.
fn check_disc(key: &str, x_m: f64, y_m: f64, radius_m: f64) -> Result<(), ScenarioError> {
    check_range(&format!("{key}.x_m"), x_m, -100.0, 100.0)?;
    check_range(&format!("{key}.y_m"), y_m, -100.0, 100.0)?;
    check_range(&format!("{key}.radius_m"), radius_m, 1e-6, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::scenario::{EXAMPLE, Scenario};

    fn part() -> Part {
        Scenario::from_yaml(EXAMPLE).unwrap().part
    }

    /// Height over table, film and warp, metres.
    fn defect_m(x_m: f64, y_m: f64) -> f64 {
        let (u, v) = (x_m / 0.006, y_m / 0.005 - 1.0);
        let smooth = 0.0042 + 1e-4 * u * u + 5e-5 * v * v + 2e-5 * u * v;
        part().surface(x_m, y_m).height_m - smooth
    }

    #[test]
    fn table_cell_and_film_are_steps() {
        let part = part();
        for (x, y, height, reflectance) in [
            (0.0, -0.001, 0.0, 0.5),
            (0.0062, 0.005, 0.0, 0.5),
            (0.0055, 0.005, 0.004, 0.8),
            (0.0, 0.0095, 0.004, 0.8),
            (0.0, 0.005, 0.0042, 1.0),
        ] {
            assert_eq!(part.surface(x, y), Surface { height_m: height, reflectance }, "{x} {y}");
        }
    }

    #[test]
    fn defects_have_their_stated_shape() {
        assert!((defect_m(0.002, 0.005) - 0.0004).abs() < 1e-12, "top of the bubble");
        // Sphere through rim and top: R = (1² + 0.4²)/0.8 = 1.45 mm; at 0.5 mm: √(1.45² − 0.5²) − 1.05 mm.
        let at_half = (1.45_f64.powi(2) - 0.25).sqrt() - 1.05;
        assert!((defect_m(0.0025, 0.005) - at_half * 1e-3).abs() < 1e-12);
        assert!(defect_m(0.00301, 0.005).abs() < 1e-12, "beyond the rim");
        assert!((defect_m(-0.0035, 0.007) + 0.0003).abs() < 1e-12, "bottom of the pit");
        assert!((defect_m(-0.003, 0.002) - 0.0003).abs() < 1e-12, "end of the fold");
        assert!((defect_m(-0.003, 0.0018) - 0.00015).abs() < 1e-12, "half way down its round end");
    }

    #[test]
    fn nothing_is_above_the_ceiling() {
        let part = part();
        for i in 0..200 {
            for j in 0..200 {
                let at = (f64::from(i) * 7e-5 - 0.007, f64::from(j) * 6e-5 - 0.001);
                assert!(part.surface(at.0, at.1).height_m <= part.ceiling_m());
            }
        }
    }
}
