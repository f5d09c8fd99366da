//! Bundle adjustment of one camera: Zhang's closed form, or the best of some fisheye lenses, then all corners of all views at once (Zhang 2000, sections 3.1
//! to 3.3), by `vision-calibration`.

use vision_calibration_core::{
    BrownConrady5, CameraFix, CameraParams, CorrespondenceView, DistortionParams, Error, FxFyCxCy,
    KannalaBrandt4, NoMeta, PlanarDataset, ProjectionParams, Pt2, Pt3, RationalPolynomial,
    SensorParams, Uncertainty, View, pinhole_camera_params,
};
use vision_calibration_linear::prelude::{
    IterativeIntrinsicsOptions, dlt_homography, estimate_intrinsics_iterative,
    estimate_planar_pose_from_h,
};
use vision_calibration_optim::{
    BackendSolveOptions, PlanarIntrinsicsParams, PlanarIntrinsicsSolveOptions, RobustLoss,
    SolverBackend, optimize_planar_intrinsics,
};

use super::{
    board::Board,
    camera::{CameraViews, LensModel},
    camera_error::CameraError,
    fisheye_start,
};
use crate::scanner::camera::{Camera, DistortedPixel, Distortion};

/// Fits the camera to the selected views, with the uncertainty of its parameters.
///
/// # Errors
/// Equations without a solution, or a solution that is no valid camera.
pub(super) fn adjust(
    views: &CameraViews<'_>,
    kept: &[usize],
    model: LensModel,
    robust_loss: RobustLoss,
) -> Result<(Camera, Uncertainty), CameraError> {
    let unsolved = |error: &dyn std::fmt::Display| CameraError::Unsolved(error.to_string());
    let data = kept.iter().map(|&index| view(&views.boards[index], views.square_m));
    let data: Result<Vec<_>, _> = data.collect();
    let data = data.and_then(PlanarDataset::new).map_err(|error| unsolved(&error))?;
    let start = match model {
        LensModel::Equidistant => fisheye(views, kept),
        _ => start(views, &data, model),
    };
    let start = start.map_err(|error| unsolved(&error))?;
    let options = PlanarIntrinsicsSolveOptions {
        robust_loss,
        // No parameter is fixed, not even k3.
        fix: CameraFix::none(),
        ..PlanarIntrinsicsSolveOptions::default()
    };
    let backend =
        BackendSolveOptions { backend: SolverBackend::Factrs, ..BackendSolveOptions::default() };
    let found = optimize_planar_intrinsics(&data, &start, options, backend)
        .map_err(|error| unsolved(&error))?;
    Ok((camera(views, &found.params.camera)?, found.uncertainty))
}

fn view(board: &Board, square_m: f64) -> Result<View<NoMeta>, Error> {
    let pairs = board.pairs(square_m);
    let on_board = pairs.iter().map(|(on_board, _)| Pt3::new(on_board.x, on_board.y, 0.0));
    let seen = pairs.iter().map(|(_, seen)| Pt2::new(seen.x, seen.y));
    CorrespondenceView::new(on_board.collect(), seen.collect()).map(View::without_meta)
}

/// Returns an initial guess: Zhang's closed form, poses from homographies.
fn start(
    views: &CameraViews<'_>,
    data: &PlanarDataset,
    model: LensModel,
) -> Result<PlanarIntrinsicsParams, Box<dyn std::error::Error>> {
    let found = estimate_intrinsics_iterative(data, IterativeIntrinsicsOptions::default());
    let mut camera = match found {
        Ok(pinhole) => pinhole_camera_params(&pinhole),
        // The adjustment also converges from a rough guess: a focal length equal to the longer side.
        Err(_) => guess(views),
    };
    let k = camera.intrinsics.k_matrix();
    let mut poses = Vec::with_capacity(data.views.len());
    for view in &data.views {
        let plane: Vec<_> = view.obs.points_3d.iter().map(|p| Pt2::new(p.x, p.y)).collect();
        let map = dlt_homography(&plane, &view.obs.points_2d)?;
        poses.push(estimate_planar_pose_from_h(&k, &map)?);
    }
    if model == LensModel::RationalPolynomial {
        camera.distortion = rational(&camera.distortion);
    }
    Ok(PlanarIntrinsicsParams::new(camera, poses)?)
}

/// Returns an initial guess of a fisheye lens: the best of some focal lengths, poses from homographies of rays.
fn fisheye(
    views: &CameraViews<'_>,
    kept: &[usize],
) -> Result<PlanarIntrinsicsParams, Box<dyn std::error::Error>> {
    let guess = fisheye_start::guess(views, kept).ok_or("no fisheye lens shows all of them")?;
    let pinhole = FxFyCxCy { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 }.k_matrix();
    let mut poses = Vec::with_capacity(kept.len());
    for &index in kept {
        let pairs = views.boards[index].pairs(views.square_m);
        let plane: Vec<_> = pairs.iter().map(|(on, _)| Pt2::new(on.x, on.y)).collect();
        let ray = |(_, seen): &(_, _)| guess.ray(DistortedPixel(*seen));
        let rays = pairs.iter().map(|pair| ray(pair).map(|ray| Pt2::new(ray.x, ray.y)));
        let rays: Option<Vec<_>> = rays.collect();
        let rays = rays.ok_or("a board lies beyond the view of a fisheye lens")?;
        poses.push(estimate_planar_pose_from_h(&pinhole, &dlt_homography(&plane, &rays)?)?);
    }
    let params = KannalaBrandt4 { k1: 0.0, k2: 0.0, k3: 0.0, k4: 0.0, iters: 0 };
    let Camera { fx_px: fx, fy_px: fy, cx_px: cx, cy_px: cy, .. } = guess;
    let camera = CameraParams {
        projection: ProjectionParams::Equidistant,
        distortion: DistortionParams::KannalaBrandt4 { params },
        sensor: SensorParams::Identity,
        intrinsics: FxFyCxCy { fx, fy, cx, cy },
    };
    Ok(PlanarIntrinsicsParams::new(camera, poses)?)
}

fn guess(views: &CameraViews<'_>) -> CameraParams {
    let long_side = f64::from(views.width_px.max(views.height_px));
    CameraParams {
        projection: ProjectionParams::Pinhole,
        distortion: DistortionParams::BrownConrady5 { params: BrownConrady5::default() },
        sensor: SensorParams::Identity,
        intrinsics: FxFyCxCy {
            fx: long_side,
            fy: long_side,
            cx: f64::from(views.width_px - 1) / 2.0,
            cy: f64::from(views.height_px - 1) / 2.0,
        },
    }
}

/// Returns the same lens in the other model, with denominator 1.
fn rational(distortion: &DistortionParams) -> DistortionParams {
    let mut params = RationalPolynomial::default();
    if let DistortionParams::BrownConrady5 { params: brown } = distortion {
        (params.k1, params.k2, params.k3) = (brown.k1, brown.k2, brown.k3);
        (params.p1, params.p2) = (brown.p1, brown.p2);
    }
    DistortionParams::Rational { params }
}

fn camera(views: &CameraViews<'_>, params: &CameraParams) -> Result<Camera, CameraError> {
    let distortion = match &params.distortion {
        DistortionParams::BrownConrady5 { params: b } => {
            Distortion::PlumbBob { k1: b.k1, k2: b.k2, p1: b.p1, p2: b.p2, k3: b.k3 }
        }
        DistortionParams::Rational { params: r } => Distortion::RationalPolynomial {
            k1: r.k1,
            k2: r.k2,
            p1: r.p1,
            p2: r.p2,
            k3: r.k3,
            k4: r.k4,
            k5: r.k5,
            k6: r.k6,
        },
        DistortionParams::KannalaBrandt4 { params: f } => {
            Distortion::Equidistant { k1: f.k1, k2: f.k2, k3: f.k3, k4: f.k4 }
        }
        _ => return Err(CameraError::Unsolved("another lens came back".to_owned())),
    };
    let FxFyCxCy { fx, fy, cx, cy } = params.intrinsics;
    let camera = Camera {
        width_px: views.width_px,
        height_px: views.height_px,
        fx_px: fx,
        fy_px: fy,
        cx_px: cx,
        cy_px: cy,
        distortion,
        tilt_rad: [0.0; 2],
    };
    let is_sound = [fx, fy].iter().all(|f| f.is_finite() && *f > 1.0)
        && [cx, cy].iter().all(|c| c.is_finite());
    if !is_sound {
        let reason = format!("the focal lengths became {fx:.3} and {fy:.3} px");
        return Err(CameraError::Unsolved(reason));
    }
    Ok(camera)
}
