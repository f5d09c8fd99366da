//! Gauges with heights given by formulas, and the image of the laser light on them.

use serde::Deserialize;

use super::{Rig, geometry::World};
use crate::simulate::{
    exposure::CrossSection,
    scenario_error::{ScenarioError, check_entries, check_range},
};

const MAX_ROUNDS: u32 = 64;
const SIGHT_SAMPLES: u32 = 128;

/// A gauge: x along the stripe, y along the motion, heights above the frame's origin.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gauge {
    /// Brightness of the stripe as a share of the laser's amplitude.
    pub(crate) reflectance: f64,
    /// Height of the reference plane at x = y = 0, metres.
    #[serde(default)]
    pub(crate) height_m: f64,
    /// Inclination of the whole gauge: rise along x and along y.
    #[serde(default)]
    pub(crate) slope: [f64; 2],
    /// Shape on the reference plane.
    pub(crate) shape: Shape,
}

/// Departures from the reference plane.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub(crate) enum Shape {
    /// None.
    Flat {},
    /// A groove along y, as in ISO 5436-1 type A1.
    Groove {
        /// Its width along x, metres.
        width_m: f64,
        /// Its depth, metres.
        depth_m: f64,
    },
    /// Plateaus along x from -x to x, metres above the reference plane.
    Stairs {
        /// Width of each, metres.
        width_m: f64,
        /// Heights, metres.
        heights_m: Vec<f64>,
    },
    /// Balls of one size.
    Spheres {
        /// Their radius, metres.
        radius_m: f64,
        /// Their centres x, y and height above the reference plane, metres.
        centers_m: Vec<[f64; 3]>,
    },
}

impl Gauge {
    /// Returns the height at (x, y), metres.
    pub(crate) fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let over = match &self.shape {
            Shape::Flat {} => 0.0,
            Shape::Groove { width_m, depth_m } => {
                if x_m.abs() < 0.5 * width_m {
                    -depth_m
                } else {
                    0.0
                }
            }
            Shape::Stairs { width_m, heights_m } => {
                let at = x_m / width_m + 0.5 * heights_m.len() as f64;
                let last = heights_m.len().saturating_sub(1);
                heights_m.get((at.max(0.0) as usize).min(last)).copied().unwrap_or(0.0)
            }
            Shape::Spheres { radius_m, centers_m } => centers_m
                .iter()
                .filter_map(|[x, y, z]| {
                    let under = radius_m * radius_m - (x_m - x).powi(2) - (y_m - y).powi(2);
                    (under > 0.0).then(|| z + under.sqrt())
                })
                .fold(0.0, f64::max),
        };
        self.height_m + self.slope[0] * x_m + self.slope[1] * y_m + over
    }

    /// Returns the light that `line` of the image shows with the axis at `position_m`, for a laser of amplitude 1.
    pub(super) fn cross_section(
        &self,
        rig: &Rig,
        world: &World,
        position_m: f64,
        line: u32,
    ) -> CrossSection {
        let dark = CrossSection { center_px: f64::NAN, amplitude: 0.0, sigma_px: 1.0 };
        let Some((x_m, z_m)) = self.lit_point(rig, world, position_m, line) else { return dark };
        let Some([column, row]) = world.seen(rig, x_m, z_m) else { return dark };
        let (center_px, size_px) =
            if rig.is_vertical { (column, rig.width_px) } else { (row, rig.height_px) };
        if !(-0.5..f64::from(size_px) - 0.5).contains(&center_px) {
            return dark;
        }
        CrossSection { center_px, amplitude: self.reflectance, sigma_px: 1.0 }
    }

    /// Returns x and z of the lit point that a line shows; `None` if it is hidden or lies in a wall.
    fn lit_point(
        &self,
        rig: &Rig,
        world: &World,
        position_m: f64,
        line: u32,
    ) -> Option<(f64, f64)> {
        let mut z_m = self.ceiling_m();
        let mut x_m = 0.0;
        for _ in 0..MAX_ROUNDS {
            x_m = along(rig, world, x_m, z_m, f64::from(line))?;
            let surface_m = self.height_m(x_m, position_m);
            if (surface_m - z_m).abs() < 1e-13 {
                return self.sees(world, position_m, (x_m, z_m)).then_some((x_m, z_m));
            }
            z_m = surface_m;
        }
        None
    }

    /// Returns true if the line of sight to the lens stays above the gauge.
    fn sees(&self, world: &World, position_m: f64, (x_m, z_m): (f64, f64)) -> bool {
        if matches!(self.shape, Shape::Flat {}) {
            return true;
        }
        let [lens_x, lens_y, lens_z] = world.lens_m();
        let free_share = ((self.ceiling_m() - z_m) / (lens_z - z_m)).clamp(0.0, 1.0);
        (1..=SIGHT_SAMPLES).all(|sample| {
            let share = free_share * f64::from(sample) / f64::from(SIGHT_SAMPLES);
            let surface = self.height_m(x_m + share * (lens_x - x_m), position_m + share * lens_y);
            surface <= z_m + share * (lens_z - z_m) + 1e-9
        })
    }

    /// Returns a height above everything within a metre of the origin, metres.
    fn ceiling_m(&self) -> f64 {
        let over = match &self.shape {
            Shape::Flat {} | Shape::Groove { .. } => 0.0,
            Shape::Stairs { heights_m, .. } => heights_m.iter().copied().fold(0.0, f64::max),
            Shape::Spheres { radius_m, centers_m } => {
                centers_m.iter().map(|center| center[2] + radius_m).fold(0.0, f64::max)
            }
        };
        self.height_m + over + 0.1 * (self.slope[0].abs() + self.slope[1].abs())
    }

    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        check_range("gauge.reflectance", self.reflectance, 0.0, 1.0)?;
        check_range("gauge.height_m", self.height_m, -10.0, 10.0)?;
        check_range("gauge.slope[0]", self.slope[0], -1.0, 1.0)?;
        check_range("gauge.slope[1]", self.slope[1], -1.0, 1.0)?;
        match &self.shape {
            Shape::Flat {} => Ok(()),
            Shape::Groove { width_m, depth_m } => {
                check_range("gauge.shape.groove.width_m", *width_m, 1e-6, 1.0)?;
                check_range("gauge.shape.groove.depth_m", *depth_m, 0.0, 1.0)
            }
            Shape::Stairs { width_m, heights_m } => {
                check_range("gauge.shape.stairs.width_m", *width_m, 1e-6, 1.0)?;
                check_entries("gauge.shape.stairs.heights_m", heights_m)?;
                heights_m.iter().try_for_each(|height_m| {
                    check_range("gauge.shape.stairs.heights_m", *height_m, -1.0, 1.0)
                })
            }
            Shape::Spheres { radius_m, centers_m } => {
                check_range("gauge.shape.spheres.radius_m", *radius_m, 1e-6, 1.0)?;
                check_entries("gauge.shape.spheres.centers_m", centers_m)?;
                centers_m.iter().flatten().try_for_each(|value_m| {
                    check_range("gauge.shape.spheres.centers_m", *value_m, -1.0, 1.0)
                })
            }
        }
    }
}

/// Returns x of the point at height `z_m` that a line shows, from an initial guess, by the secant method.
fn along(rig: &Rig, world: &World, guess_m: f64, z_m: f64, line: f64) -> Option<f64> {
    let miss = |x_m: f64| {
        world
            .seen(rig, x_m, z_m)
            .map(|[column, row]| (if rig.is_vertical { row } else { column }) - line)
    };
    let (mut before_m, mut x_m) = (guess_m - 1e-4, guess_m);
    let mut missed_before = miss(before_m)?;
    for _ in 0..MAX_ROUNDS {
        let missed = miss(x_m)?;
        if missed.abs() < 1e-11 || (missed - missed_before).abs() < f64::MIN_POSITIVE {
            return Some(x_m);
        }
        let next_m = x_m - missed * (x_m - before_m) / (missed - missed_before);
        (before_m, x_m, missed_before) = (x_m, next_m, missed);
    }
    None
}
