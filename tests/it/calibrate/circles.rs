//! Camera and plane from rendered grids of circles: symmetric, asymmetric, light on dark, partly visible, and wrong ones.

use image::RgbImage;
use laser_profiler::{
    calibrate::{Board, CameraViews, LensModel, calibrate_camera, with_true_centres},
    scanner::camera::DistortedPixel,
};
use nalgebra::{Isometry3, Point2, Point3};
use tempfile::TempDir;

use super::{
    assert_holds, calibrate, found_in, number, off_plane, refused,
    render::{self, Renderer, Surface, VIEWS, blurred, pose_of, save},
    rendered_plane,
};

/// Circles with the first centre at (0, 0), on a plate that ends 1.5 pitches beyond the outer centres.
#[derive(Clone, Copy)]
pub(super) struct Circles {
    columns: u32,
    rows: u32,
    pitch_m: f64,
    radius_m: f64,
    is_asymmetric: bool,
    is_light: bool,
}

pub(super) const SYMMETRIC: Circles = Circles {
    columns: 8,
    rows: 6,
    pitch_m: 0.028,
    radius_m: 0.009,
    is_asymmetric: false,
    is_light: false,
};
pub(super) const ASYMMETRIC: Circles = Circles {
    columns: 4,
    rows: 11,
    pitch_m: 0.018,
    radius_m: 0.0085,
    is_asymmetric: true,
    is_light: false,
};
const GRIDS: [Circles; 4] = [
    SYMMETRIC,
    Circles { is_light: true, ..SYMMETRIC },
    ASYMMETRIC,
    Circles { radius_m: 0.0115, ..SYMMETRIC },
];

/// Grids near two corners of the image.
const NEAR_CORNERS: [[[f64; 3]; 2]; 2] =
    [[[-0.09, -0.07, 0.42], [12.0, 30.0, 4.0]], [[0.1, 0.07, 0.42], [-30.0, -10.0, 0.0]]];

fn views() -> impl Iterator<Item = [[f64; 3]; 2]> {
    VIEWS.into_iter().chain(NEAR_CORNERS)
}

impl Circles {
    fn span(&self) -> [u32; 2] {
        [if self.is_asymmetric { 2 * self.columns } else { self.columns }, self.rows]
    }

    fn centres(&self) -> Vec<Point3<f64>> {
        let [columns, rows] = self.span();
        let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        let is_one = |(column, row): &(u32, u32)| !self.is_asymmetric || (column + row) % 2 == 0;
        let at = |(column, row)| Point3::new(f64::from(column), f64::from(row), 0.0) * self.pitch_m;
        all.filter(is_one).map(at).collect()
    }

    pub(super) fn target(&self) -> String {
        let name = if self.is_asymmetric { "asymmetric-circles" } else { "circles" };
        format!("{name}:{}x{}:{}", self.columns, self.rows, self.pitch_m)
    }

    pub(super) fn pose(&self, middle_m: [f64; 3], turned_deg: [f64; 3]) -> Isometry3<f64> {
        let half = self.span().map(|side| f64::from(side - 1) * self.pitch_m / 2.0);
        pose_of(half, middle_m, turned_deg)
    }

    fn render(&self, renderer: &Renderer, [middle, turned]: [[f64; 3]; 2]) -> RgbImage {
        renderer.render(self, &self.pose(middle, turned), None)
    }
}

impl Surface for Circles {
    fn albedo(&self, x: f64, y: f64) -> Option<f64> {
        let [x, y] = [x / self.pitch_m, y / self.pitch_m];
        let [columns, rows] = self.span().map(f64::from);
        let is_near = |at: f64, count: f64| (-1.5..count + 0.5).contains(&at);
        if !is_near(x, columns) || !is_near(y, rows) {
            return None;
        }
        // Of the four places around, the centres of circles.
        let is_in = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].iter().any(|(i, j)| {
            let (column, row) = (x.floor() + i, y.floor() + j);
            let is_place = (0.0..columns).contains(&column) && (0.0..rows).contains(&row);
            let is_one = !self.is_asymmetric || (column + row).rem_euclid(2.0) < 0.5;
            is_place && is_one && (x - column).hypot(y - row) * self.pitch_m < self.radius_m
        });
        Some(if is_in == self.is_light { 0.85 } else { 0.08 })
    }
}

/// Every point found is the picture of a centre of its own; returns their root mean square distance, pixels.
fn rms_px(grid: &Circles, pose: &Isometry3<f64>, board: &Board) -> f64 {
    let centres = grid.centres().into_iter().map(|at| render::camera().project(pose * at).unwrap());
    let mut centres: Vec<Point2<f64>> = centres.map(|DistortedPixel(at)| at).collect();
    let nearest = |corner: &laser_profiler::calibrate::Corner| {
        let off = |at: &Point2<f64>| (at - corner.seen).norm_squared();
        let at = (0..centres.len()).min_by(|&a, &b| off(&centres[a]).total_cmp(&off(&centres[b])));
        let square = off(&centres[at.unwrap()]);
        centres.swap_remove(at.unwrap());
        square
    };
    let squares: f64 = board.corners.iter().map(nearest).sum();
    (squares / board.corners.len() as f64).sqrt()
}

#[test]
fn the_centres_are_found_whatever_the_grid_and_the_view() {
    let renderer = Renderer::new();
    for grid in GRIDS {
        for (view, is_whole) in [
            ([[0.0, 0.0, 0.45], [35.0, 10.0, 0.0]], true),
            ([[0.02, 0.0, 0.5], [-20.0, -40.0, 30.0]], true),
            ([[0.15, 0.05, 0.42], [0.0, -25.0, 10.0]], false),
            ([[0.0, 0.0, 0.62], [20.0, 0.0, 100.0]], true),
        ] {
            let [middle, turned] = view;
            let picture = grid.render(&renderer, view);
            let target = grid.target();
            for (picture, limit_px) in
                [(blurred(&picture, 1.2, 4.0, 7), 0.12), (picture.clone(), 0.05)]
            {
                let found = found_in(&picture, &target);
                let found = found.unwrap_or_else(|error| panic!("{target} {view:?}: {error}"));
                let pose = grid.pose(middle, turned);
                let exact = with_true_centres(&render::camera(), &[found], grid.pitch_m);
                let rms_px = rms_px(&grid, &pose, &exact[0]);
                eprintln!("{target} {view:?}: {} circles, {rms_px:.3} px", exact[0].corners.len());
                assert!(rms_px < limit_px, "{target} {view:?}: {rms_px} px");
                assert_eq!(exact[0].corners.len() == grid.centres().len(), is_whole, "{view:?}");
                let radius = exact[0].circle_radius.unwrap() * grid.pitch_m / grid.radius_m;
                assert!((radius - 1.0).abs() < 0.05, "{target} {view:?}: {radius}");
            }
        }
    }
}

fn rendered(grid: &Circles) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let renderer = Renderer::new();
    for (i, view) in views().enumerate() {
        let picture = blurred(&grid.render(&renderer, view), 0.6, 1.0, i as u64);
        save(&picture, directory.path(), &format!("view_{i:02}.png"));
    }
    directory
}

#[test]
fn a_rendered_camera_is_found_again() {
    for grid in GRIDS {
        let pictures = rendered(&grid);
        let (output, target) = (pictures.path().join("camera.yaml"), grid.target());
        let found = calibrate(&["camera", "--target", &target], pictures.path(), &output);
        assert_eq!(found["views_used"], 14, "{found}");
        assert!(number(&found, "rms_px") < 0.05, "{found}");
        assert_holds(&found, &render::camera(), 0.6);
    }
}

/// The centroid of a circle's picture is not the picture of its centre: without the correction the fit is worse.
#[test]
fn the_eccentricity_matters() {
    let grid = GRIDS[3];
    let renderer = Renderer::new();
    let detect = |view| found_in(&grid.render(&renderer, view), &grid.target()).unwrap();
    let found: Vec<Board> = views().map(detect).collect();
    let (width_px, height_px) = (render::camera().width_px, render::camera().height_px);
    let fit = |boards: &[Board]| {
        let views = CameraViews { boards, width_px, height_px, square_m: grid.pitch_m };
        calibrate_camera(&views, LensModel::PlumbBob).unwrap()
    };
    let without_radius = |board: &Board| Board { circle_radius: None, ..board.clone() };
    let plain: Vec<Board> = found.iter().map(without_radius).collect();
    let (with, without) = (fit(&found), fit(&plain));
    let off = |fx_px: f64| (fx_px - render::camera().fx_px).abs();
    eprintln!("{:.3} px RMS, fx off by {:.3} px", with.rms_px, off(with.camera.fx_px));
    eprintln!(
        "without {:.3} px RMS, fx off by {:.3} px",
        without.rms_px,
        off(without.camera.fx_px)
    );
    assert!(off(with.camera.fx_px) < 0.5 * off(without.camera.fx_px));
}

#[test]
fn a_rendered_plane_is_found_again() {
    let poses = views().map(|[[x, y, z], turned]| {
        SYMMETRIC.pose([0.3 * x, 0.3 * y, z + 0.03], turned.map(|angle| 0.6 * angle))
    });
    let found = rendered_plane(&SYMMETRIC, poses, &SYMMETRIC.target());
    let [off_deg, off_m] = off_plane(&found);
    assert!(off_deg < 0.1 && number(&found, "boards_used") >= 8.0, "{off_deg} degrees: {found}");
    assert!(off_m < 3.0 * number(&found["uncertainties"], "distance_m"), "{off_m} m: {found}");
}

#[test]
fn wrong_grids_are_named() {
    let renderer = Renderer::new();
    let view = [[0.0, 0.0, 0.45], [10.0, 15.0, 0.0]];
    let with = |picture: &RgbImage, target: &str, wanted: &str| {
        let error = found_in(picture, target).unwrap_err();
        assert!(error.contains(wanted), "{target}: {wanted:?} in {error}");
    };
    let symmetric = SYMMETRIC.render(&renderer, view);
    with(&symmetric, "circles:7x6:0.028", "8 x 6 circles, the target is circles:7x6:0.028");
    with(&symmetric, "asymmetric-circles:4x11:0.018", "a symmetric grid of");
    with(&symmetric, "checkerboard:8x6:0.028", "a symmetric grid of");
    with(&symmetric, "charuco:8x6:0.028:0.02", "no board");
    let asymmetric = ASYMMETRIC.render(&renderer, view);
    with(&asymmetric, "circles:8x6:0.028", "an asymmetric grid of 4 x 11 circles");
    let plain = render::Checkerboard { columns: 8, rows: 5, square_m: 0.03 };
    let plain = renderer.render(&plain, &render::pose(&plain, view[0], view[1]), None);
    with(&plain, "circles:8x6:0.028", "this looks like a checkerboard: 40 corners");
    with(&plain, "asymmetric-circles:4x11:0.018", "this looks like a checkerboard");
    with(&RgbImage::new(480, 360), "circles:8x6:0.028", "no grid of circles");
}

#[test]
fn a_grid_smaller_than_the_target_is_refused() {
    let pictures = rendered(&SYMMETRIC);
    let output = pictures.path().join("camera.yaml");
    let with = |target: &str, reported: &[&str]| {
        refused(&["camera", "--target", target], pictures.path(), &output, reported);
    };
    with("circles:9x6:0.028", &["no picture shows the whole board", "48 of 54 circles"]);
    with("circles:7x6:0.028", &["no picture shows the board", "the target is circles:7x6:0.028"]);
    with("circles:8x6", &["asymmetric-circles:4x11:0.020"]);
}
