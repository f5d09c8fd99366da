//! Heights on a regular grid, computed from the measured points.
//!
//! The surface between four neighbouring points (two of a profile, two of the next) is modelled as two flat triangles.
//! A cell holds the mean height of that surface over its area, sampled on a lattice at least as fine as the points.
//! Heights are thus filtered by linear interpolation between points and a mean over a cell: a wave along x or y keeps
//! `sinc²(pitch / wavelength) · sinc(cell / wavelength)` of its height. A cell is invalid if less than half of it was
//! measured; otherwise it holds the mean of its measured part. Nothing is interpolated between points that are far
//! apart or missing.

mod fill;
mod triangle;

pub use fill::fill_gaps;

use nalgebra::Point3;
use thiserror::Error;

use super::surface::{Region, is_measured};

/// Largest number of cells of a grid: with its sums it takes 1 GiB.
pub(crate) const MAX_CELLS: u64 = 1 << 26;
/// Coarsest and finest lattice in a cell, per side.
const MIN_SAMPLES: u32 = 3;
const MAX_SAMPLES: u32 = 8;

/// Origin of a cell's height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum CellState {
    /// Not measured.
    #[default]
    Invalid = 0,
    /// Measured.
    Measured = 1,
    /// Interpolated from measured neighbours on request.
    Filled = 2,
}

/// Position and size of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridLayout {
    /// Corner of the first cell: its smallest x and y, metres.
    pub origin_m: [f64; 2],
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Number of cells along x.
    pub width: u32,
    /// Number of cells along y.
    pub height: u32,
}

/// The reason why a grid cannot be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum GridError {
    /// No point lies in the region.
    #[error("no point was measured in the region")]
    Empty,
    /// A bound of the region is infinite or NaN.
    #[error("the region is unbounded: all its bounds must be finite")]
    Unbounded,
    /// The side of a cell is not a finite number above 0.
    #[error("the side of a cell is {cell_m} m: it must be finite and above 0")]
    Cell {
        /// Side of a cell, metres.
        cell_m: f64,
    },
    /// The grid is too large.
    #[error(
        "cells of {cell_m:.3e} m make {cells} cells, {MAX_CELLS} are allowed: choose cells of {enough_m:.1e} m or more, or a region"
    )]
    TooLarge {
        /// Side of a cell, metres.
        cell_m: f64,
        /// Resulting number of cells.
        cells: u64,
        /// Smallest allowed side, metres.
        enough_m: f64,
    },
}

impl GridLayout {
    /// Returns the grid that covers a region; cell corners lie at multiples of the cell's side `cell_m`, metres, a finite
    /// number above 0.
    ///
    /// # Errors
    /// An empty or unbounded region, a side that is not allowed, or too many cells.
    pub fn covering(region: &Region, cell_m: f64) -> Result<Self, GridError> {
        let sides = [0, 1].map(|axis| region.to_m[axis] - region.from_m[axis]);
        if sides.iter().any(|side| *side < 0.0) {
            return Err(GridError::Empty);
        }
        if !sides.iter().all(|side| side.is_finite()) {
            return Err(GridError::Unbounded);
        }
        if !(cell_m.is_finite() && cell_m > 0.0) {
            return Err(GridError::Cell { cell_m });
        }
        let first = region.from_m.map(|from| (from / cell_m).floor());
        let counts = [0, 1].map(|axis| (region.to_m[axis] / cell_m).floor() - first[axis] + 1.0);
        let cells = counts[0] * counts[1];
        if cells.is_nan() || cells > MAX_CELLS as f64 {
            let enough_m = (sides[0] * sides[1] / MAX_CELLS as f64).sqrt().max(2.0 * cell_m);
            return Err(GridError::TooLarge { cell_m, cells: cells as u64, enough_m });
        }
        Ok(Self {
            origin_m: first.map(|first| first * cell_m),
            cell_m,
            width: counts[0] as u32,
            height: counts[1] as u32,
        })
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn num_cells(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Returns x and y of the middle of a cell, metres.
    #[must_use]
    pub fn center_m(&self, column: usize, row: usize) -> [f64; 2] {
        [(0, column), (1, row)]
            .map(|(axis, at)| self.origin_m[axis] + (at as f64 + 0.5) * self.cell_m)
    }
}

/// Heights on a regular grid, row by row, y growing from row to row.
#[derive(Clone, Debug, PartialEq)]
pub struct RegularHeightMap {
    /// Position and size of the grid.
    pub layout: GridLayout,
    /// Heights, metres; NaN where nothing was measured.
    pub z_m: Vec<f32>,
    /// Origin of each height.
    pub states: Vec<CellState>,
}

impl RegularHeightMap {
    /// Returns the smallest and largest height, metres; `None` if nothing was measured.
    #[must_use]
    pub fn range_m(&self) -> Option<[f32; 2]> {
        self.z_m.iter().filter(|z| z.is_finite()).fold(None, |range, &z| {
            let [low, high] = range.unwrap_or([z, z]);
            Some([low.min(z), high.max(z)])
        })
    }

    /// Returns the number of cells in a state.
    #[must_use]
    pub fn count(&self, state: CellState) -> usize {
        self.states.iter().filter(|found| **found == state).count()
    }
}

/// Adds profiles to a grid, one after another.
#[derive(Clone, Debug)]
pub struct Resampler {
    layout: GridLayout,
    /// Lattice points along a cell's side.
    samples: u32,
    max_gap_m: f64,
    sums: Vec<f64>,
    counts: Vec<u32>,
    previous: Vec<Point3<f64>>,
    rows: u64,
    /// The first profile, needed to close the surface after a whole turn.
    first: Vec<Point3<f64>>,
}

impl Resampler {
    /// Starts a grid. `pitch_m` is the typical distance of neighbours along x and along y; points more than three times
    /// as far apart are not joined.
    #[must_use]
    pub fn new(layout: GridLayout, pitch_m: [f64; 2]) -> Self {
        let finest = 0.5 * pitch_m[0].min(pitch_m[1]);
        let samples = (layout.cell_m / finest).ceil();
        let samples = if samples.is_finite() { samples as u32 } else { MAX_SAMPLES };
        Self {
            layout,
            samples: samples.clamp(MIN_SAMPLES, MAX_SAMPLES),
            max_gap_m: 3.0 * pitch_m[0].max(pitch_m[1]),
            sums: vec![0.0; layout.num_cells()],
            counts: vec![0; layout.num_cells()],
            previous: Vec::new(),
            rows: 0,
            first: Vec::new(),
        }
    }

    /// Adds the next profile of the scan. A profile of a different length is not joined to the previous one.
    pub fn push(&mut self, profile: &[Point3<f64>]) {
        if self.rows == 0 {
            self.first.extend_from_slice(profile);
        }
        if self.previous.len() == profile.len() {
            let previous = std::mem::take(&mut self.previous);
            for i in 1..profile.len() {
                self.quad([previous[i - 1], previous[i], profile[i], profile[i - 1]]);
            }
            self.previous = previous;
        }
        self.previous.clear();
        self.previous.extend_from_slice(profile);
        self.rows += 1;
    }

    /// Returns the heights of all profiles added. If the last profile is next to the first, as after a whole turn, the
    /// surface is closed.
    #[must_use]
    pub fn finish(mut self) -> RegularHeightMap {
        let first = std::mem::take(&mut self.first);
        if self.rows > 2 {
            self.push(&first);
        }
        let half = (self.samples * self.samples).div_ceil(2);
        let cells = self.sums.iter().zip(&self.counts);
        let z_m: Vec<f32> = cells
            .map(
                |(sum, &count)| {
                    if count >= half { (sum / f64::from(count)) as f32 } else { f32::NAN }
                },
            )
            .collect();
        let state = |z: &f32| if z.is_finite() { CellState::Measured } else { CellState::Invalid };
        let states = z_m.iter().map(state).collect();
        RegularHeightMap { layout: self.layout, z_m, states }
    }

    /// Adds the surface between four neighbours, in order round it; if one is missing, between the other three.
    fn quad(&mut self, corners: [Point3<f64>; 4]) {
        let [a, b, c, d] = corners.map(|corner| is_measured(&corner));
        match (a, b, c, d) {
            (true, true, true, true) => {
                self.triangle([corners[0], corners[1], corners[2]]);
                self.triangle([corners[0], corners[2], corners[3]]);
            }
            (false, true, true, true) => self.triangle([corners[1], corners[2], corners[3]]),
            (true, false, true, true) => self.triangle([corners[0], corners[2], corners[3]]),
            (true, true, false, true) => self.triangle([corners[0], corners[1], corners[3]]),
            (true, true, true, false) => self.triangle([corners[0], corners[1], corners[2]]),
            _ => {}
        }
    }

    fn triangle(&mut self, corners: [Point3<f64>; 3]) {
        let is_wide =
            |i: usize| (corners[(i + 1) % 3].xy() - corners[i].xy()).norm() > self.max_gap_m;
        if (0..3).any(is_wide) {
            return;
        }
        let samples = f64::from(self.samples);
        let scale = samples / self.layout.cell_m;
        let local = corners.map(|corner| {
            let [x, y] = [
                (corner.x - self.layout.origin_m[0]) * scale,
                (corner.y - self.layout.origin_m[1]) * scale,
            ];
            [x, y, corner.z]
        });
        let size =
            [self.layout.width, self.layout.height].map(|n| n as usize * self.samples as usize);
        let (width, samples) = (self.layout.width as usize, self.samples as usize);
        triangle::sample(&local, size, |column, row, z_m| {
            let cell = row / samples * width + column / samples;
            self.sums[cell] += z_m;
            self.counts[cell] += 1;
        });
    }
}

#[cfg(test)]
mod tests;
