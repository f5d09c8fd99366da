//! A measured value with its uncertainty and the calibration's share in it.

use crate::metrology::NORMAL_95;

/// A value with its standard deviation and the half width of its 95 % interval, in its SI unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figure {
    /// Value.
    pub(crate) value: f64,
    /// One standard deviation.
    pub(crate) sigma: f64,
    /// Half width of the 95 % interval.
    pub(crate) u95: f64,
    /// Standard deviation due to the calibration, included in `sigma`; `None` if unknown.
    pub(crate) calibration: Option<f64>,
}

impl Figure {
    /// A value from many independent points.
    pub(crate) const fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma, u95: NORMAL_95 * sigma, calibration: None }
    }

    /// A value whose 95 % interval is given.
    pub(crate) const fn with_u95(value: f64, sigma: f64, u95: f64) -> Self {
        Self { value, sigma, u95, calibration: None }
    }

    /// Adds the standard deviation due to the calibration in quadrature; `None` if unknown.
    pub(crate) fn with_calibration(self, sigma: Option<f64>) -> Self {
        let Some(sigma) = sigma else { return self };
        Self {
            sigma: self.sigma.hypot(sigma),
            u95: self.u95.hypot(NORMAL_95 * sigma),
            calibration: Some(sigma),
            ..self
        }
    }
}
