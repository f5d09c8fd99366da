//! The Levenberg-Marquardt method for a few dozen unknowns (Nocedal and Wright 2006, section 10.3).

use nalgebra::{DMatrix, DVector};

/// Largest number of steps.
const MAX_STEPS: usize = 60;
/// Relative change of the cost that counts as convergence.
const STILL: f64 = 1e-14;
/// Step of the numeric derivatives, for unknowns of the order of 1: half the digits of an `f64`.
const STEP: f64 = 1e-7;

/// A solution.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// The unknowns.
    pub(crate) unknowns: DVector<f64>,
    /// The residuals at the solution.
    pub(crate) residuals: DVector<f64>,
    /// Covariance of the unknowns for residuals with standard deviation 1; `None` if they are not determined.
    pub(crate) unit_covariance: Option<DMatrix<f64>>,
}

impl Solution {
    /// Returns the root mean square of the residuals.
    pub(super) fn rms(&self) -> f64 {
        (self.residuals.norm_squared() / self.residuals.len() as f64).sqrt()
    }
}

/// Returns the unknowns near `start` with the least sum of squared residuals. `residuals` returns `None` where it is
/// undefined, and the search stays out of there. `None` if it is undefined at the start.
pub(super) fn minimise(
    start: DVector<f64>,
    residuals: impl Fn(&DVector<f64>) -> Option<DVector<f64>>,
) -> Option<Solution> {
    let mut unknowns = start;
    let mut now = residuals(&unknowns)?;
    let mut damping = 1e-4;
    let mut slopes = derivatives(&unknowns, &now, &residuals)?;
    for _ in 0..MAX_STEPS {
        let normal = slopes.tr_mul(&slopes);
        let gradient = slopes.tr_mul(&now);
        let mut damped = normal.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] += damping * normal[(i, i)].max(1e-12);
        }
        let Some(solved) = damped.cholesky() else {
            damping *= 10.0;
            continue;
        };
        let next = &unknowns - solved.solve(&gradient);
        let better = residuals(&next).filter(|found| found.norm_squared() <= now.norm_squared());
        let Some(found) = better else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let gain = now.norm_squared() - found.norm_squared();
        let is_still = gain <= STILL * now.norm_squared();
        (unknowns, now) = (next, found);
        damping = (damping * 0.1_f64).max(1e-12);
        slopes = derivatives(&unknowns, &now, &residuals)?;
        if is_still {
            break;
        }
    }
    let unit_covariance = slopes.tr_mul(&slopes).cholesky().map(|solved| solved.inverse());
    Some(Solution { unknowns, residuals: now, unit_covariance })
}

fn derivatives(
    unknowns: &DVector<f64>,
    now: &DVector<f64>,
    residuals: &impl Fn(&DVector<f64>) -> Option<DVector<f64>>,
) -> Option<DMatrix<f64>> {
    let mut slopes = DMatrix::zeros(now.len(), unknowns.len());
    for i in 0..unknowns.len() {
        let (mut ahead, mut behind) = (unknowns.clone(), unknowns.clone());
        ahead[i] += STEP;
        behind[i] -= STEP;
        let slope = match (residuals(&ahead), residuals(&behind)) {
            (Some(ahead), Some(behind)) => (ahead - behind) / (2.0 * STEP),
            // At the edge of the domain.
            (Some(ahead), None) => (ahead - now) / STEP,
            (None, Some(behind)) => (now - behind) / STEP,
            (None, None) => return None,
        };
        slopes.set_column(i, &slope);
    }
    Some(slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_rosenbrocks_function_is_found() {
        let residuals = |x: &DVector<f64>| {
            Some(DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]))
        };
        let found = minimise(DVector::from_vec(vec![-1.2, 1.0]), residuals).unwrap();
        assert!((found.unknowns - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-6);
        assert!(found.unit_covariance.is_some());
    }

    #[test]
    fn the_search_stays_inside_the_domain() {
        let residuals = |x: &DVector<f64>| (x[0] > 0.5).then(|| DVector::from_vec(vec![x[0]]));
        assert!(minimise(DVector::from_vec(vec![0.0]), residuals).is_none());
        let found = minimise(DVector::from_vec(vec![1.0]), residuals).unwrap();
        assert!(found.unknowns[0] > 0.5);
    }
}
