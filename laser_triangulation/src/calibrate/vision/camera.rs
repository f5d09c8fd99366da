//! A camera from many views of a board, without outliers.

use nalgebra::{DMatrix, DVector};
use thiserror::Error;
use vision_calibration_core::{Uncertainty, UncertaintyUnavailable};
use vision_calibration_optim::RobustLoss;

use super::{
    board::Board,
    board_bend::{self, BoardBend},
    board_shape::BoardShape,
    bundle,
    camera_error::CameraError,
    circle_centres, fields,
    pose::{self, BoardPose},
    view_variety::{self, MissingViews},
};
use crate::{
    scanner::{
        calibration::{CalibratedVolume, CameraCalibration, CameraQuality},
        camera::Camera,
    },
    statistics::median,
};

/// A view is an outlier if its residual is this many times the median of all views.
const OUTLIER_FACTOR: f64 = 4.0;
/// Number of outlier rejection rounds.
const MAX_ROUNDS: usize = 4;
/// Times the camera is fitted again to the true centres of circles: each round leaves less than a hundredth of the last one's
/// error.
const CENTRE_ROUNDS: usize = 2;
/// Largest relative standard deviation of a focal length.
const MAX_FOCAL_SIGMA: f64 = 0.05;

/// The lens model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensModel {
    /// k1, k2, p1, p2, k3.
    PlumbBob,
    /// k1, k2, p1, p2, k3 to k6.
    RationalPolynomial,
    /// Fisheye: k1 to k4 of a polynomial in the angle from the optical axis (Kannala and Brandt 2006).
    Equidistant,
}

/// The views of a board from which a camera is calibrated.
#[derive(Clone, Copy, Debug)]
pub struct CameraViews<'a> {
    /// The boards.
    pub boards: &'a [Board],
    /// Columns of the images.
    pub width_px: u32,
    /// Rows of the images.
    pub height_px: u32,
    /// Side of the boards' squares, or pitch of their circles, metres.
    pub square_m: f64,
}

/// A view that was used.
#[derive(Clone, Debug)]
pub struct UsedView {
    /// Index into the boards.
    pub index: usize,
    /// Pose of the board, and the residual of every corner.
    pub pose: BoardPose,
}

/// A view that contradicts the others.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error(
    "corners lie {rms_px:.2} px from their projections, median of the views {median_px:.2} px: blurred, bent or moving"
)]
pub struct OutlierView {
    /// Index into the boards.
    pub index: usize,
    /// Root mean square of its residuals, pixels.
    pub rms_px: f64,
    /// Median of all views, pixels.
    pub median_px: f64,
}

/// The uncertainty of the parameters.
#[derive(Clone, Debug)]
pub struct CameraUncertainty {
    /// Names: `fx`, `fy`, `cx`, `cy`, `k1`, …
    pub parameters: Vec<String>,
    /// Covariance, in their order.
    pub covariance: DMatrix<f64>,
    /// Ratio of the variance estimated by leaving out whole views to the variance that the residuals alone explain. The
    /// covariance includes it.
    pub view_scatter: Option<f64>,
}

/// A calibrated camera.
#[derive(Clone, Debug)]
pub struct CameraFit {
    /// The camera.
    pub camera: Camera,
    /// Views that took part.
    pub used: Vec<UsedView>,
    /// Views that did not.
    pub outliers: Vec<OutlierView>,
    /// The board's bend, estimated with the camera; `None` if it is flat within the uncertainty. If the views do not
    /// agree on it, the camera is that of a flat board, and the covariance contains the difference.
    pub bend: Option<BoardBend>,
    /// Root mean square distance between corners seen and projected, pixels.
    pub rms_px: f64,
    /// Standard deviations and correlations.
    pub uncertainty: CameraUncertainty,
    /// Part of the image with corners of the boards that took part.
    pub volume: Option<CalibratedVolume>,
}

/// Fits the camera to the boards. Views that contradict the rest are left out and reported. The eccentricity of circles
/// seen in perspective is removed.
///
/// # Errors
/// Views that do not determine a camera, or contradict one another; a board without square fields.
pub fn calibrate_camera(
    views: &CameraViews<'_>,
    model: LensModel,
) -> Result<CameraFit, CameraError> {
    let mut fit = calibrate_from_points(views, model)?;
    if views.boards.iter().any(|board| board.circle_radius.is_some()) {
        for _ in 0..CENTRE_ROUNDS {
            let boards =
                circle_centres::with_true_centres(&fit.camera, views.boards, views.square_m);
            fit = calibrate_from_points(&CameraViews { boards: &boards, ..*views }, model)?;
        }
    }
    Ok(fit)
}

fn calibrate_from_points(
    views: &CameraViews<'_>,
    model: LensModel,
) -> Result<CameraFit, CameraError> {
    let found = calibrate_with_squares(views, model);
    if matches!(found, Err(CameraError::Missing(MissingViews::Views { .. }))) {
        return found;
    }
    let rms_px = found.as_ref().map_or(f64::INFINITY, |fit| fit.rms_px);
    match fields::find(views) {
        Some(seen) if seen.rms_px < rms_px => Err(fields::error(views, &seen)),
        _ => found,
    }
}

fn calibrate_with_squares(
    views: &CameraViews<'_>,
    model: LensModel,
) -> Result<CameraFit, CameraError> {
    let mut kept: Vec<usize> = (0..views.boards.len()).collect();
    let mut outliers = Vec::new();
    let check = |kept: &[usize]| {
        let boards: Vec<_> = kept.iter().map(|&index| &views.boards[index]).collect();
        view_variety::check_views(&boards, views.width_px, views.height_px)
    };
    check(&kept)?;
    // Outliers must not bias the fit that is used to detect them.
    let mut solved = solve(views, &kept, model, RobustLoss::Cauchy { scale: 0.5 })?;
    for round in 0..MAX_ROUNDS {
        let found = find_outliers(&solved.used);
        if round > 0 && found.is_empty() {
            break;
        }
        kept.retain(|index| !found.iter().any(|outlier| outlier.index == *index));
        outliers.extend(found);
        check(&kept)?;
        solved = solve(views, &kept, model, RobustLoss::None)?;
    }
    let fit = with_bend(views, finish(solved, outliers)?)?;
    let corners = fit.used.iter().flat_map(|view| &views.boards[view.index].corners);
    let volume = CalibratedVolume::of_positions(corners.map(|corner| corner.seen));
    Ok(CameraFit { volume, ..fit })
}

struct Solved {
    camera: Camera,
    used: Vec<UsedView>,
    uncertainty: Uncertainty,
}

fn solve(
    views: &CameraViews<'_>,
    kept: &[usize],
    model: LensModel,
    loss: RobustLoss,
) -> Result<Solved, CameraError> {
    let (camera, uncertainty) = bundle::adjust(views, kept, model, loss)?;
    let used = posed(views, kept, &camera, &BoardShape::default());
    Ok(Solved { camera, used, uncertainty })
}

fn finish(solved: Solved, mut outliers: Vec<OutlierView>) -> Result<CameraFit, CameraError> {
    let Solved { camera, used, uncertainty } = solved;
    let normals: Vec<_> = used.iter().map(|view| view.pose.normal()).collect();
    view_variety::check_tilts(&normals)?;
    let uncertainty = checked(&uncertainty, &camera)?;
    outliers.sort_by_key(|outlier| outlier.index);
    let rms_px = rms_px(&used);
    Ok(CameraFit { camera, used, outliers, bend: None, rms_px, uncertainty, volume: None })
}

/// Estimates the board's bend with the camera. A flat board changes nothing.
fn with_bend(views: &CameraViews<'_>, fit: CameraFit) -> Result<CameraFit, CameraError> {
    let boards: Vec<_> = fit.used.iter().map(|view| &views.boards[view.index]).collect();
    let parameters = fit.uncertainty.parameters.clone();
    let found = board_bend::find(&boards, views.square_m, &fit.camera, &parameters);
    let Some((bend, joint)) = found else { return Ok(fit) };
    let camera = joint.state.camera;
    if !bend.is_shared {
        let uncertainty = with_difference(&fit.uncertainty, fit.camera, camera);
        return Ok(CameraFit { bend: Some(bend), uncertainty, ..fit });
    }
    let count = parameters.len();
    let uncertainty = CameraUncertainty {
        parameters,
        covariance: joint.covariance.view((0, 0), (count, count)).into_owned(),
        view_scatter: Some(joint.view_scatter),
    };
    check_sigmas(&uncertainty, &camera)?;
    let kept: Vec<_> = fit.used.iter().map(|view| view.index).collect();
    let used = posed(views, &kept, &camera, &bend.shape);
    let rms_px = rms_px(&used);
    Ok(CameraFit { camera, used, bend: Some(bend), rms_px, uncertainty, ..fit })
}

/// Adds the difference between two cameras to the covariance.
fn with_difference(
    uncertainty: &CameraUncertainty,
    mut camera: Camera,
    mut other: Camera,
) -> CameraUncertainty {
    let mut value = |name: &String| {
        camera.value_mut(name).zip(other.value_mut(name)).map_or(0.0, |(a, b)| *a - *b)
    };
    let off = DVector::from_iterator(
        uncertainty.parameters.len(),
        uncertainty.parameters.iter().map(&mut value),
    );
    let covariance = &uncertainty.covariance + &off * off.transpose();
    CameraUncertainty { covariance, ..uncertainty.clone() }
}

fn rms_px(used: &[UsedView]) -> f64 {
    let residuals = || used.iter().flat_map(|view| &view.pose.residuals_px);
    let sum: f64 = residuals().map(|(u, v)| u * u + v * v).sum();
    (sum / residuals().count() as f64).sqrt()
}

/// Returns the boards' poses under a camera, without boards that it cannot see.
fn posed(
    views: &CameraViews<'_>,
    kept: &[usize],
    camera: &Camera,
    shape: &BoardShape,
) -> Vec<UsedView> {
    let used = kept.iter().filter_map(|&index| {
        let pose = pose::fit(camera, &views.boards[index].points(views.square_m, shape))?;
        Some(UsedView { index, pose })
    });
    used.collect()
}

fn find_outliers(used: &[UsedView]) -> Vec<OutlierView> {
    let mut all_px: Vec<_> = used.iter().map(|view| view.pose.rms_px()).collect();
    let Some(median_px) = median(&mut all_px) else { return Vec::new() };
    let outlier = |view: &UsedView| {
        let rms_px = view.pose.rms_px();
        (rms_px > OUTLIER_FACTOR * median_px && rms_px > 1e-6).then_some(OutlierView {
            index: view.index,
            rms_px,
            median_px,
        })
    };
    used.iter().filter_map(outlier).collect()
}

/// Returns the names of the parameters that a solution without uncertainty leaves open.
fn undetermined(found: &Uncertainty) -> String {
    match found {
        Uncertainty::Unavailable {
            reason: UncertaintyUnavailable::RankDeficient { unobservable },
        } => unobservable.join(", "),
        Uncertainty::Unavailable { reason: UncertaintyUnavailable::AtBound { labels } } => {
            labels.join(", ")
        }
        _ => "the camera".to_owned(),
    }
}

fn checked(found: &Uncertainty, camera: &Camera) -> Result<CameraUncertainty, CameraError> {
    let Uncertainty::Available(found) = found else {
        return Err(CameraError::Vague { parameters: undetermined(found) });
    };
    let size = found.labels.len();
    let covariance = DMatrix::from_fn(size, size, |i, j| found.covariance[i][j]);
    let (parameters, view_scatter) = (found.labels.clone(), found.view_scatter);
    let uncertainty = CameraUncertainty { parameters, covariance, view_scatter };
    check_sigmas(&uncertainty, camera)?;
    Ok(uncertainty)
}

fn check_sigmas(uncertainty: &CameraUncertainty, camera: &Camera) -> Result<(), CameraError> {
    let limits = [
        ("fx", MAX_FOCAL_SIGMA * camera.fx_px),
        ("fy", MAX_FOCAL_SIGMA * camera.fy_px),
        ("cx", MAX_FOCAL_SIGMA * f64::from(camera.width_px)),
        ("cy", MAX_FOCAL_SIGMA * f64::from(camera.height_px)),
    ];
    let vague: Vec<_> = limits
        .iter()
        .filter_map(|&(name, limit)| {
            let sigma = uncertainty.sigma(name)?;
            (sigma > limit).then(|| format!("{name} (standard deviation {sigma:.1} px)"))
        })
        .collect();
    if vague.is_empty() {
        return Ok(());
    }
    Err(CameraError::Vague { parameters: vague.join(", ") })
}

impl CameraFit {
    /// Returns the name and value of every parameter, in the order of the calibration file.
    #[must_use]
    pub fn parameters(&self) -> Vec<(&'static str, f64)> {
        let camera = &self.camera;
        let pinhole = [
            ("fx", camera.fx_px),
            ("fy", camera.fy_px),
            ("cx", camera.cx_px),
            ("cy", camera.cy_px),
        ];
        let names = camera.distortion.coefficient_names().iter().copied();
        pinhole.into_iter().chain(names.zip(camera.distortion.coefficients())).collect()
    }

    /// Returns the views, of so many, that are neither used nor outliers: the camera cannot see all of their corners.
    #[must_use]
    pub fn unseen(&self, num_views: usize) -> Vec<usize> {
        let is_used = |index: &usize| self.used.iter().any(|view| view.index == *index);
        let is_outlier = |index: &usize| self.outliers.iter().any(|view| view.index == *index);
        (0..num_views).filter(|index| !is_used(index) && !is_outlier(index)).collect()
    }

    /// Returns the radial coefficients whose standard deviation exceeds their value: the views do not determine them.
    #[must_use]
    pub fn undetermined(&self) -> Vec<&'static str> {
        let is_lost = |(name, value): &(&str, f64)| {
            let sigma = self.uncertainty.sigma(name);
            name.starts_with('k') && sigma.is_none_or(|sigma| sigma > value.abs())
        };
        self.parameters().into_iter().filter(is_lost).map(|(name, _)| name).collect()
    }

    /// Returns the calibration of the camera alone, without a date. `views_rejected` counts all views that were not used.
    #[must_use]
    pub fn calibration(&self, camera_name: &str, views_rejected: usize) -> CameraCalibration {
        CameraCalibration {
            camera_name: camera_name.to_owned(),
            camera: self.camera,
            quality: Some(CameraQuality {
                rms_px: self.rms_px,
                views_used: self.used.len() as u32,
                views_rejected: views_rejected as u32,
                parameters: self.uncertainty.parameters.clone(),
                // Symmetric: by columns is by rows.
                covariance: self.uncertainty.covariance.as_slice().to_vec(),
                volume: self.volume,
            }),
            calibrated_at: None,
        }
    }
}

impl CameraUncertainty {
    /// Returns the standard deviation of a parameter, in its own unit.
    pub fn sigma(&self, parameter: &str) -> Option<f64> {
        let at = self.parameters.iter().position(|name| name == parameter)?;
        Some(self.covariance[(at, at)].sqrt())
    }
}
