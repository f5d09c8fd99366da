//! How a result follows the camera with which it was measured: it is computed again with cameras that are off by a standard
//! deviation.

use nalgebra::{Const, Dyn, OMatrix, SMatrix, SVector};

use crate::scanner::{
    calibration::{CameraQuality, axes},
    camera::Camera,
};

/// Parts of a standard deviation that are tried until the shifted camera sees all that was measured.
const PARTS: [f64; 3] = [1.0, 0.1, 0.01];

/// How `N` values follow the camera.
#[derive(Clone, Debug)]
pub(super) struct CameraResponse<const N: usize> {
    /// Their change for one unit of each of the camera's parameters.
    per_parameter: OMatrix<f64, Const<N>, Dyn>,
    /// The covariance that the camera's gives them.
    pub(super) covariance: SMatrix<f64, N, N>,
}

impl<const N: usize> CameraResponse<N> {
    /// Finds the response of values whose change `change` computes for a camera whose parameters are off by the given
    /// amounts. `None` if a camera within its uncertainty does not see all that was measured.
    ///
    /// The camera is shifted along the principal axes of its covariance: a single parameter that is off by its own
    /// standard deviation, without those that are correlated with it, would be no camera that its views allow.
    pub(super) fn find(
        camera: &Camera,
        quality: &CameraQuality,
        change: impl Fn(&Camera, &[f64]) -> Option<SVector<f64, N>>,
    ) -> Option<Self> {
        let num = quality.parameters.len();
        let variances: Vec<_> = (0..num).map(|at| quality.covariance[at * num + at]).collect();
        let mut per_parameter = OMatrix::<f64, Const<N>, Dyn>::zeros(num);
        let mut covariance = SMatrix::zeros();
        for axis in axes(num, &quality.covariance) {
            let response = central(|part| {
                let by: Vec<_> = axis.iter().map(|by| part * by).collect();
                let mut other = *camera;
                for (name, by) in quality.parameters.iter().zip(&by) {
                    *other.value_mut(name)? += by;
                }
                change(&other, &by)
            })?;
            covariance += response * response.transpose();
            // The axes are orthogonal once each parameter is scaled to its standard deviation.
            let share =
                |(by, variance): (&f64, &f64)| if *variance > 0.0 { by / variance } else { 0.0 };
            let shares: Vec<_> = axis.iter().zip(&variances).map(share).collect();
            let square: f64 = axis.iter().zip(&shares).map(|(by, share)| by * share).sum();
            for (mut column, share) in per_parameter.column_iter_mut().zip(&shares) {
                column += response * (share / square);
            }
        }
        Some(Self { per_parameter, covariance })
    }

    /// Returns the change for one unit of each parameter, row-major: `N` rows.
    pub(super) fn rows(&self) -> Vec<f64> {
        self.per_parameter.transpose().as_slice().to_vec()
    }
}

/// Returns the change for one standard deviation, from shifts by the same part of it both ways.
pub(super) fn central<const N: usize>(
    shifted: impl Fn(f64) -> Option<SVector<f64, N>>,
) -> Option<SVector<f64, N>> {
    let found =
        PARTS.into_iter().find_map(|part| Some((shifted(part)? - shifted(-part)?) / (2.0 * part)));
    found.filter(|change| change.iter().all(|value| value.is_finite()))
}
