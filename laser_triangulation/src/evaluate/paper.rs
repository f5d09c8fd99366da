//! The protocol of Yao et al. 2023 (doi 10.3390/app13179831), section 4.2: three methods on the same columns, the mean of
//! the three as reference, and each one's deviations from it.
//!
//! The protocol measures how well the methods agree, not how accurate they are: it cannot see an error that all three
//! share, and it favours a method that is close to one of the others. [`super::experiment`] measures against ground
//! truth.

use serde::Serialize;

use crate::scanner::params::Method;

/// The compared methods, in the order of the paper's tables.
pub const METHODS: [Method; 3] =
    [Method::GrayGravity, Method::GaussianFit, Method::ImprovedGravity];

/// Deviation of one method from the mean of the three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Deviations {
    /// Mean of |v| over the points, pixels.
    pub mean_absolute_px: f64,
    /// √(Σ v² / (n − 1)), the formula printed in the paper, pixels.
    pub standard_error_px: f64,
    /// Σ v² / √(n − 1), the same without the square root of the sum, which reproduces the paper's Table 4; square
    /// pixels.
    pub without_root: f64,
}

/// Running sums over points.
#[derive(Clone, Copy, Debug, Default)]
pub struct Protocol {
    points: u64,
    absolute_px: [f64; 3],
    squares_px2: [f64; 3],
}

impl Protocol {
    /// Adds several columns.
    pub fn of(columns_px: &[[f64; 3]]) -> Self {
        let mut protocol = Self::default();
        for &positions_px in columns_px {
            protocol.add(positions_px);
        }
        protocol
    }

    /// Adds the positions of the three methods in one column, pixels.
    pub fn add(&mut self, positions_px: [f64; 3]) {
        let reference = positions_px.iter().sum::<f64>() / 3.0;
        self.points += 1;
        for (method, position) in positions_px.into_iter().enumerate() {
            let deviation = position - reference;
            self.absolute_px[method] += deviation.abs();
            self.squares_px2[method] += deviation * deviation;
        }
    }

    /// Returns the number of columns added.
    pub const fn points(&self) -> u64 {
        self.points
    }

    /// Returns the deviations of each of the three methods; NaN for less than two points.
    pub fn deviations(&self) -> [Deviations; 3] {
        let freedom = if self.points < 2 { f64::NAN } else { (self.points - 1) as f64 };
        [0, 1, 2].map(|method| Deviations {
            mean_absolute_px: self.absolute_px[method] / self.points as f64,
            standard_error_px: (self.squares_px2[method] / freedom).sqrt(),
            without_root: self.squares_px2[method] / freedom.sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{super::table3, *};

    #[test]
    fn table_3_gives_the_printed_deviations_and_another_table_4() {
        let protocol = Protocol::of(&table3::ROWS_PX);
        assert_eq!(protocol.points(), 21);
        let rounded = |value: f64, digits: usize| format!("{value:.digits$}");
        let found = protocol.deviations();
        let column = |value: fn(&Deviations) -> f64, digits| {
            found.each_ref().map(|deviations| rounded(value(deviations), digits))
        };
        assert_eq!(column(|d| d.mean_absolute_px, 3), ["0.060", "0.050", "0.026"]);
        assert_eq!(column(|d| d.standard_error_px, 3), ["0.078", "0.063", "0.034"]);
        let printed = table3::PRINTED_STANDARD_ERROR_PX.map(|value| rounded(value, 4));
        assert_eq!(column(|d| d.without_root, 4), printed);
    }

    #[test]
    fn two_columns_by_hand() {
        let mut protocol = Protocol::default();
        protocol.add([10.0, 10.3, 10.3]);
        assert!(protocol.deviations()[0].standard_error_px.is_nan(), "one point has no spread");
        protocol.add([20.0, 19.7, 20.0]);
        // The references are 10.2 and 19.9.
        let found = protocol.deviations();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(found[0].mean_absolute_px, 0.15);
        close(found[1].mean_absolute_px, 0.15);
        close(found[2].mean_absolute_px, 0.10);
        close(found[0].standard_error_px, 0.05_f64.sqrt());
        close(found[0].without_root, 0.05);
    }
}
