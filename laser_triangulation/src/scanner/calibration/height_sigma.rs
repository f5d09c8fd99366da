//! How uncertain a calibration makes the height seen at a place of the image.
//!
//! The height is measured again with each calibration that is off by one standard deviation, and the differences add in
//! quadrature, with the bow of the line by the lens. A table makes this cheap: in each cell of a coarse grid over the image
//! the differences are interpolated bilinearly. The sum of their squares is a polynomial of nine coefficients, however many
//! differences there are.

use std::ops::{Add, Mul};

use super::{Calibration, Deviation, Lines};
use crate::scanner::params::StripeDirection;

/// Cells of the table along and across the stripe.
const CELLS: usize = 32;
/// Neighbouring lines that are looked up together.
const BLOCK: usize = 16;
/// Largest error of the interpolation in the middle of a cell, as a share of the largest standard deviation in the cell.
/// Cells that exceed it, as where the laser plane vanishes from the image, have no entry.
const LARGEST_ERROR: f64 = 0.01;

/// Standard deviations of heights that the calibration's uncertainty explains.
#[derive(Clone, Debug)]
pub(super) struct HeightSigma {
    nominal: Calibration,
    /// The calibrations that are off by one standard deviation.
    others: Vec<Calibration>,
    table: Option<Table>,
}

/// The variance of the height in each cell of the image.
#[derive(Clone, Debug)]
struct Table {
    direction: StripeDirection,
    image_px: (u32, u32),
    /// Cells a pixel, along and across.
    cells_per_px: [f64; 2],
    /// The cells across the stripe at the first place along it, then those at the second.
    cells: Vec<Variance>,
}

/// Coefficients of a variance in square metres: row `s`, column `t` multiplies the s-th power of the place across and the
/// t-th power of that along, both from 0 to 1 within the cell. NaN: no entry.
type Variance = [[f32; 3]; 3];

impl HeightSigma {
    /// `None` if the calibration states no uncertainty.
    pub(super) fn new(calibration: &Calibration) -> Option<Self> {
        let others = calibration.shifted().ok()?;
        Some(Self { nominal: calibration.clone(), others, table: None })
    }

    /// Makes the table, unless it exists.
    pub(super) fn prepare(&mut self, direction: StripeDirection, image_px: (u32, u32)) {
        let is_made = |table: &Table| table.direction == direction && table.image_px == image_px;
        if !self.table.as_ref().is_some_and(is_made) {
            self.table = Some(self.tabulated(direction, image_px));
        }
    }

    /// Replaces places across the stripe in pixels, one for each searched line, by one standard deviation of the height seen
    /// there, metres. Infinite where one of the other calibrations sees nothing; NaN stays.
    pub(super) fn replace(&self, lines: &Lines, values: &mut [f32]) {
        let direction = lines.direction;
        let table = self.table.as_ref().filter(|table| table.direction == direction);
        let mut next = lines.first;
        for block in values.chunks_mut(BLOCK) {
            let is_done = table.is_some_and(|table| table.replace(next, block));
            if !is_done {
                for (line, value) in (next..).zip(block.iter_mut()) {
                    let variance = table.map_or(f32::NAN, |table| table.variance(line, *value));
                    *value = if variance.is_nan() && !value.is_nan() {
                        self.computed(direction, [line as f64, f64::from(*value)]) as f32
                    } else {
                        root(variance)
                    };
                }
            }
            next += block.len();
        }
    }

    /// Returns one standard deviation of the height seen at (along, across) in pixels without the table, metres.
    fn computed(&self, direction: StripeDirection, place_px: [f64; 2]) -> f64 {
        let differences = self.differences(direction, || std::iter::once(place_px));
        let sigma_m = differences.iter().flatten().map(|by_m| by_m * by_m).sum::<f64>().sqrt();
        if sigma_m.is_nan() { f64::INFINITY } else { sigma_m }
    }

    fn tabulated(&self, direction: StripeDirection, image_px: (u32, u32)) -> Table {
        let (along_px, across_px) = match direction {
            StripeDirection::Horizontal => image_px,
            StripeDirection::Vertical => (image_px.1, image_px.0),
        };
        let cell_px = [along_px, across_px].map(|px| f64::from(px.max(2) - 1) / CELLS as f64);
        // Corners, then middles, each row by row along the stripe.
        let places = |count: usize, offset: f64| {
            let place = move |at: usize| (at as f64) + offset;
            (0..count * count)
                .map(move |at| [place(at % count) * cell_px[0], place(at / count) * cell_px[1]])
        };
        let corners = self.differences(direction, || places(CELLS + 1, 0.0));
        let middles = self.differences(direction, || places(CELLS, 0.5));
        let cell = |column: usize, row: usize| {
            let first = row * (CELLS + 1) + column;
            let places = [first, first + 1, first + CELLS + 1, first + CELLS + 2];
            let corners: Vec<_> =
                corners.iter().map(|of_one| places.map(|place| of_one[place])).collect();
            let middle = row * CELLS + column;
            let middle = middles.iter().map(|of_one| of_one[middle].powi(2)).sum::<f64>();
            checked(variance(&corners), middle)
        };
        let cells = (0..CELLS * CELLS).map(|at| cell(at / CELLS, at % CELLS)).collect();
        Table { direction, image_px, cells_per_px: cell_px.map(f64::recip), cells }
    }

    /// Returns by how much the height at each place differs with each of the other calibrations, and by the bow of the line,
    /// metres.
    fn differences<Places: Iterator<Item = [f64; 2]>>(
        &self,
        direction: StripeDirection,
        places: impl Fn() -> Places,
    ) -> Vec<Vec<f64>> {
        let nominal: Vec<_> = self.nominal.points_m(direction, places()).collect();
        let of_other = |other: &Calibration| {
            let points = other.points_m(direction, places());
            points.zip(&nominal).map(|([_, other], [_, nominal])| other - nominal).collect()
        };
        let of_lens = |by: Deviation| nominal.iter().map(|point| by.at_m(*point)).collect();
        self.others.iter().map(of_other).chain(self.nominal.deviations().map(of_lens)).collect()
    }
}

/// Returns the sum of the squares of differences that are given in the corners of a cell: at its origin, at the end along, at
/// the end across, and opposite.
fn variance(differences: &[[f64; 4]]) -> [[f64; 3]; 3] {
    let mut sum = [[0.0; 3]; 3];
    for [origin, along, across, opposite] in differences {
        // a + b t + c s + d s t
        let (a, b, c) = (*origin, along - origin, across - origin);
        let d = opposite - along - c;
        let square = [
            [a * a, 2.0 * a * b, b * b],
            [2.0 * a * c, 2.0 * (a * d + b * c), 2.0 * b * d],
            [c * c, 2.0 * c * d, d * d],
        ];
        for (sum, square) in sum.as_flattened_mut().iter_mut().zip(square.as_flattened()) {
            *sum += square;
        }
    }
    sum
}

/// Returns the variance, or no entry if it is far from the given one in the middle of the cell.
fn checked(variance: [[f64; 3]; 3], middle: f64) -> Variance {
    let at = |t: f64, s: f64| polynomial(&variance, t, s).max(0.0).sqrt();
    let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
    let middle = middle.sqrt();
    let largest = corners.into_iter().fold(middle, f64::max);
    let is_near = (at(0.5, 0.5) - middle).abs() <= LARGEST_ERROR * largest;
    let entry = variance.map(|row| row.map(|coefficient| coefficient as f32));
    let is_finite = entry.as_flattened().iter().all(|coefficient| coefficient.is_finite());
    if is_near && is_finite { entry } else { [[f32::NAN; 3]; 3] }
}

fn polynomial<Number>(coefficients: &[[Number; 3]; 3], t: Number, s: Number) -> Number
where
    Number: Copy + Add<Output = Number> + Mul<Output = Number>,
{
    let [first, second, third] = coefficients.map(|[a, b, c]| a + t * (b + t * c));
    first + s * (second + s * third)
}

/// Returns the square root. Rounding errors may make a variance of 0 negative; NaN stays.
fn root(variance: f32) -> f32 {
    if variance < 0.0 { 0.0 } else { variance.sqrt() }
}

impl Table {
    /// Replaces the places of neighbouring lines as [`HeightSigma::replace`] does, with vector instructions. Returns false, and
    /// changes nothing, if they do not all lie in one cell, or the cell has no entry.
    fn replace(&self, first: usize, places: &mut [f32]) -> bool {
        let Ok(places) = <&mut [f32; BLOCK]>::try_from(places) else { return false };
        let [per_line, per_px] = self.cells_per_px.map(|cells| cells as f32);
        let ([column, row], [t, _]) = self.cell(first, places[0]);
        let last = t + (BLOCK - 1) as f32 * per_line;
        let cell = &self.cells[column * CELLS + row];
        let from = row as f32;
        let is_inside = |place: &f32| (0.0..=1.0).contains(&(*place * per_px - from));
        // No short circuit: this is faster in one go.
        if !places.iter().map(is_inside).fold(last <= 1.0, |all, one| all & one)
            || cell[0][0].is_nan()
        {
            return false;
        }
        for (number, value) in places.iter_mut().enumerate() {
            let [t, s] = [t + number as f32 * per_line, *value * per_px - from];
            *value = polynomial(cell, t, s).max(0.0).sqrt();
        }
        true
    }

    /// Returns the variance at a searched line and a place across it, pixels; NaN without an entry.
    fn variance(&self, line: usize, place_px: f32) -> f32 {
        let ([column, row], [t, s]) = self.cell(line, place_px);
        polynomial(&self.cells[column * CELLS + row], t, s)
    }

    /// Returns the cell of a place, and the place in it, each along and across.
    fn cell(&self, line: usize, place_px: f32) -> ([usize; 2], [f32; 2]) {
        let [per_line, per_px] = self.cells_per_px;
        let at = [line as f64 * per_line, f64::from(place_px) * per_px];
        let cell = at.map(|at| (at as usize).min(CELLS - 1));
        (cell, [0, 1].map(|axis| (at[axis] - cell[axis] as f64) as f32))
    }
}

#[cfg(test)]
mod tests;
