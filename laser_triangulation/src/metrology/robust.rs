//! Linear least squares that is robust against outliers.

use nalgebra::{SMatrix, SVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::statistics::{NORMAL_MEDIAN_MAGNITUDE, median, order_statistic};

/// Number of scales beyond which a residual has no weight; 95 % efficiency on normal noise (Beaton and Tukey 1974).
pub(super) const TUKEY: f64 = 4.685;
/// Random samples for the start: with a third of outliers and three unknowns, all contain an outlier in one case of
/// 10^20.
const NUM_DRAWS: usize = 130;
/// Number of residuals that judge a sample.
const MAX_JUDGES: usize = 400;
const MAX_ROUNDS: usize = 50;
/// Residuals below this share of the largest value count as rounding errors.
const ROUNDING: f64 = 1e-12;

/// One equation `row · x = value`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Equation<const P: usize> {
    /// Coefficients.
    pub(crate) row: SVector<f64, P>,
    /// Right-hand side.
    pub(crate) value: f64,
}

/// A robust solution.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fit<const P: usize> {
    /// The solution.
    pub(crate) x: SVector<f64, P>,
    /// Residuals, in the order of the equations: value - row · x.
    pub(crate) residuals: Vec<f64>,
    /// Tukey's weights, 0 to 1; 0: an outlier.
    pub(crate) weights: Vec<f64>,
    /// Robust standard deviation of the residuals, in their unit.
    pub(crate) scale: f64,
    /// Covariance of `x` for independent residuals of any spread.
    pub(crate) covariance: SMatrix<f64, P, P>,
}

/// Solves by iteratively reweighted least squares with Tukey's biweight (Holland and Welsch 1977). Starts from the
/// least median of squares (Rousseeuw 1984). The covariance is the sandwich covariance of M-estimators (Huber 1981,
/// equation 6.6.3 with unequal spreads). `None` if there are too few equations, or they do not determine the solution.
#[must_use]
pub(crate) fn solve<const P: usize>(equations: &[Equation<P>]) -> Option<Fit<P>> {
    if equations.len() < P {
        return None;
    }
    let floor = ROUNDING * largest(equations.iter().map(|equation| equation.value));
    let mut weights = vec![1.0; equations.len()];
    // All equations decide whether a solution exists.
    let mut x = weighted(equations, &weights)?;
    x = least_median(equations).unwrap_or(x);
    let mut residuals = residuals_of(equations, &x);
    let mut scale = scale_of(&residuals, P);
    for _ in 0..MAX_ROUNDS {
        tukey(&residuals, scale.max(floor), &mut weights);
        let next = weighted(equations, &weights)?;
        let change = (next - x).amax();
        x = next;
        residuals = residuals_of(equations, &x);
        scale = scale_of(&residuals, P);
        if change <= 1e-12 * x.amax() {
            break;
        }
    }
    tukey(&residuals, scale.max(floor), &mut weights);
    let covariance = sandwich(equations, &residuals, scale.max(floor))?;
    Some(Fit { x, residuals, weights, scale, covariance })
}

/// Returns the solution of `P` equations whose residuals have the smallest median magnitude, among many random samples
/// with a fixed seed.
fn least_median<const P: usize>(equations: &[Equation<P>]) -> Option<SVector<f64, P>> {
    let stride = equations.len().div_ceil(MAX_JUDGES);
    let judges: Vec<_> = equations.iter().step_by(stride).collect();
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut best: Option<(f64, SVector<f64, P>)> = None;
    let mut magnitudes = Vec::with_capacity(judges.len());
    for _ in 0..NUM_DRAWS {
        let mut drawn = [equations[0]; P];
        drawn.fill_with(|| equations[random.random_range(0..equations.len())]);
        let Some(x) = weighted(&drawn, &[1.0; P]) else { continue };
        magnitudes.clear();
        magnitudes.extend(judges.iter().map(|judge| (judge.value - judge.row.dot(&x)).abs()));
        let Some(median) = median(&mut magnitudes) else { continue };
        if best.as_ref().is_none_or(|(least, _)| median < *least) {
            best = Some((median, x));
        }
    }
    best.map(|(_, x)| x)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::MIN_POSITIVE, |largest, value| largest.max(value.abs()))
}

fn weighted<const P: usize>(equations: &[Equation<P>], weights: &[f64]) -> Option<SVector<f64, P>> {
    let mut normal = SMatrix::<f64, P, P>::zeros();
    let mut right = SVector::<f64, P>::zeros();
    for (equation, &weight) in equations.iter().zip(weights) {
        normal += weight * equation.row * equation.row.transpose();
        right += weight * equation.value * equation.row;
    }
    let scaling = scaling(&normal)?;
    let scaled = SMatrix::<f64, P, P>::from_fn(|i, j| normal[(i, j)] * scaling[i] * scaling[j]);
    let solved = inverse(&scaled)? * right.component_mul(&scaling);
    Some(solved.component_mul(&scaling))
}

/// Returns factors that give the matrix a unit diagonal.
fn scaling<const P: usize>(normal: &SMatrix<f64, P, P>) -> Option<SVector<f64, P>> {
    let diagonal = normal.diagonal();
    let is_sound = diagonal.iter().all(|value| value.is_finite() && *value > 0.0);
    is_sound.then(|| diagonal.map(|value| 1.0 / value.sqrt()))
}

/// Returns the inverse of a symmetric positive matrix with a unit diagonal; `None` if it is singular within rounding.
fn inverse<const P: usize>(scaled: &SMatrix<f64, P, P>) -> Option<SMatrix<f64, P, P>> {
    let inverse = scaled.try_inverse()?;
    let is_sound = inverse.iter().all(|value| value.is_finite()) && inverse.amax() < 1e12;
    is_sound.then_some(inverse)
}

fn residuals_of<const P: usize>(equations: &[Equation<P>], x: &SVector<f64, P>) -> Vec<f64> {
    equations.iter().map(|equation| equation.value - equation.row.dot(x)).collect()
}

fn tukey(residuals: &[f64], scale: f64, weights: &mut [f64]) {
    for (weight, residual) in weights.iter_mut().zip(residuals) {
        let share = (residual / (TUKEY * scale)).powi(2);
        *weight = if share < 1.0 { (1.0 - share).powi(2) } else { 0.0 };
    }
}

/// Returns the robust standard deviation from the median magnitude, corrected for the number of fitted values.
fn scale_of(residuals: &[f64], num_fitted: usize) -> f64 {
    let mut magnitudes: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
    let num = magnitudes.len();
    // The fitted values make that many residuals smaller than the true errors.
    let middle = num.midpoint(num_fitted).min(num - 1);
    order_statistic(&mut magnitudes, middle).unwrap_or(f64::NAN) / NORMAL_MEDIAN_MAGNITUDE
}

/// Returns `A⁻¹ B A⁻¹` with `A = Σ ψ'(r) row rowᵀ` and `B = Σ ψ(r)² row rowᵀ`.
fn sandwich<const P: usize>(
    equations: &[Equation<P>],
    residuals: &[f64],
    scale: f64,
) -> Option<SMatrix<f64, P, P>> {
    let mut a = SMatrix::<f64, P, P>::zeros();
    let mut b = SMatrix::<f64, P, P>::zeros();
    let mut num_inside = 0;
    for (equation, residual) in equations.iter().zip(residuals) {
        let share = (residual / (TUKEY * scale)).powi(2);
        if share >= 1.0 {
            continue;
        }
        num_inside += 1;
        let outer = equation.row * equation.row.transpose();
        a += (1.0 - share) * (1.0 - 5.0 * share) * outer;
        b += (residual * (1.0 - share).powi(2)).powi(2) * outer;
    }
    let scaling = scaling(&a)?;
    let scaled = SMatrix::<f64, P, P>::from_fn(|i, j| a[(i, j)] * scaling[i] * scaling[j]);
    let inverse = inverse(&scaled)?;
    let inverse = SMatrix::<f64, P, P>::from_fn(|i, j| inverse[(i, j)] * scaling[i] * scaling[j]);
    let num = num_inside as f64;
    let lost = if num_inside > P { num / (num - P as f64) } else { 1.0 };
    Some(lost * inverse * b * inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, StandardNormal};

    fn line(seed: u64, is_outlier: impl Fn(usize) -> bool) -> Vec<Equation<2>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        (0..200)
            .map(|i| {
                let u = i as f64 / 100.0 - 1.0;
                let wrong = if is_outlier(i) { 25.0 + normal() } else { 0.0 };
                Equation { row: [1.0, u].into(), value: 3.0 - 2.0 * u + 0.1 * normal() + wrong }
            })
            .collect()
    }

    #[test]
    fn a_quarter_of_outliers_on_one_side_does_not_bend_it() {
        let fit = solve(&line(1, |i| i >= 150)).unwrap();
        assert!((fit.x[0] - 3.0).abs() < 0.05 && (fit.x[1] + 2.0).abs() < 0.1, "{:?}", fit.x);
        assert!(fit.weights[150..].iter().all(|weight| *weight == 0.0));
        // The median over all residuals is the 67 % quantile of the good ones: 1.43 times too large.
        assert!((fit.scale - 0.143).abs() < 0.02, "{}", fit.scale);
    }

    #[test]
    fn the_covariance_covers_the_truth() {
        let mut covered = [0; 2];
        let num = 400;
        for seed in 0..num {
            let fit = solve(&line(seed, |i| i % 20 == 3)).unwrap();
            for (i, truth) in [3.0, -2.0].into_iter().enumerate() {
                let sigma = fit.covariance[(i, i)].sqrt();
                covered[i] += u64::from((fit.x[i] - truth).abs() < 1.96 * sigma);
            }
        }
        for covered in covered {
            let share = covered as f64 / num as f64;
            assert!((share - 0.95).abs() < 0.03, "{share}");
        }
    }

    #[test]
    fn without_noise_the_solution_is_exact() {
        let exact: Vec<_> = (0..50)
            .map(|i| Equation { row: [1.0, f64::from(i)].into(), value: 7.0 + 0.5 * f64::from(i) })
            .collect();
        let fit = solve(&exact).unwrap();
        assert!((fit.x[0] - 7.0).abs() < 1e-12 && (fit.x[1] - 0.5).abs() < 1e-13);
    }

    #[test]
    fn underdetermined_equations_have_no_solution() {
        let same = vec![Equation { row: [1.0, 2.0].into(), value: 1.0 }; 9];
        assert!(solve(&same).is_none());
        assert!(solve(&same[..1]).is_none());
    }
}
