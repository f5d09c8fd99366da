//! The independent directions of a covariance.

use nalgebra::{DMatrix, SymmetricEigen};

/// Returns the principal axes of a covariance, each as long as one standard deviation along it, without axes of
/// rounding errors. The values have different units, so they are first scaled to their own standard deviations.
pub(crate) fn axes(num: usize, covariance: &[f64]) -> Vec<Vec<f64>> {
    let matrix = DMatrix::from_row_slice(num, num, covariance);
    let sigmas: Vec<f64> = (0..num).map(|i| matrix[(i, i)].max(0.0).sqrt()).collect();
    let scaled = DMatrix::from_fn(num, num, |i, j| {
        let scale = sigmas[i] * sigmas[j];
        if scale > 0.0 { matrix[(i, j)] / scale } else { 0.0 }
    });
    let eigen = SymmetricEigen::new(scaled);
    let kept = (0..num).filter(|i| eigen.eigenvalues[*i] > 1e-9);
    kept.map(|i| {
        let length = eigen.eigenvalues[i].sqrt();
        (0..num).map(|j| length * eigen.eigenvectors[(j, i)] * sigmas[j]).collect()
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlated_values_move_together() {
        let found = axes(2, &[4.0, -2.0, -2.0, 1.0]);
        assert_eq!(found.len(), 1, "one direction only");
        assert!(
            (found[0][0].abs() - 2.0).abs() < 1e-9
                && (found[0][0] + 2.0 * found[0][1]).abs() < 1e-9
        );
    }
}
