//! Hard scenes: one curved line of known position with what real pictures add to it, alone and together: glow, clipping,
//! a halo in the laser's colour, a second line, speckle and uneven surfaces.
//!
//! A point is *right* within [`NEAR_PX`] or three of its own standard deviations of the truth. It is *in doubt* if it
//! carries a flag of [`DOUBT`]. It is *wrong* if it is farther off than [`NEAR_PX`], carries no such flag, and states a
//! standard deviation below a third of its error: nothing in the result shows that it must not be used.
//!
//! The truth is the centre of the line. With a second line it is the nearest of the lines that
//! [`PeakSelection`] may mean: both if they are equally bright in the picture and the brightest one is wanted, the outer
//! one if the first or the last is. Points that are flagged as one of several peaks are in doubt on either line.

mod grid;
mod render;
mod score;
mod study;

use serde::Serialize;

use crate::{
    named_enum,
    scanner::params::{ExtractionParams, PeakSelection, StripeDirection},
};

pub use grid::grid;
pub use score::{DOUBT, Figures, NEAR_PX, WrongPoint};
pub use study::{ClassFigures, HardStudy, MethodFigures, SceneFigures, run};

/// Pixels along the line.
pub const LENGTH_PX: u32 = 640;
/// Pixels across the line.
pub const ACROSS_PX: u32 = 240;
/// Brightness of two lines in the picture, weaker over brighter, from which either may count as the brightest.
const EQUAL_SHARE: f64 = 0.9;

named_enum! {
    /// A kind of difficulty.
    Class {
        /// The line alone, from dim to ten times full scale.
        Line = "line",
        /// A broad glow beside a line that is not clipped.
        Glow = "glow",
        /// The same with a clipped line.
        SaturatedGlow = "saturated_glow",
        /// A one-sided halo in the laser's colour, in a colour image.
        Halo = "halo",
        /// A second line, equal or weaker.
        SecondLine = "second_line",
        /// Speckle and uneven surfaces.
        Texture = "texture",
        /// Several of them together.
        Mixed = "mixed",
    }
}

/// A broad glow beside the line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Glow {
    /// Its level as a share of the line's level in the picture.
    pub share: f64,
    /// Its standard deviation across the line, pixels.
    pub sigma_px: f64,
    /// Its distance from the line across it, pixels, negative towards the first row (column, for a vertical line).
    pub distance_px: f64,
}

/// A halo in the laser's colour: exponential, on one side of the line and half as high and half as wide on the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Halo {
    /// Its level at the line as a share of full scale.
    pub share: f64,
    /// Distance at which it falls to 1/e, pixels; negative towards the first row (column, for a vertical line).
    pub length_px: f64,
}

/// A second line beside the line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Second {
    /// Its light as a share of the line's.
    pub share: f64,
    /// Its distance from the line across it, pixels, negative towards the first row (column, for a vertical line).
    pub distance_px: f64,
}

/// Unevenness of the laser's light in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Texture {
    /// Speckle of this contrast, 0 to 1, and grain, pixels.
    Speckle {
        /// Standard deviation of the brightness over its mean.
        contrast: f64,
        /// Size of a grain, pixels.
        grain_px: f64,
    },
    /// Reflectance between 1 − depth and 1 in patches of this size, pixels.
    Patches {
        /// Largest loss of light, 0 to 1.
        depth: f64,
        /// Size of a patch, pixels.
        size_px: f64,
    },
}

/// A curved line of [`LENGTH_PX`] by [`ACROSS_PX`] pixels and its surroundings. Grey levels are 8-bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardScene {
    /// Its place in the grid.
    pub(crate) number: u32,
    /// Seed of its noise and of the line's shape.
    pub(crate) seed: u32,
    /// Kind.
    pub(crate) class: Class,
    /// Direction of the line in the picture.
    pub(crate) direction: StripeDirection,
    /// Peak light of the line over full scale, for infinitely small pixels.
    pub(crate) saturation: f64,
    /// Standard deviation across the line, pixels.
    pub(crate) sigma_px: f64,
    /// Glow beside it.
    pub(crate) glow: Option<Glow>,
    /// Halo; makes it a colour image.
    pub(crate) halo: Option<Halo>,
    /// Second line.
    pub(crate) second: Option<Second>,
    /// Unevenness.
    pub(crate) texture: Option<Texture>,
}

impl HardScene {
    /// Returns the true centre across the line, pixels, at a position along it.
    pub(crate) fn center_px(&self, along_px: u32) -> f64 {
        let phase = f64::from(self.seed);
        let wave = libm::sin(5.0 * f64::from(along_px) / f64::from(LENGTH_PX) + phase);
        0.5 * f64::from(ACROSS_PX) + 24.0 * wave + 0.37 * libm::sin(0.7 * phase)
    }

    /// True if this selection may mean the second line. With several stripes in a cross-section both lines are meant.
    pub(crate) fn accepts_second(&self, second: &Second, params: &ExtractionParams) -> bool {
        let level = |light: f64| light.min(1.0);
        let equal = level(second.share * self.saturation) >= EQUAL_SHARE * level(self.saturation);
        params.max_stripes > 1
            || match params.peak_selection {
                PeakSelection::First => second.distance_px < 0.0,
                PeakSelection::Last => second.distance_px > 0.0,
                PeakSelection::Brightest | PeakSelection::Widest | PeakSelection::Continuity => {
                    equal
                }
            }
    }

    /// Returns the positions across the line, pixels, at which a point is on a line that the parameters may mean.
    pub(crate) fn accepted_px(&self, along_px: u32, params: &ExtractionParams) -> [f64; 2] {
        let main = self.center_px(along_px);
        let Some(second) = self.second.filter(|second| self.accepts_second(second, params)) else {
            return [main; 2];
        };
        let other = main + second.distance_px;
        let is_main_meant = match params.peak_selection {
            PeakSelection::First | PeakSelection::Last => params.max_stripes > 1,
            _ => true,
        };
        [if is_main_meant { main } else { other }, other]
    }
}
