//! Where the fit of a fisheye lens starts: the best of some focal lengths, without coefficients.

use super::{board_shape::BoardShape, camera::CameraViews, pose};
use crate::scanner::camera::{Camera, Distortion};

/// Focal lengths that are tried, of the longer side of the image: from a view of 180 degrees to one of 40 degrees.
const FOCAL_LENGTHS: [f64; 9] = [0.27, 0.32, 0.38, 0.45, 0.55, 0.67, 0.82, 1.05, 1.4];
/// Views that are tried.
const MAX_VIEWS: usize = 16;

/// Returns the fisheye lens, with coefficients 0, that explains the boards best. `None` if none does.
pub(super) fn guess(views: &CameraViews<'_>, kept: &[usize]) -> Option<Camera> {
    let every = kept.len().div_ceil(MAX_VIEWS).max(1);
    let tried: Vec<_> = kept.iter().step_by(every).map(|&index| &views.boards[index]).collect();
    let squares = |camera: &Camera| {
        let square = |board: &&super::board::Board| {
            let pose = pose::fit(camera, &board.points(views.square_m, &BoardShape::default()))?;
            Some(pose.rms_px().powi(2))
        };
        tried.iter().map(square).sum::<Option<f64>>()
    };
    let cameras = FOCAL_LENGTHS.map(|share| equidistant(views, share));
    let found = cameras.iter().filter_map(|camera| Some((squares(camera)?, *camera)));
    found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, camera)| camera)
}

fn equidistant(views: &CameraViews<'_>, share: f64) -> Camera {
    let &CameraViews { width_px, height_px, .. } = views;
    let focal_px = share * f64::from(width_px.max(height_px));
    Camera {
        width_px,
        height_px,
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: f64::from(width_px - 1) / 2.0,
        cy_px: f64::from(height_px - 1) / 2.0,
        distortion: Distortion::Equidistant { k1: 0.0, k2: 0.0, k3: 0.0, k4: 0.0 },
        tilt_rad: [0.0; 2],
    }
}
