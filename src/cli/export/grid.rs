//! Height maps as 16-bit PNG and 32-bit TIFF files with their grid in the metadata.

use std::{fs::File, io::BufWriter, path::Path};

use serde_json::{Value as Json, json};
use tiff::{
    encoder::{Rational, TiffEncoder, colortype::Gray32Float},
    tags::{ResolutionUnit, Tag},
};

use crate::metrology::height_map::RegularHeightMap;

/// Number of valid levels; level 0 is invalid.
const LEVELS: f64 = 65_534.0;

/// Returns the metadata of the grid for both formats.
pub(super) fn about(map: &RegularHeightMap, topic: &str) -> Json {
    let [measured, filled] = super::counts(map);
    let layout = &map.layout;
    json!({
        "program": concat!("laser_profiler ", env!("CARGO_PKG_VERSION")),
        "topic": topic,
        "width": layout.width,
        "height": layout.height,
        "cell_m": layout.cell_m,
        "origin_m": layout.origin_m,
        "origin": "outer corner of the first cell; rows begin at the smallest y",
        "measured": measured,
        "filled": filled,
    })
}

/// Writes heights as levels; returns the metadata with the conversion to metres.
pub(super) fn write_png(path: &Path, map: &RegularHeightMap, about: &Json) -> anyhow::Result<Json> {
    let [low, high] = map.range_m().unwrap_or([0.0, 0.0]).map(f64::from);
    // A map of constant height still needs a scale.
    let scale = if high > low { (high - low) / (LEVELS - 1.0) } else { 1e-9 };
    let offset = low - scale;
    let mut about_file = about.clone();
    about_file["format"] = json!("png");
    about_file["metres_per_level"] = json!(scale);
    about_file["offset_m"] = json!(offset);
    about_file["invalid_level"] = json!(0);
    let level = |z: &f32| {
        if z.is_finite() { ((f64::from(*z) - offset) / scale).round() as u16 } else { 0 }
    };
    let samples: Vec<u8> = map.z_m.iter().flat_map(|z| level(z).to_be_bytes()).collect();
    write(path, map, png::BitDepth::Sixteen, &samples, Some(&about_file))?;
    Ok(about_file)
}

/// Writes the state of each cell: 0 invalid, 1 measured, 2 filled.
pub(super) fn write_mask(path: &Path, map: &RegularHeightMap) -> anyhow::Result<()> {
    let samples: Vec<u8> = map.states.iter().map(|state| *state as u8).collect();
    write(path, map, png::BitDepth::Eight, &samples, None)
}

fn write(
    path: &Path,
    map: &RegularHeightMap,
    depth: png::BitDepth,
    samples: &[u8],
    about_file: Option<&Json>,
) -> anyhow::Result<()> {
    let file = BufWriter::new(File::create(path)?);
    let mut encoder = png::Encoder::new(file, map.layout.width, map.layout.height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let per_metre = (1.0 / map.layout.cell_m).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    if let Some(about_file) = about_file {
        encoder.add_text_chunk("laser_profiler".to_owned(), about_file.to_string())?;
        for key in ["metres_per_level", "offset_m", "cell_m"] {
            encoder.add_text_chunk(key.to_owned(), about_file[key].to_string())?;
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(samples)?;
    Ok(writer.finish()?)
}

/// Writes heights in metres, NaN if invalid. Returns the metadata.
pub(super) fn write_tiff(
    path: &Path,
    map: &RegularHeightMap,
    about: &Json,
) -> anyhow::Result<Json> {
    let mut about_file = about.clone();
    about_file["format"] = json!("tif");
    let mut encoder = TiffEncoder::new(BufWriter::new(File::create(path)?))?;
    let mut image = encoder.new_image::<Gray32Float>(map.layout.width, map.layout.height)?;
    // Thousandths of cells per centimetre.
    let per_centimetre = (10.0 / map.layout.cell_m).round().clamp(1.0, f64::from(u32::MAX)) as u32;
    image.resolution(ResolutionUnit::Centimeter, Rational { n: per_centimetre, d: 1000 });
    image.encoder().write_tag(Tag::ImageDescription, about_file.to_string().as_str())?;
    image
        .encoder()
        .write_tag(Tag::Software, concat!("laser_profiler ", env!("CARGO_PKG_VERSION")))?;
    image.write_data(&map.z_m)?;
    Ok(about_file)
}
