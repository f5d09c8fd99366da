//! Scans a simulated part and writes the points as a PLY file, which `CloudCompare`, `MeshLab` and `Open3D` open.
//!
//! ```sh
//! cargo run -p laser_triangulation --example write_cloud              # writes into the temporary directory
//! cargo run -p laser_triangulation --example write_cloud -- FILE.ply
//! ```
//!
//! Compares the heights with the ground truth of the simulated part.
#![allow(clippy::print_stdout, reason = "a summary on the terminal")]

use std::{env, error::Error, fmt::Write, fs, path::PathBuf};

use laser_triangulation::{
    nalgebra::Point3,
    scanner::{
        calibration::{Calibration, Lines},
        channel::SearchedRegion,
        image::{Image, PixelFormat},
        params::{ExtractionParams, StripeDirection},
        profile::Profile,
        stripe::Extractor,
    },
    simulate::{
        scenario::{EXAMPLE, Scenario},
        world::RenderedFrame,
    },
    statistics::median,
};

/// Largest accepted median of the height errors, metres. One row of the image is 0.22 mm.
const MAX_ERROR_M: f64 = 10e-6;

fn main() -> Result<(), Box<dyn Error>> {
    let default = || env::temp_dir().join("laser_triangulation_write_cloud.ply");
    let output = env::args_os().nth(1).map_or_else(default, PathBuf::from);

    let scenario = Scenario::from_yaml(EXAMPLE)?;
    let cloud = scan(&scenario)?;
    fs::write(&output, ply(&cloud)?)?;
    println!("{} points -> {}", cloud.len(), output.display());

    let error_m =
        |point: &Point3<f64>| (point.z - scenario.part.surface(point.x, point.y).height_m).abs();
    let mut errors_m: Vec<f64> = cloud.iter().map(error_m).collect();
    let error_m = median(&mut errors_m).ok_or("no points")?;
    println!("median height error {:.1} µm", 1e6 * error_m);
    if cloud.len() > 4000 && error_m < MAX_ERROR_M {
        Ok(())
    } else {
        Err("the points do not match the ground truth".into())
    }
}

/// Measures every frame: picture, centreline, profile, points of the part.
fn scan(scenario: &Scenario) -> Result<Vec<Point3<f64>>, Box<dyn Error>> {
    let direction = StripeDirection::Horizontal;
    let calibration = Calibration::from_yaml(&scenario.camera.calibration_yaml())?;
    let params = ExtractionParams { min_segment_area: 50, ..ExtractionParams::default() };
    let mut extractor = Extractor::new(params, direction);
    let (mut frame, mut profile) = (RenderedFrame::default(), Profile::default());
    let mut cloud = Vec::new();
    for number in 0..scenario.frames {
        scenario.render(number, &mut frame);
        let (width, height) = (scenario.camera.width_px, scenario.camera.height_px);
        let image = Image::packed(width, height, PixelFormat::Mono8, &frame.samples)?;
        let line = extractor.extract(&image);
        let lines = Lines::new(direction, &SearchedRegion::whole(&image));
        calibration.triangulate(line, &lines, image.format().max_level(), &mut profile);
        let y_m = scenario.position_m(number);
        let points = profile.x_m.iter().zip(&profile.z_m);
        let measured = points.filter(|(_, z_m)| z_m.is_finite());
        cloud.extend(measured.map(|(&x_m, &z_m)| Point3::new(x_m.into(), y_m, z_m.into())));
    }
    Ok(cloud)
}

fn ply(cloud: &[Point3<f64>]) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment unit: metre\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n",
        cloud.len()
    );
    for point in cloud {
        writeln!(text, "{:.7} {:.7} {:.7}", point.x, point.y, point.z)?;
    }
    Ok(text)
}
