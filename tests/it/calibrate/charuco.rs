//! Camera and plane from rendered `ChArUco` boards: partly visible, in both layouts, and wrong ones.

use image::RgbImage;
use laser_profiler::{calibrate::Board, scanner::camera::DistortedPixel};
use nalgebra::{Isometry3, Point3};
use tempfile::TempDir;

use super::{
    assert_holds, calibrate, found_in, number, off_plane, refused,
    render::{self, Renderer, Surface, blurred, pose_of, save},
    rendered_plane,
};

/// Markers 0 to 23 of `DICT_4X4_50`, their bits row by row, 1 is white (OpenCV's `predefined_dictionaries.hpp`).
const MARKERS: [u16; 24] = [
    0xb532, 0x0f9a, 0x332d, 0x9946, 0x549e, 0x79cd, 0x9e2e, 0xc4f2, 0xfeda, 0xcf56, 0xf991, 0x11a7,
    0x0eb7, 0x2a0f, 0x24b1, 0x263e, 0x4665, 0x6600, 0x6c5e, 0x76af, 0x868b, 0xb02b, 0xccd5, 0xdd82,
];
const SQUARE_M: f64 = 0.03;
const MARKER_M: f64 = 0.0225;

/// OpenCV's board with its first inner corner at (0, 0), and half a square of white around it.
#[derive(Clone, Copy)]
pub(super) struct Charuco {
    columns: u32,
    rows: u32,
    /// True if the first square is white, as in old boards with an even number of rows.
    is_legacy: bool,
    /// Hides everything beyond this x.
    hidden_from_m: f64,
}

const BOARD: Charuco =
    Charuco { columns: 8, rows: 6, is_legacy: false, hidden_from_m: f64::INFINITY };
/// The same with its right part hidden.
pub(super) const PARTLY_HIDDEN: Charuco = Charuco { hidden_from_m: 0.125, ..BOARD };
pub(super) const TARGET: &str = "charuco:8x6:0.03:0.0225:4x4_50";

impl Surface for Charuco {
    fn albedo(&self, x: f64, y: f64) -> Option<f64> {
        let (x, y) = (x / SQUARE_M + 1.0, y / SQUARE_M + 1.0);
        let (columns, rows) = (f64::from(self.columns), f64::from(self.rows));
        let is_near = |at: f64, count: f64| (-0.5..count + 0.5).contains(&at);
        if !is_near(x, columns) || !is_near(y, rows) {
            return None;
        }
        if (x - 1.0) * SQUARE_M > self.hidden_from_m {
            return Some(0.4);
        }
        let is_inside = (0.0..columns).contains(&x) && (0.0..rows).contains(&y);
        let has_marker = |x: f64, y: f64| ((x + y).rem_euclid(2.0) < 0.5) == self.is_legacy;
        if !is_inside || !has_marker(x.floor(), y.floor()) {
            return Some(if is_inside { 0.08 } else { 0.85 });
        }
        let before =
            (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (row, column)));
        let before = before.filter(|&(row, column)| has_marker(column.into(), row.into()));
        let id = before.take_while(|&at| at < (y as u32, x as u32)).count();
        // Cells of the marker, a black one all round.
        let cell = |at: f64| ((at.fract() - 0.5) * SQUARE_M / MARKER_M + 0.5) * 6.0;
        let (column, row) = (cell(x).floor(), cell(y).floor());
        if !(0.0..6.0).contains(&column) || !(0.0..6.0).contains(&row) {
            return Some(0.85);
        }
        let inner = (1.0..5.0).contains(&column) && (1.0..5.0).contains(&row);
        let bit = (4.0 * (row - 1.0) + column - 1.0) as u32;
        let is_white = inner && MARKERS[id] & (0x8000_u16 >> bit.min(15)) != 0;
        Some(if is_white { 0.85 } else { 0.08 })
    }
}

impl Charuco {
    pub(super) fn pose(&self, middle_m: [f64; 3], turned_deg: [f64; 3]) -> Isometry3<f64> {
        let half = |squares: u32| (f64::from(squares) / 2.0 - 1.0) * SQUARE_M;
        pose_of([half(self.columns), half(self.rows)], middle_m, turned_deg)
    }
}

/// Views of boards that reach beyond the picture, in all of its parts.
const VIEWS: [([f64; 3], [f64; 3]); 12] = [
    ([0.0, 0.0, 0.36], [0.0, 0.0, 0.0]),
    ([-0.1, -0.07, 0.4], [25.0, 0.0, 5.0]),
    ([0.1, -0.07, 0.4], [-25.0, 5.0, -5.0]),
    ([-0.1, 0.07, 0.4], [0.0, 28.0, 3.0]),
    ([0.1, 0.07, 0.4], [3.0, -28.0, 0.0]),
    ([0.0, 0.05, 0.4], [20.0, 20.0, 100.0]),
    ([0.0, -0.05, 0.4], [-20.0, 22.0, -10.0]),
    ([0.08, 0.0, 0.4], [22.0, -20.0, 190.0]),
    ([-0.08, 0.0, 0.4], [-22.0, -20.0, -20.0]),
    ([-0.12, 0.08, 0.5], [-30.0, 8.0, 2.0]),
    ([0.12, -0.08, 0.5], [30.0, -8.0, -2.0]),
    ([0.1, 0.08, 0.45], [10.0, 30.0, 0.0]),
];

fn rendered(board: &Charuco, views: &[([f64; 3], [f64; 3])]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let renderer = Renderer::new();
    for (i, (middle, turned)) in views.iter().enumerate() {
        let picture = renderer.render(board, &board.pose(*middle, *turned), None);
        save(&picture, directory.path(), &format!("view_{i:02}.png"));
    }
    directory
}

/// The corners are where the pose puts them, each with the number of its own.
fn check(board: &Board, pose: &Isometry3<f64>, max_rms_px: f64) {
    let square = |corner: &laser_profiler::calibrate::Corner| {
        let (column, row) = corner.place;
        let on_board = Point3::new(f64::from(column), f64::from(row), 0.0) * SQUARE_M;
        let DistortedPixel(truth) = render::camera().project(pose * on_board).unwrap();
        (corner.seen - truth).norm_squared()
    };
    let squares = board.corners.iter().map(square).sum::<f64>();
    let rms_px = (squares / board.corners.len() as f64).sqrt();
    eprintln!("{} corners, {rms_px:.3} px RMS", board.corners.len());
    assert!(rms_px < max_rms_px, "{rms_px} px: {board:?}");
}

#[test]
fn the_numbered_corners_are_found_whatever_part_is_visible() {
    let renderer = Renderer::new();
    for (board, target) in [
        (BOARD, TARGET),
        (Charuco { is_legacy: true, ..BOARD }, TARGET),
        (Charuco { columns: 7, rows: 5, ..BOARD }, "charuco:7x5:0.03:0.0225:4X4_50"),
        (Charuco { columns: 7, rows: 6, is_legacy: true, ..BOARD }, "charuco:7x6:0.03:0.0225"),
        (PARTLY_HIDDEN, TARGET),
    ] {
        for (middle, turned) in [
            ([0.0, 0.0, 0.45], [35.0, 10.0, 0.0]),
            ([0.1, 0.05, 0.4], [0.0, -30.0, 10.0]),
            ([-0.1, -0.08, 0.4], [10.0, 10.0, 170.0]),
            ([0.0, 0.0, 0.5], [20.0, 0.0, 100.0]),
        ] {
            let pose = board.pose(middle, turned);
            let picture = renderer.render(&board, &pose, None);
            let found = found_in(&picture, target);
            let found = found.unwrap_or_else(|error| panic!("{target} {middle:?}: {error}"));
            check(&found, &pose, 0.15);
            assert_eq!((found.columns, found.rows), (board.columns - 1, board.rows - 1));
            let soft = blurred(&picture, 1.2, 4.0, 1);
            check(&found_in(&soft, target).unwrap(), &pose, 0.25);
        }
    }
}

#[test]
fn a_rendered_camera_is_found_again_from_parts_of_the_board() {
    for (board, target) in [(BOARD, TARGET), (Charuco { is_legacy: true, ..BOARD }, TARGET)] {
        let pictures = rendered(&board, &VIEWS);
        let output = pictures.path().join("camera.yaml");
        let found = calibrate(&["camera", "--target", target], pictures.path(), &output);
        assert!(number(&found, "views_used") >= 10.0, "{found}");
        assert!(number(&found, "rms_px") < 0.08, "{found}");
        assert_holds(&found, &render::camera(), 1.5);
    }
}

#[test]
fn a_rendered_plane_is_found_again() {
    let poses = VIEWS.map(|([x, y, z], turned)| {
        BOARD.pose([0.3 * x, 0.3 * y, z + 0.08], turned.map(|angle| 0.6 * angle))
    });
    let found = rendered_plane(&BOARD, poses, TARGET);
    let [off_deg, off_m] = off_plane(&found);
    assert!(off_deg < 0.1 && number(&found, "boards_used") >= 8.0, "{off_deg} degrees: {found}");
    assert!(off_m < 3.0 * number(&found["uncertainties"], "distance_m"), "{off_m} m: {found}");
}

#[test]
fn wrong_boards_are_named() {
    let renderer = Renderer::new();
    let pose = BOARD.pose([0.0, 0.0, 0.45], [10.0, 15.0, 0.0]);
    let picture = renderer.render(&BOARD, &pose, None);
    let with = |picture: &RgbImage, target: &str, wanted: &str| {
        let error = found_in(picture, target).unwrap_err();
        assert!(error.contains(wanted), "{target}: {wanted:?} in {error}");
    };
    with(
        &picture,
        "charuco:8x6:0.03:0.0225:5x5_50",
        "of dictionary 4x4_50, the target's of 5x5_50",
    );
    with(&picture, "charuco:6x8:0.03:0.0225:4x4_50", "8 columns and 6 rows");
    with(&picture, "charuco:9x6:0.03:0.0225:4x4_50", "8 columns and 6 rows");
    with(&picture, "charuco:8x6:0.03:0.015:4x4_50", "a marker is about 0.");
    let mirrored = image::imageops::flip_horizontal(&picture);
    with(&mirrored, TARGET, "mirrored");
    let mut negative = picture.clone();
    image::imageops::invert(&mut negative);
    with(&negative, TARGET, "invert the pictures");
    let plain = render::Checkerboard { columns: 7, rows: 5, square_m: SQUARE_M };
    let plain = renderer.render(&plain, &render::pose(&plain, [0.0, 0.0, 0.45], [10.0; 3]), None);
    with(&plain, TARGET, "a plain checkerboard");
    with(&RgbImage::new(480, 360), TARGET, "no board");
}

#[test]
fn pictures_of_another_board_are_refused_with_the_reason() {
    let pictures = rendered(&BOARD, &VIEWS[..6]);
    let output = pictures.path().join("camera.yaml");
    let with = |target: &str, reported: &[&str]| {
        refused(&["camera", "--target", target], pictures.path(), &output, reported);
    };
    with("charuco:8x6:0.03:0.0225:6x6_250", &["no picture shows", "dictionary 4x4_50"]);
    with("charuco:8x6:0.03", &["charuco:7x5:0.040:0.030:4x4_50"]);
}
