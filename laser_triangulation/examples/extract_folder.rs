//! Extracts the centreline of every PNG picture in a folder and writes `centrelines.csv` beside them.
//!
//! ```sh
//! cargo run -p laser_triangulation --example extract_folder             # renders its own pictures
//! cargo run -p laser_triangulation --example extract_folder -- FOLDER   # takes yours
//! ```
//!
//! Without a folder it compares the result with the ground truth of the rendered pictures.
#![allow(clippy::print_stdout, reason = "a summary on the terminal")]

use std::{
    env,
    error::Error,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use image::{ColorType, GrayImage};
use laser_triangulation::{
    scanner::{
        image::{ByteOrder, Image, PixelFormat},
        stripe::{Centerline, Extractor},
    },
    simulate::stripe::{StripeScene, render_stripe},
};

const NUM_PICTURES: u32 = 5;
/// Largest accepted RMS error of a rendered picture, pixels.
const MAX_RMS_PX: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    let given = env::args_os().nth(1).map(PathBuf::from);
    let folder = match &given {
        Some(folder) => folder.clone(),
        None => render_pictures()?,
    };
    let pictures = pictures(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    if pictures.is_empty() {
        return Err(format!("{}: no PNG picture in this folder", folder.display()).into());
    }

    let mut extractor = Extractor::default();
    let mut csv = String::from("picture,u_px,v_px,sigma_px,width_px\n");
    for (number, path) in (0..).zip(&pictures) {
        let line = extract(&mut extractor, path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        for i in 0..line.len() {
            let (u, v) = (line.u_px[i], line.v_px[i]);
            writeln!(csv, "{name},{u},{v:.4},{:.4},{:.2}", line.sigma_px[i], line.width_px[i])?;
        }
        println!("{name}: {} points", line.len());
        if given.is_none() {
            check(number, line)?;
        }
    }
    let output = folder.join("centrelines.csv");
    fs::write(&output, csv)?;
    println!("{} pictures -> {}", pictures.len(), output.display());
    Ok(())
}

/// Returns the PNG pictures of a folder, by name.
fn pictures(folder: &Path) -> Result<Vec<PathBuf>, std::io::Error> {
    let entries = fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut pictures = entries.collect::<Result<Vec<_>, std::io::Error>>()?;
    let is_png = |path: &PathBuf| path.extension().is_some_and(|it| it.eq_ignore_ascii_case("png"));
    pictures.retain(is_png);
    pictures.sort();
    Ok(pictures)
}

/// Extracts the centreline of a picture: grey of 8 or 16 bits as it is, colour by its largest channel.
fn extract<'a>(
    extractor: &'a mut Extractor,
    path: &Path,
) -> Result<&'a Centerline, Box<dyn Error>> {
    let picture = image::open(path)?;
    let (width, height) = (picture.width(), picture.height());
    let (format, samples) = match picture.color() {
        ColorType::L8 => (PixelFormat::Mono8, picture.into_luma8().into_raw()),
        ColorType::L16 => {
            let samples = picture.into_luma16().into_raw();
            (
                PixelFormat::Mono16(ByteOrder::Little),
                samples.iter().flat_map(|it| it.to_le_bytes()).collect(),
            )
        }
        _ => (PixelFormat::Rgb8, picture.into_rgb8().into_raw()),
    };
    Ok(extractor.extract(&Image::packed(width, height, format, &samples)?))
}

/// Row of the stripe's centre in a rendered picture, pixels.
fn truth_px(picture: u32, column: u32) -> f64 {
    200.0 + 10.0 * f64::from(picture) + 0.05 * f64::from(column)
}

fn render_pictures() -> Result<PathBuf, Box<dyn Error>> {
    let folder = env::temp_dir().join("laser_triangulation_extract_folder");
    fs::create_dir_all(&folder)?;
    let mut samples = Vec::new();
    for picture in 0..NUM_PICTURES {
        let seed = picture.into();
        let scene =
            StripeScene { read_noise: 2.0, shot_gain: 0.01, seed, ..StripeScene::default() };
        render_stripe(&scene, |column| truth_px(picture, column), &mut samples);
        let rendered = GrayImage::from_raw(scene.width, scene.height, samples.clone());
        rendered.ok_or("too few samples")?.save(folder.join(format!("{picture:03}.png")))?;
    }
    Ok(folder)
}

fn check(picture: u32, line: &Centerline) -> Result<(), Box<dyn Error>> {
    let errors = line.u_px.iter().zip(&line.v_px);
    let squares = errors.map(|(&u, &v)| (f64::from(v) - truth_px(picture, u as u32)).powi(2));
    let rms_px = (squares.sum::<f64>() / line.len() as f64).sqrt();
    println!("  RMS error {rms_px:.4} px");
    if line.len() == StripeScene::default().width as usize && rms_px < MAX_RMS_PX {
        Ok(())
    } else {
        Err(format!("picture {picture}: {} points, RMS error {rms_px:.4} px", line.len()).into())
    }
}
