use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::*;
use crate::scanner::{calibration::Lines, profile::Profile, stripe::Centerline};

const RIG: &str = "
frames: 3
frame_rate_hz: 50.0
start_time_ns: 1767225600000000000
seed: 7
motion: {start_m: 0.0, step_m: 0.001}
laser: {amplitude: 180.0, sigma_px: 2.0}
rig:
  width_px: 320
  height_px: 200
  lens:
    focal_px: [600.0, 602.0]
    center_px: [161.0, 98.0]
    distortion: [-0.2, 0.1, 0.001, -0.002, 0.05, 0.0, 0.0, 0.0]
    tilt_rad: [0.05, -0.03]
  laser_normal: [0.05, -0.5, 0.85]
  laser_distance_m: 0.25
gauge:
  reflectance: 0.9
  slope: [0.02, 0.01]
  shape:
";

fn scenario(shape: &str) -> RigScenario {
    RigScenario::from_yaml(&RIG.replace("  shape:\n", &format!("  shape: {shape}\n"))).unwrap()
}

const SHAPES: [&str; 4] = [
    "{flat: {}}",
    "{groove: {width_m: 0.02, depth_m: 0.0001}}",
    "{stairs: {width_m: 0.012, heights_m: [0.0, 0.002, 0.004, 0.006]}}",
    "{spheres: {radius_m: 0.012, centers_m: [[-0.02, 0.002, 0.0], [0.02, 0.001, 0.0]]}}",
];

/// The instrument's camera model is independent of the renderer's: it must map each true centre back to the gauge.
#[test]
fn the_instrument_maps_the_truth_back_to_the_gauge() {
    for (is_vertical, is_fisheye) in [(false, false), (true, false), (false, true)] {
        for shape in SHAPES {
            let mut scenario = scenario(shape);
            if is_fisheye {
                scenario.rig.lens.distortion = [0.0; 8];
                // No line looks exactly at the edge of a step.
                scenario.rig.lens.center_px = [161.3, 98.0];
                scenario.rig.lens.equidistant = Some([-0.05, 0.02, -0.01, 0.001]);
            }
            if is_vertical {
                scenario.rig.is_vertical = true;
                scenario.rig.laser_normal = [0.5, 0.05, 0.85];
            }
            let gauge = scenario.gauge.clone().unwrap();
            let world = geometry::World::new(&scenario.rig);
            let direction = scenario.rig.stripe_direction();
            let calibration = Calibration::from_yaml(&scenario.calibration_yaml()).unwrap();
            let lines = Lines { direction, first: 0, count: scenario.rig.length_px() as usize };
            let mut num_points = 0;
            for frame in 0..scenario.frames {
                let position_m = scenario.position_m(frame);
                let mut centerline = Centerline::default();
                for line in 0..scenario.rig.length_px() {
                    let section = gauge.cross_section(&scenario.rig, &world, position_m, line);
                    if section.center_px.is_finite() {
                        let (along, across) = (line as f32, section.center_px as f32);
                        let (u, v) = if is_vertical { (across, along) } else { (along, across) };
                        centerline.u_px.push(u);
                        centerline.v_px.push(v);
                        centerline.intensity.push(1.0);
                        centerline.sigma_px.push(0.1);
                        centerline.flags.push(0);
                    }
                }
                let mut profile = Profile::default();
                calibration.triangulate(&centerline, &lines, 255, &mut profile);
                assert_eq!(profile.valid_count as usize, centerline.len());
                for (x_m, z_m) in profile.x_m.iter().zip(&profile.z_m) {
                    if z_m.is_finite() {
                        let truth_m = gauge.height_m(f64::from(*x_m), position_m);
                        // A 32-bit centre of 100 px has a resolution of 4e-6 px.
                        let error_m = (f64::from(*z_m) - truth_m).abs();
                        assert!(error_m < 2e-8, "{shape} {x_m} {z_m}: {error_m}");
                        num_points += 1;
                    }
                }
            }
            assert!(num_points > 400, "{shape}: {num_points}");
        }
    }
}

/// Points that move along the calibrated axis reach the laser plane later.
#[test]
fn the_axis_carries_the_gauge_through_the_plane() {
    let scenario = scenario(SHAPES[0]);
    let rig = scenario.rig.calibration();
    let pose = rig.camera_from_laser(scenario.rig.stripe_direction());
    // The part's point (0, 3 mm, 0) is in the plane at the position 3 mm.
    let at_start = pose * Point3::new(0.0, 0.003, 0.0);
    let moved = rig.axis.unwrap().pose(crate::scanner::axis::RawPosition(0.003)) * at_start;
    assert!((rig.plane.normal.dot(&moved.coords) - rig.plane.distance_m).abs() < 1e-12);
}

#[test]
fn a_wall_hides_what_is_behind_it_on_the_side_away_from_the_lens() {
    let scenario = scenario("{spheres: {radius_m: 0.01, centers_m: [[0.0, 0.0, 0.0]]}}");
    let gauge = scenario.gauge.clone().unwrap();
    let world = geometry::World::new(&scenario.rig);
    let lens_y_m = world.lens_m()[1];
    assert!(lens_y_m.abs() > 0.05, "{lens_y_m}");
    // Just beside the ball, on its middle line: in front of it and behind it, as the lens sees it.
    let sees = |y_m: f64| {
        let section = gauge.cross_section(&scenario.rig, &world, y_m, 161);
        section.center_px.is_finite()
    };
    assert!(sees(0.0101 * lens_y_m.signum()) && !sees(-0.0101 * lens_y_m.signum()));
}

const BOARDS: &str = "
frames: 4
frame_rate_hz: 5.0
start_time_ns: 0
seed: 3
laser: {amplitude: 150.0, sigma_px: 2.0}
rig:
  width_px: 320
  height_px: 240
  lens: {focal_px: [310.0, 311.0], center_px: [161.0, 118.0], distortion: [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}
  laser_normal: [0.0, -0.5, 0.85]
  laser_distance_m: 0.4
boards: {corners: [7, 5], square_m: 0.02, white: 200.0, black: 20.0, distance_m: [0.4, 0.5], max_tilt_rad: 0.4}
";

/// Returns the stationary point of a second-order surface through 25 pixels about the origin.
fn saddle(level: impl Fn(i32, i32) -> f64) -> [f64; 2] {
    let places: Vec<(i32, i32)> = (-2..=2).flat_map(|v| (-2..=2).map(move |u| (u, v))).collect();
    let terms = DMatrix::from_row_iterator(
        25,
        6,
        places.iter().flat_map(|(u, v)| {
            let (u, v) = (f64::from(*u), f64::from(*v));
            [1.0, u, v, u * u, u * v, v * v]
        }),
    );
    let levels = DVector::from_iterator(25, places.iter().map(|(u, v)| level(*u, *v)));
    let fit = terms.svd(true, true).solve(&levels, 1e-12).unwrap();
    let curvature = Matrix2::new(2.0 * fit[3], fit[4], fit[4], 2.0 * fit[5]);
    (-(curvature.try_inverse().unwrap() * Vector2::new(fit[1], fit[2]))).into()
}

/// The image of a corner is a saddle: opposite squares are equal, neighbouring ones white and black.
#[test]
fn corners_match_their_stated_positions() {
    check_corners(&RigScenario::from_yaml(BOARDS).unwrap(), 0.2);
}

/// Views of more than 50 degrees off the axis.
#[test]
fn corners_match_their_stated_positions_through_a_fisheye() {
    let mut scenario = RigScenario::from_yaml(BOARDS).unwrap();
    let boards = scenario.boards.as_mut().unwrap();
    (boards.distance_m, boards.square_m) = ([0.15, 0.2], 0.03);
    let lens = &mut scenario.rig.lens;
    (lens.focal_px, lens.distortion) = ([160.0, 161.0], [0.0; 8]);
    lens.equidistant = Some([-0.01, 0.02, -0.01, 0.0]);
    // The squares are not quite saddles near the rim.
    check_corners(&scenario, 0.3);
}

fn check_corners(scenario: &RigScenario, limit_px: f64) {
    let boards = scenario.boards.unwrap();
    let mut frame = RenderedFrame::default();
    let mut sum = Vector2::zeros();
    for number in 0..scenario.frames {
        scenario.render(number, &mut frame);
        let view = boards.view(&scenario.rig, scenario.seed, number);
        let corners = boards.corners_px(&scenario.rig, &view);
        assert_eq!(corners.len(), 35);
        for [column, row] in corners.into_iter().map(Option::unwrap) {
            let level = |u: i32, v: i32| f64::from(frame.samples[v as usize * 320 + u as usize]);
            let (u, v) = (column.round() as i32, row.round() as i32);
            let [du, dv] = saddle(|x, y| level(u + x, v + y));
            let missed = Vector2::new(du + f64::from(u) - column, dv + f64::from(v) - row);
            // Pixels lie unevenly about a corner: the mean over many corners removes that effect.
            assert!(missed.norm() < limit_px, "{number}: {missed} at {column}, {row}");
            sum += missed;
            let ring: Vec<f64> = (0..16)
                .map(|k| {
                    let angle = f64::from(k) * std::f64::consts::TAU / 16.0;
                    let (u, v) = (column + 4.0 * angle.cos(), row + 4.0 * angle.sin());
                    level(u.round() as i32, v.round() as i32)
                })
                .collect();
            let changes =
                (0..16).filter(|k| (ring[*k] > 110.0) != (ring[(k + 1) % 16] > 110.0)).count();
            assert_eq!(changes, 4, "{ring:?}");
        }
    }
    let mean = sum / f64::from(35 * scenario.frames);
    assert!(mean.norm() < 0.02, "{mean}");
}

/// The laser line is where the laser plane cuts the board.
#[test]
fn the_line_lies_on_board_and_plane() {
    let mut scenario = RigScenario::from_yaml(BOARDS).unwrap();
    let mut boards = scenario.boards.unwrap();
    (boards.white, boards.black, boards.has_line) = (20.0, 20.0, true);
    scenario.boards = Some(boards);
    let rig = scenario.rig.calibration();
    let mut frame = RenderedFrame::default();
    let mut off_m = Vec::new();
    for number in 0..scenario.frames {
        scenario.render(number, &mut frame);
        let view = boards.view(&scenario.rig, scenario.seed, number);
        let normal = view.rotation * Vector3::z();
        for column in 0..320 {
            let level = |row: usize| f64::from(frame.samples[row * 320 + column]) - 20.0;
            let Some(peak) = (10..230).max_by(|a, b| level(*a).total_cmp(&level(*b))) else {
                continue;
            };
            if level(peak) < 40.0 {
                continue;
            }
            let rows = peak - 8..=peak + 8;
            let flux: f64 = rows.clone().map(level).sum();
            let center = rows.map(|row| row as f64 * level(row)).sum::<f64>() / flux;
            let pixel = crate::scanner::camera::DistortedPixel(nalgebra::Point2::new(
                column as f64,
                center,
            ));
            let ray = rig.camera.ray(pixel).unwrap();
            let point = rig.plane.meet(ray).unwrap();
            let off_board_m = normal.dot(&(point.coords - view.middle_m));
            // Edges of the squares and of the board pull the centroid of a cross-section towards the brighter side.
            assert!(off_board_m.abs() < 3e-3, "{number} {column}: {off_board_m}");
            off_m.push(off_board_m);
        }
    }
    assert!(off_m.len() > 50, "{}", off_m.len());
    let median_m = crate::statistics::median(&mut off_m).unwrap();
    // A pixel is 1.3 mm there.
    assert!(median_m.abs() < 1e-4, "{median_m}");
}

#[test]
fn an_invalid_value_is_rejected_with_key_value_and_range() {
    let flat = RIG.replace("  shape:\n", "  shape: {flat: {}}\n");
    for (from, to, message) in [
        ("frames: 3", "frames: 0", "frames is 0"),
        ("width_px: 320", "width_px: 9000", "rig.width_px is 9000"),
        ("[0.05, -0.5, 0.85]", "[0.05, -0.5, -0.85]", "rig.laser_normal"),
        ("focal_px: [600.0", "focal_px: [-600.0", "rig.lens.focal_px[0] is -600"),
        ("reflectance: 0.9", "reflectance: 9", "gauge.reflectance is 9"),
        ("{flat: {}}", "{dome: {}}", "dome"),
        (
            "{flat: {}}",
            "{stairs: {width_m: 0.0, heights_m: []}}",
            "gauge.shape.stairs.width_m is 0",
        ),
        ("gauge:", "boards:", "reflectance"),
    ] {
        assert!(flat.contains(from), "{from}");
        let error = RigScenario::from_yaml(&flat.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(message), "{message}: {error}");
    }
}
