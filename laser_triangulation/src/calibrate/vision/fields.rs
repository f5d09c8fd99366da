//! Checks that a board's fields are square, from its views alone.

use nalgebra::Matrix3;

use super::{
    board::Board,
    board_bend,
    board_shape::{BoardShape, ShapeTerm},
    camera::CameraViews,
    camera_error::CameraError,
    homography,
    joint_fit::{JointFit, Shared},
};
use crate::{
    scanner::camera::{Camera, Distortion},
    statistics::median,
};

/// Uncertainties by which the ratio of the sides must differ from 1.
const SIGNIFICANT: f64 = 5.0;
/// Least deviation of the ratio from 1 that is reported.
const MIN_OFF: f64 = 0.01;
/// Views whose corners lie this many times farther off than those of the median view do not take part.
const OUTLIER_FACTOR: f64 = 4.0;
/// Fields are printed in steps of these, the first more often, millimetres.
const ROUND_MM: [f64; 2] = [5.0, 1.0];

/// Fields that are not square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fields {
    /// Height of a field, along the target's rows, divided by its width.
    ratio: f64,
    /// One standard deviation of the ratio.
    sigma: f64,
    /// Root mean square distance of the corners from their projections, pixels.
    pub(super) rms_px: f64,
}

/// Returns the sides' ratio if it is not 1, for a camera with square pixels. `None` if fields may be square, or the views
/// leave it open.
pub(super) fn find(views: &CameraViews<'_>) -> Option<Fields> {
    let boards: Vec<_> = views.boards.iter().collect();
    let (camera, shape) = start(views, &boards)?;
    let first = fit(&boards, views.square_m, &camera, shape)?;
    let mut all_px = first.views_rms_px.clone();
    let limit_px = OUTLIER_FACTOR * median(&mut all_px)?;
    let kept = boards.iter().zip(&first.views_rms_px);
    let kept: Vec<_> = kept.filter(|(_, rms)| **rms <= limit_px).map(|(board, _)| *board).collect();
    let JointFit { state, covariance, rms_px, .. } =
        fit(&kept, views.square_m, &first.state.camera, first.state.shape)?;
    let last = covariance.nrows() - 1;
    let (ratio, sigma) = (1.0 + state.shape.stretch, covariance[(last, last)].sqrt());
    let off = (ratio - 1.0).abs();
    (off > MIN_OFF && off > SIGNIFICANT * sigma).then_some(Fields { ratio, sigma, rms_px })
}

fn fit(boards: &[&Board], square_m: f64, camera: &Camera, shape: BoardShape) -> Option<JointFit> {
    let camera_values = ["f", "cx", "cy", "k1"].map(str::to_owned).to_vec();
    let shared = Shared { camera: camera_values, shape: vec![ShapeTerm::Stretch] };
    board_bend::joint(boards, square_m, camera, shape, &shared)
}

/// Returns focal length and ratio without distortion, the principal point in the middle. With square pixels both sides
/// of a field have the same unit on the plane at infinity and are at right angles there (Zhang 2000, section 3.1).
fn start(views: &CameraViews<'_>, boards: &[&Board]) -> Option<(Camera, BoardShape)> {
    let unit_px = f64::from(views.width_px.max(views.height_px));
    let middle = [views.width_px, views.height_px].map(|size| f64::from(size - 1) / 2.0);
    let maps: Vec<_> = boards
        .iter()
        .filter_map(|board| {
            let pairs = board.flat(views.square_m).into_iter().map(|(flat, seen)| {
                let seen = [(seen.x - middle[0]) / unit_px, (seen.y - middle[1]) / unit_px];
                (flat, seen.into())
            });
            let map: Matrix3<f64> = homography::fit(&pairs.collect::<Vec<_>>())?;
            Some(map / map.fixed_view::<3, 2>(0, 0).norm())
        })
        .collect();
    let sums = maps.iter().fold((0.0, 0.0), |(up, down), map| {
        let in_plane = map[(0, 0)] * map[(0, 1)] + map[(1, 0)] * map[(1, 1)];
        (up - in_plane * map[(2, 0)] * map[(2, 1)], down + in_plane * in_plane)
    });
    // Views that leave the focal length open get that of a usual lens: the longer side.
    let inverse_square = Some(sums.0 / sums.1).filter(|w| (0.05..20.0).contains(w)).unwrap_or(1.0);
    let length = |map: &Matrix3<f64>, column: usize| {
        let at = |row: usize| map[(row, column)].powi(2);
        (inverse_square * (at(0) + at(1)) + at(2)).sqrt()
    };
    let mut ratios: Vec<_> = maps.iter().map(|map| length(map, 1) / length(map, 0)).collect();
    let ratio = median(&mut ratios)?;
    let focal_px = unit_px / inverse_square.sqrt();
    let camera = Camera {
        width_px: views.width_px,
        height_px: views.height_px,
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: middle[0],
        cy_px: middle[1],
        distortion: Distortion::PlumbBob { k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 },
        tilt_rad: [0.0; 2],
    };
    Some((camera, BoardShape { stretch: ratio - 1.0, ..BoardShape::default() }))
}

/// Returns the error that describes such fields.
pub(super) fn error(views: &CameraViews<'_>, fields: &Fields) -> CameraError {
    let [columns, rows] = board_bend::corners(views.boards.iter());
    let [width_mm, height_mm] = fields.likely_mm(views.square_m);
    CameraError::Rectangular {
        width_mm,
        height_mm,
        columns,
        rows,
        ratio: fields.ratio,
        sigma: fields.sigma,
        square_mm: 1e3 * views.square_m,
    }
}

impl Fields {
    /// Returns a usual size of such fields near that of a square, millimetres: pictures show the ratio alone.
    fn likely_mm(&self, square_m: f64) -> [f64; 2] {
        let told_mm = 1e3 * square_m;
        let misfit = |[width, height]: [f64; 2]| (height / width / self.ratio).ln().abs();
        let change = |[width, height]: [f64; 2]| ((width * height).sqrt() / told_mm).ln().abs();
        let usual = |step_mm: f64| {
            let most = (4.0 * told_mm / step_mm).min(400.0) as u32;
            let widths = (1..=most).map(|width| step_mm * f64::from(width));
            let sizes = widths
                .map(|width| [width, step_mm * (width * self.ratio / step_mm).round().max(1.0)]);
            let close = sizes.filter(|&size| {
                misfit(size) < 3.0 * self.sigma / self.ratio + 0.003 && change(size) < 0.25
            });
            close.min_by(|&a, &b| change(a).total_cmp(&change(b)))
        };
        ROUND_MM.into_iter().find_map(usual).unwrap_or([told_mm, told_mm * self.ratio])
    }
}
