//! Images for a page: found by stamp, reduced to the size that a page needs.

use ::image::{
    ExtendedColorType, ImageEncoder as _,
    codecs::{jpeg::JpegEncoder, png::PngEncoder},
};
use anyhow::{Context, bail};
use base64::{Engine as _, engine::general_purpose::STANDARD};

use crate::{
    bag::{Filter, RawMessage},
    msg::{
        cdr,
        convert::{compressed, frame},
        schema::Message as _,
        sensor_msgs::{CompressedImage, Image},
    },
    report::overlay::Overlay,
    results::{Notes, ResultsRecording, add_error},
    scanner::{
        channel::{AnyPlane, Decoder, Plane, SearchedRegion},
        image::Image as Picture,
        params::Channel,
    },
};

/// Longest side of an image in a page, pixels.
const LONGEST_PX: usize = 1600;
/// Larger PNGs are stored as JPEG, bytes.
const PNG_BYTES: usize = 256 << 10;
const JPEG_QUALITY: u8 = 85;
/// Time after the recorded reception in which an image is searched first, nanoseconds.
const NEAR_NS: i64 = 1_000_000_000;
/// Largest decoded image, bytes.
const MAX_FRAME_BYTES: u64 = 1 << 28;

/// Adds the images of a recording to the centrelines with the same stamps.
///
/// # Errors
/// A recording without images.
pub(crate) fn add(
    recording: &ResultsRecording,
    input: Option<&str>,
    overlays: &mut [Overlay],
    notes: &mut Notes,
) -> anyhow::Result<()> {
    let topic = choose(recording, input)?;
    // First near the time of reception, then everywhere.
    let near = overlays.iter().map(|overlay| overlay.received_ns);
    let near: Vec<_> = near.map(|from_ns| [from_ns, from_ns.saturating_add(NEAR_NS)]).collect();
    for span_ns in near.into_iter().chain([[i64::MIN, i64::MAX]]) {
        look(recording, &topic, span_ns, overlays, notes);
    }
    let missing = overlays.iter().filter(|overlay| overlay.image.is_empty()).count();
    if missing > 0 {
        notes.add(format!("{missing} of the shown frames have no image on {topic}"));
    }
    Ok(())
}

/// Searches images received in a span of time, until the span ends or all are found.
fn look(
    recording: &ResultsRecording,
    topic: &str,
    [from_ns, to_ns]: [i64; 2],
    overlays: &mut [Overlay],
    notes: &mut Notes,
) {
    let is_over = |overlays: &[Overlay]| {
        let here = |overlay: &&Overlay| to_ns == i64::MAX || overlay.received_ns == from_ns;
        overlays.iter().filter(here).all(|overlay| !overlay.image.is_empty())
    };
    if is_over(overlays) {
        return;
    }
    for message in recording.bag().messages(&Filter::topics([topic]).from(from_ns)) {
        match message {
            Ok(message) if message.log_time_ns > to_ns => return,
            Ok(message) => {
                if let Err(error) = put(&message, overlays) {
                    notes.add_loss(format!("{topic}: {error:#}"));
                }
            }
            Err(error) => add_error(notes, &error),
        }
        if is_over(overlays) {
            return;
        }
    }
}

/// Returns the image topic: the one that the results name, otherwise the only one.
fn choose(recording: &ResultsRecording, input: Option<&str>) -> anyhow::Result<String> {
    let topics = recording.image_topics();
    if let Some(named) = topics.iter().find(|topic| Some(topic.as_str()) == input) {
        return Ok(named.clone());
    }
    let path = recording.path().display();
    match &topics[..] {
        [topic] => Ok(topic.clone()),
        [] => bail!("{path} has none; --images names the recording that has them"),
        _ => bail!(
            "{path} has several topics of images, none of them the results' input: {}",
            topics.join(", ")
        ),
    }
}

/// Adds the image to the centreline with its stamp, if there is one.
fn put(message: &RawMessage, overlays: &mut [Overlay]) -> anyhow::Result<()> {
    message.topic.require_cdr()?;
    let mut pixels = Vec::new();
    let is_compressed = message.topic.type_name == CompressedImage::TYPE.name;
    let (stamp_ns, image) = if is_compressed {
        let message: CompressedImage<'_> = cdr::decode(&message.data)?;
        let stamp_ns = message.header.stamp.to_ns();
        if !overlays.iter().any(|overlay| overlay.stamp_ns == stamp_ns) {
            return Ok(());
        }
        (stamp_ns, compressed::image(&message, MAX_FRAME_BYTES, &mut pixels)?)
    } else {
        let message: Image<'_> = cdr::decode(&message.data)?;
        let stamp_ns = message.header.stamp.to_ns();
        if !overlays.iter().any(|overlay| overlay.stamp_ns == stamp_ns) {
            return Ok(());
        }
        (stamp_ns, frame::image(&message, MAX_FRAME_BYTES)?)
    };
    let empty = |overlay: &&mut Overlay| overlay.stamp_ns == stamp_ns && overlay.image.is_empty();
    let Some(overlay) = overlays.iter_mut().find(empty) else { return Ok(()) };
    (overlay.image, overlay.reduction) = address(&image)?;
    Ok(())
}

/// Returns the image as a `data:` address, and its reduction factor.
fn address(image: &Picture<'_>) -> anyhow::Result<(String, usize)> {
    let whole = SearchedRegion::whole(image);
    let mut decoder = Decoder::default();
    let reduction = whole.width.max(whole.height).div_ceil(LONGEST_PX);
    let (pixels, size) = match decoder.decode(image, Channel::Auto, &whole) {
        AnyPlane::Eight(plane) => reduced(&plane, reduction, 255),
        AnyPlane::Sixteen(plane) => {
            // Many cameras use 10 or 12 of the 16 bits.
            let rows = plane.rows().map(|row| row.iter().max());
            let brightest = rows.flatten().max().map_or(1, |level| u32::from(*level)).max(1);
            reduced(&plane, reduction, brightest)
        }
    };
    let [width, height] = size;
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(&pixels, width, height, ExtendedColorType::L8)
        .context("PNG")?;
    let mut kind = "png";
    if bytes.len() > PNG_BYTES {
        bytes.clear();
        kind = "jpeg";
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .write_image(&pixels, width, height, ExtendedColorType::L8)
            .context("JPEG")?;
    }
    Ok((format!("data:image/{kind};base64,{}", STANDARD.encode(bytes)), reduction))
}

/// Returns the means over squares of pixels, scaled so that `full` is white, and the size.
fn reduced<S: Copy + Into<u32>>(plane: &Plane<'_, S>, by: usize, full: u32) -> (Vec<u8>, [u32; 2]) {
    let size = [plane.width().div_ceil(by), plane.height().div_ceil(by)];
    let mut pixels = Vec::with_capacity(size[0] * size[1]);
    for y in 0..size[1] {
        for x in 0..size[0] {
            let (mut sum, mut num) = (0_u64, 0);
            for row in y * by..((y + 1) * by).min(plane.height()) {
                let end = ((x + 1) * by).min(plane.width());
                let levels = plane.row(row)[x * by..end].iter();
                sum += levels.map(|level| u64::from((*level).into())).sum::<u64>();
                num += end - x * by;
            }
            pixels.push((255 * sum / (num as u64 * u64::from(full))) as u8);
        }
    }
    (pixels, size.map(|side| side as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_of_pixels_become_their_mean() {
        let samples = [0_u16, 4095, 100, 4095, 0, 100];
        let plane = Plane::new(3, 2, 3, &samples).unwrap();
        assert_eq!(reduced(&plane, 1, 4095).0, [0, 255, 6, 255, 0, 6]);
        assert_eq!(reduced(&plane, 2, 4095), (vec![127, 6], [2, 1]));
    }
}
