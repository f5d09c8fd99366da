//! A frame with the line that is measured in it.

use std::path::Path;

use anyhow::Context;

use crate::scanner::{
    channel::{AnyPlane, Decoder, SearchedRegion},
    frame_index::FrameIndex,
    image::{Frame, Image},
    params::Params,
    pipeline::Pipeline,
};

/// Vermilion of Okabe and Ito: distinct from grey for every kind of colour vision.
const LINE: [u8; 3] = [213, 94, 0];

/// Draws the frame in grey levels with the measured points, and writes a PNG of the frame's size.
///
/// # Errors
/// The parameters do not fit the frame, or the file cannot be written.
pub(super) fn save(path: &Path, image: &Image<'_>, params: &Params) -> anyhow::Result<()> {
    let full_scale = params.full_scale_of(image.format())?;
    let mut decoder = Decoder::default();
    let whole = SearchedRegion::whole(image);
    let mut pixels: Vec<[u8; 3]> = match decoder.decode(image, params.channel, &whole) {
        AnyPlane::Eight(plane) => {
            plane.rows().flatten().map(|&level| gray(level.into(), full_scale)).collect()
        }
        AnyPlane::Sixteen(plane) => {
            plane.rows().flatten().map(|&level| gray(level.into(), full_scale)).collect()
        }
    };
    let mut pipeline = Pipeline::new(*params, None);
    let frame = Frame { stamp_ns: 0, image: *image };
    let output = pipeline.process(&frame, FrameIndex::default(), |_| ())?;
    let width = image.width() as usize;
    for (u, v) in output.centerline.u_px.iter().zip(&output.centerline.v_px) {
        let at = v.round() as usize * width + u.round() as usize;
        if let Some(pixel) = pixels.get_mut(at) {
            *pixel = LINE;
        }
    }
    let (width, height) = (image.width(), image.height());
    image::save_buffer(path, pixels.as_flattened(), width, height, image::ColorType::Rgb8)
        .with_context(|| format!("cannot write {}", path.display()))
}

fn gray(level: u32, full_scale: u32) -> [u8; 3] {
    [(255 * u64::from(level) / u64::from(full_scale.max(1))).min(255) as u8; 3]
}
