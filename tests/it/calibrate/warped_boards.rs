//! Boards that are not flat, and boards whose fields are not square.

use super::{
    calibrate, number, off_plane, refused,
    render::{self, Checkerboard, Renderer, VIEWS, Warped, pose, save},
    rendered_plane,
};

const BOARD: Checkerboard = Checkerboard { columns: 8, rows: 5, square_m: 0.03 };
/// Bent along the columns, along the rows, and twisted, with the difference between highest and lowest point, metres.
const BENT: [([f64; 3], f64); 3] = [
    ([0.11, 0.0, 0.0], 0.11 * 0.135 * 0.135),
    ([0.0, 0.0, -0.2], 0.2 * 0.09 * 0.09),
    ([0.0, 0.1, 0.0], 2.0 * 0.1 * 0.135 * 0.09),
];

#[test]
fn the_camera_holds_the_truth_with_a_bent_board() {
    let renderer = Renderer::new();
    for (bend_per_m, bow_m) in BENT {
        let directory = tempfile::tempdir().unwrap();
        let surface = Warped { board: BOARD, ratio: 1.0, bend_per_m };
        for (i, [middle, turned]) in VIEWS.into_iter().enumerate() {
            let picture = renderer.render(&surface, &pose(&BOARD, middle, turned), None);
            save(&picture, directory.path(), &format!("{i:02}.png"));
        }
        let target = ["camera", "--target", "checkerboard:8x5:0.030"];
        let found = calibrate(&target, directory.path(), &directory.path().join("camera.yaml"));
        let bend = &found["bend"];
        let off_m = number(bend, "bow_m") - bow_m;
        assert!(off_m.abs() < 3.0 * number(bend, "sigma_m"), "{bow_m}: {off_m}: {found}");
        assert_eq!(bend["is_shared"], true, "{found}");
        let truth = render::camera();
        for (name, truth) in [("fx", truth.fx_px), ("fy", truth.fy_px)] {
            let off = number(&found["intrinsics"], name) - truth;
            let sigma = number(&found["uncertainties"], name);
            assert!(off.abs() <= 2.0 * sigma && sigma < 3.0, "{name}: {off} ± {sigma}: {found}");
        }
    }
}

#[test]
fn the_plane_accounts_for_a_bent_board() {
    for (bend_per_m, _) in BENT {
        let surface = Warped { board: BOARD, ratio: 1.0, bend_per_m };
        let poses = VIEWS.map(|[[x, y, z], turned]| pose(&BOARD, [x / 3.0, y, z], turned));
        let found = rendered_plane(&surface, poses, "checkerboard:8x5:0.030");
        assert_eq!(found["bend"]["is_shared"], true, "{found}");
        let [off_deg, off_m] = off_plane(&found);
        assert!(off_deg < 0.06, "{off_deg} degrees: {found}");
        assert!(off_m < 0.25e-3, "{off_m} m: {found}");
    }
}

#[test]
fn fields_that_are_not_square_are_named() {
    let renderer = Renderer::new();
    let board = Checkerboard { square_m: 0.02, ..BOARD };
    for (ratio, size) in [(1.6, "15 x 24 mm"), (0.8, "25 x 20 mm"), (1.25, "20 x 25 mm")] {
        let directory = tempfile::tempdir().unwrap();
        let surface = Warped { board, ratio, bend_per_m: [0.0; 3] };
        for (i, [middle, turned]) in VIEWS.into_iter().enumerate() {
            let picture = renderer.render(&surface, &pose(&board, middle, turned), None);
            save(&picture, directory.path(), &format!("{i:02}.png"));
        }
        let target = ["camera", "--target", "checkerboard:8x5:0.020"];
        let reported = ["fields look", size, "squares of 20.0 mm", "ruler"];
        refused(&target, directory.path(), &directory.path().join("camera.yaml"), &reported);
    }
}
