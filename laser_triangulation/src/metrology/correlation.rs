//! The loss of information if the errors of neighbouring points are correlated.

/// Correlation below which the sum ends: smaller values are noise of the estimate.
const LEAST: f64 = 0.05;
/// Longest lag, as a share of a row (column).
const MAX_SHARE: usize = 4;

/// Returns the factor by which correlation along the rows and along the columns of `residuals` increases the variance
/// of a mean: `1 + 2 Σ ρ(k)`, where the sum ends when ρ is lost in its own noise (Bayley and Hammersley 1946; the
/// initial sequence as in Geyer 1992). `width` residuals make a row; NaN: no residual.
#[must_use]
pub(crate) fn inflation(residuals: &[f64], width: usize) -> [f64; 2] {
    let width = width.clamp(1, residuals.len().max(1));
    let height = residuals.len() / width;
    [along(residuals, [height, width], [width, 1]), along(residuals, [width, height], [1, width])]
}

/// Returns the factor along one direction: `[lines, length]` and `[from line to line, from point to point]`.
fn along(residuals: &[f64], shape: [usize; 2], strides: [usize; 2]) -> f64 {
    let [lines, length] = shape;
    let at = |line: usize, point: usize| residuals[line * strides[0] + point * strides[1]];
    let product = |lag: usize| {
        let (mut sum, mut num) = (0.0, 0_usize);
        for line in 0..lines {
            for point in lag..length {
                let term = at(line, point) * at(line, point - lag);
                if term.is_finite() {
                    sum += term;
                    num += 1;
                }
            }
        }
        (num > 0).then(|| (sum / num as f64, num))
    };
    let Some((variance, _)) = product(0).filter(|(variance, _)| *variance > 0.0) else {
        return 1.0;
    };
    let mut factor = 1.0;
    for lag in 1..=length / MAX_SHARE {
        let Some((covariance, num)) = product(lag) else { break };
        let correlation = covariance / variance;
        if correlation < LEAST.max(2.0 / (num as f64).sqrt()) {
            break;
        }
        factor += 2.0 * correlation;
    }
    factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn smoothed_noise_counts_as_fewer_independent_points() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let white: Vec<f64> = (0..40_005).map(|_| StandardNormal.sample(&mut random)).collect();
        let [row, column] = inflation(&white[..40_000], 200);
        assert!((row - 1.0).abs() < 0.15 && (column - 1.0).abs() < 0.15, "{row} {column}");
        // A mean over five neighbours leaves one fifth of the points independent.
        let smooth: Vec<f64> = white.windows(5).map(|w| w.iter().sum::<f64>() / 5.0).collect();
        let [row, column] = inflation(&smooth[..40_000], 200);
        assert!((row - 5.0).abs() < 0.6 && (column - 1.0).abs() < 0.2, "{row} {column}");
    }

    #[test]
    fn holes_and_empty_input_are_handled() {
        for residuals in [&[] as &[f64], &[f64::NAN; 30], &[0.0; 30]] {
            assert!(inflation(residuals, 10).iter().all(|factor| (factor - 1.0).abs() < 1e-15));
        }
    }
}
