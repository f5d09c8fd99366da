//! Measured points in the order of measurement.

use nalgebra::Point3;

use crate::statistics::median;

/// Points row by row, one row per profile. A point with NaN was not measured, or is excluded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Points per row.
    pub width: usize,
    /// `width` points per row: x along the stripe, y along the motion, z up, metres in the frame of the part.
    pub points: Vec<Point3<f64>>,
}

/// A rectangle seen from above, borders included: x from, y from, x to, y to, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Smallest x and y, metres.
    pub from_m: [f64; 2],
    /// Largest x and y, metres.
    pub to_m: [f64; 2],
}

impl Region {
    /// The unbounded region.
    pub const ALL: Self = Self { from_m: [f64::NEG_INFINITY; 2], to_m: [f64::INFINITY; 2] };

    /// Returns true if a point lies in the region.
    #[must_use]
    pub fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let inside =
            |value: f64, axis: usize| value >= self.from_m[axis] && value <= self.to_m[axis];
        inside(x_m, 0) && inside(y_m, 1)
    }
}

impl Surface {
    /// Returns the same points at the same indices, without those outside a region.
    #[must_use]
    pub fn within(&self, region: &Region) -> Self {
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let keep = |point: &Point3<f64>| {
            if region.contains(point.x, point.y) { *point } else { nowhere }
        };
        Self { width: self.width, points: self.points.iter().map(keep).collect() }
    }

    /// Rows in the order of their frames.
    pub fn rows(&self) -> impl Iterator<Item = &[Point3<f64>]> {
        self.points.chunks_exact(self.width.max(1))
    }

    /// Returns the measured points with their indices in `points`.
    pub fn measured(&self) -> impl Iterator<Item = (usize, &Point3<f64>)> {
        self.points.iter().enumerate().filter(|(_, point)| is_measured(point))
    }

    /// Returns the number of measured points.
    #[must_use]
    pub fn num_measured(&self) -> usize {
        self.measured().count()
    }

    /// Returns the number of profiles with a measured point.
    #[must_use]
    pub fn num_profiles(&self) -> usize {
        self.rows().filter(|row| row.iter().any(is_measured)).count()
    }

    /// Returns the transposed surface, with x and y exchanged.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let height = self.points.len() / self.width.max(1);
        let turned = (0..self.width).flat_map(|column| {
            (0..height).map(move |row| {
                let point = self.points[row * self.width + column];
                Point3::new(point.y, point.x, point.z)
            })
        });
        Self { width: height, points: turned.collect() }
    }

    /// Returns the smallest region that holds all points; empty without any.
    #[must_use]
    pub fn extent(&self) -> Region {
        let mut extent = Region { from_m: [f64::INFINITY; 2], to_m: [f64::NEG_INFINITY; 2] };
        for (_, point) in self.measured() {
            for axis in [0, 1] {
                extent.from_m[axis] = extent.from_m[axis].min(point[axis]);
                extent.to_m[axis] = extent.to_m[axis].max(point[axis]);
            }
        }
        extent
    }

    /// Returns the typical distance of neighbours in a row and of neighbouring rows, seen from above, metres; 0 where
    /// there are none.
    #[must_use]
    pub fn pitch_m(&self) -> [f64; 2] {
        let far = |pair: [&Point3<f64>; 2]| (pair[1].xy() - pair[0].xy()).norm();
        let in_rows = self.rows().flat_map(|row| row.windows(2).map(move |p| far([&p[0], &p[1]])));
        let width = self.width.max(1);
        let below = self.points.iter().zip(self.points.iter().skip(width));
        let between = below.map(|(upper, lower)| far([upper, lower]));
        [typical(in_rows), typical(between)]
    }

    /// Returns values of measured points in the layout of the points; NaN elsewhere.
    pub(super) fn spread(&self, values: &[f64], weights: &[f64]) -> Vec<f64> {
        let mut spread = vec![f64::NAN; self.points.len()];
        for ((at, _), (value, weight)) in self.measured().zip(values.iter().zip(weights)) {
            if *weight > 0.0 {
                spread[at] = *value;
            }
        }
        spread
    }
}

/// Returns true if a point was measured: all coordinates are finite.
#[must_use]
pub fn is_measured(point: &Point3<f64>) -> bool {
    point.x.is_finite() && point.y.is_finite() && point.z.is_finite()
}

/// Returns the median of all finite values; 0 without any.
fn typical(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    median(&mut values).unwrap_or(0.0)
}
