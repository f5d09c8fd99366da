//! Calibrates a camera from PNG pictures of a checkerboard and writes `camera.yaml` beside them.
//!
//! ```sh
//! # Renders its own pictures:
//! cargo run -p laser_triangulation --features calibrate --example calibrate_from_pictures
//! # Takes yours, here of a board of 9 x 7 squares of 20 mm, which has 8 x 6 inner corners:
//! cargo run -p laser_triangulation --features calibrate --example calibrate_from_pictures -- FOLDER checkerboard:8x6:0.020
//! ```
//!
//! Without a folder it compares the result with the ground truth of the simulated camera.
#![allow(clippy::print_stdout, reason = "a summary on the terminal")]

use std::{
    env,
    error::Error,
    fs,
    path::{Path, PathBuf},
};

use image::GrayImage;
use laser_triangulation::{
    calibrate::{
        BoardDetector, CameraFit, CameraViews, Checkerboard, GrayPicture, LensModel,
        calibrate_camera,
    },
    simulate::{rig::RigScenario, scene::Scene, world::RenderedFrame},
};

/// Inner corners that a partly visible board must show.
const MIN_CORNERS: usize = 24;
/// Largest accepted error of the focal length, as a share of it.
const MAX_FOCAL_ERROR: f64 = 0.005;
/// A camera with a bent lens that sees a checkerboard 40 times.
const SCENE: &str = "
rig:
  width_px: 800
  height_px: 600
  read_noise: 2.0
  lens:
    focal_px: [1000.0, 1000.0]
    center_px: [405.0, 296.0]
    distortion: [-0.12, 0.2, 0.0004, -0.0003, 0.0, 0.0, 0.0, 0.0]
  laser_normal: [0.0, -0.866, 0.5]
  laser_distance_m: 0.2
laser: {amplitude: 183.0, sigma_px: 2.3}
frame_rate_hz: 10.0
start_time_ns: 0
seed: 5
frames: 40
boards: {corners: [8, 6], square_m: 0.02, white: 200.0, black: 20.0, distance_m: [0.4, 0.6], max_tilt_rad: 0.6}
";

fn main() -> Result<(), Box<dyn Error>> {
    let given = env::args_os().nth(1).map(PathBuf::from);
    let board = env::args().nth(2).unwrap_or_else(|| "checkerboard:8x6:0.020".to_owned());
    let truth = RigScenario::from_yaml(SCENE)?;
    let folder = match &given {
        Some(folder) => folder.clone(),
        None => render_pictures(&truth)?,
    };
    let fit = calibrate(&folder, board.parse()?)?;
    let output = folder.join("camera.yaml");
    fs::write(&output, fit.calibration("example", fit.outliers.len()).to_yaml())?;
    println!("{} views, RMS residual {:.3} px -> {}", fit.used.len(), fit.rms_px, output.display());
    for (name, value) in fit.parameters() {
        println!("  {name} = {value:.5} ± {:.5}", fit.uncertainty.sigma(name).unwrap_or(f64::NAN));
    }
    if given.is_none() { check(&fit, &truth) } else { Ok(()) }
}

/// Finds the board in every picture and fits the camera.
fn calibrate(folder: &Path, target: Checkerboard) -> Result<CameraFit, Box<dyn Error>> {
    let mut pictures: Vec<PathBuf> = fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_, std::io::Error>>()?;
    pictures.retain(|path| path.extension().is_some_and(|extension| extension == "png"));
    pictures.sort();
    let detector = BoardDetector::new(target, MIN_CORNERS)?;
    let mut boards = Vec::new();
    let mut size_px = (0, 0);
    for path in &pictures {
        let picture = image::open(path)?.into_luma8();
        let (width, height) = picture.dimensions();
        size_px = (width, height);
        match detector.detect(&GrayPicture { width, height, levels: picture.into_raw() }) {
            Ok(board) => boards.push(board),
            Err(error) => println!("{}: {error}", path.display()),
        }
    }
    let (width_px, height_px) = size_px;
    let views = CameraViews { boards: &boards, width_px, height_px, square_m: target.square_m };
    Ok(calibrate_camera(&views, LensModel::PlumbBob)?)
}

fn render_pictures(scene: &RigScenario) -> Result<PathBuf, Box<dyn Error>> {
    let folder = env::temp_dir().join("laser_triangulation_calibrate_from_pictures");
    fs::create_dir_all(&folder)?;
    let mut frame = RenderedFrame::default();
    for number in 0..scene.frames {
        scene.render(number, &mut frame);
        let picture =
            GrayImage::from_raw(scene.rig.width_px, scene.rig.height_px, frame.samples.clone());
        picture.ok_or("too few samples")?.save(folder.join(format!("{number:03}.png")))?;
    }
    Ok(folder)
}

fn check(fit: &CameraFit, truth: &RigScenario) -> Result<(), Box<dyn Error>> {
    let error = fit.camera.fx_px / truth.rig.lens.focal_px[0] - 1.0;
    println!("focal length off by {:.3} %", 100.0 * error);
    if error.abs() < MAX_FOCAL_ERROR {
        Ok(())
    } else {
        Err("the camera does not match the ground truth".into())
    }
}
