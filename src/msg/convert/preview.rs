//! A reduced image for previews, and its annotations.
//!
//! An image of 5 megapixels is too large for a small view. Each pixel of the preview is the brightest of a square,
//! because the mean would make a stripe of a few pixels vanish.

use crate::{
    msg::foxglove_msgs::ImageAnnotations,
    scanner::image::{ByteOrder, Image, PixelFormat},
};

/// Largest width of a preview, pixels.
pub(crate) const MAX_WIDTH_PX: u32 = 640;

/// Returns the side of the squares reduced to one pixel each, for an image of that width; 1 if it is small enough.
pub(crate) const fn factor(width_px: u32) -> u32 {
    let factor = width_px.div_ceil(MAX_WIDTH_PX);
    if factor == 0 { 1 } else { factor }
}

/// Replaces `pixels` by the preview, 8-bit grey, row by row; returns its width and height. A colour contributes its
/// largest component, YUV its luma. Samples of 16 bits are shifted right until the brightest fits into eight bits.
pub(crate) fn reduce(image: &Image<'_>, factor: u32, pixels: &mut Vec<u8>) -> (u32, u32) {
    let factor = factor.max(1);
    let (width, height) = (image.width().div_ceil(factor), image.height().div_ceil(factor));
    pixels.clear();
    pixels.resize(width as usize * height as usize, 0);
    let format = image.format();
    let bytes_per_pixel = format.bytes_per_pixel();
    let row_bytes = image.width() as usize * bytes_per_pixel;
    let rows = || image.data().chunks(image.step()).map(|row| &row[..row_bytes]);
    let mut fill = |brightest: &dyn Fn(&[u8]) -> u8| {
        for (row, line) in rows().enumerate() {
            let first = row / factor as usize * width as usize;
            let squares = line.chunks(factor as usize * bytes_per_pixel);
            for (pixel, square) in pixels[first..].iter_mut().zip(squares) {
                *pixel = (*pixel).max(brightest(square));
            }
        }
    };
    match order_of(format) {
        None => fill(&|square| levels_of(square, format).flatten().copied().max().unwrap_or(0)),
        Some(order) => {
            // Cameras of 10 or 12 bits use the low bits.
            let pairs = rows().flat_map(|row| pairs_of(row, format));
            let all = pairs.fold(0, |all, pair| all | sample(pair, order));
            let shift = (u16::BITS - all.leading_zeros()).saturating_sub(u8::BITS);
            let level = |pair: &[u8]| (sample(pair, order) >> shift) as u8;
            fill(&|square| pairs_of(square, format).map(level).max().unwrap_or(0));
        }
    }
    (width, height)
}

/// Returns the bytes of each pixel that are levels: neither alpha nor chroma.
fn levels_of(pixels: &[u8], format: PixelFormat) -> impl Iterator<Item = &[u8]> {
    let levels = match format {
        PixelFormat::Yuyv => 0..1,
        PixelFormat::Uyvy => 1..2,
        PixelFormat::Rgba8 | PixelFormat::Bgra8 => 0..3,
        PixelFormat::Rgba16(_) | PixelFormat::Bgra16(_) => 0..6,
        _ => 0..format.bytes_per_pixel(),
    };
    pixels.chunks_exact(format.bytes_per_pixel()).map(move |pixel| &pixel[levels.clone()])
}

/// Returns the 16-bit levels of all pixels as pairs of bytes.
fn pairs_of(pixels: &[u8], format: PixelFormat) -> impl Iterator<Item = &[u8]> {
    levels_of(pixels, format).flat_map(|levels| levels.chunks_exact(2))
}

/// Returns the byte order of samples of 16 bits; `None` if they have 8.
const fn order_of(format: PixelFormat) -> Option<ByteOrder> {
    match format {
        PixelFormat::Mono16(order)
        | PixelFormat::Bayer16(_, order)
        | PixelFormat::Rgb16(order)
        | PixelFormat::Bgr16(order)
        | PixelFormat::Rgba16(order)
        | PixelFormat::Bgra16(order) => Some(order),
        _ => None,
    }
}

fn sample(pair: &[u8], order: ByteOrder) -> u16 {
    let pair = [pair[0], pair[1]];
    match order {
        ByteOrder::Little => u16::from_le_bytes(pair),
        ByteOrder::Big => u16::from_be_bytes(pair),
    }
}

/// Scales annotations from an image to its preview. Their coordinates start at the corner of the image.
pub(crate) fn scale(annotations: &mut ImageAnnotations<'_>, factor: u32) {
    let factor = f64::from(factor.max(1));
    for point in annotations.points.iter_mut().flat_map(|line| &mut line.points) {
        point.x /= factor;
        point.y /= factor;
    }
    for circle in &mut annotations.circles {
        circle.position.x /= factor;
        circle.position.y /= factor;
        circle.diameter /= factor;
    }
    for text in &mut annotations.texts {
        text.position.x /= factor;
        text.position.y /= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::foxglove_msgs::{Point2, PointsAnnotation};

    fn reduced(image: &Image<'_>, factor: u32) -> (Vec<u8>, (u32, u32)) {
        let mut pixels = vec![99; 3];
        let size = reduce(image, factor, &mut pixels);
        (pixels, size)
    }

    #[test]
    fn each_pixel_is_the_brightest_of_its_square() {
        // Five columns and three rows with a step of six: the last squares are cut, and padding is ignored.
        let data = [1, 2, 3, 4, 5, 255, 9, 0, 0, 0, 0, 255, 7, 0, 8, 0, 6, 255];
        let image = Image::new(5, 3, 6, PixelFormat::Mono8, &data).unwrap();
        assert_eq!(reduced(&image, 2), (vec![9, 4, 5, 7, 8, 6], (3, 2)));
        let all = [&data[..5], &data[6..11], &data[12..17]].concat();
        assert_eq!(reduced(&image, 1), (all, (5, 3)));
    }

    #[test]
    fn twelve_bits_and_colours_become_eight_bits_of_grey() {
        let data: Vec<u8> = [4095_u16, 16, 160, 0].iter().flat_map(|v| v.to_be_bytes()).collect();
        let format = PixelFormat::Mono16(ByteOrder::Big);
        let image = Image::new(4, 1, 8, format, &data).unwrap();
        assert_eq!(reduced(&image, 1).0, [255, 1, 10, 0]);
        let image = Image::new(2, 1, 8, PixelFormat::Rgba8, &[1, 9, 2, 255, 0, 0, 3, 255]).unwrap();
        assert_eq!(reduced(&image, 1).0, [9, 3]);
        assert_eq!(reduced(&image, 2).0, [9]);
        let image = Image::new(2, 1, 6, PixelFormat::Bgr8, &[1, 9, 2, 0, 0, 3]).unwrap();
        assert_eq!(reduced(&image, 1).0, [9, 3]);
        // Chroma of 255 is not brightness, alpha of 65535 is none either.
        let image = Image::new(2, 1, 4, PixelFormat::Yuyv, &[7, 255, 8, 255]).unwrap();
        assert_eq!(reduced(&image, 1).0, [7, 8]);
        let image = Image::new(2, 1, 4, PixelFormat::Uyvy, &[255, 7, 255, 8]).unwrap();
        assert_eq!(reduced(&image, 1).0, [7, 8]);
        let deep: Vec<u8> =
            [16, 4095, 0, 65_535_u16].iter().flat_map(|v| v.to_le_bytes()).collect();
        let format = PixelFormat::Rgba16(ByteOrder::Little);
        let image = Image::new(1, 1, 8, format, &deep).unwrap();
        assert_eq!(reduced(&image, 1).0, [255]);
    }

    #[test]
    fn no_preview_exceeds_the_largest_width() {
        for width in [1_u32, 640, 641, 2592, 65_535] {
            assert!(width.div_ceil(factor(width)) <= MAX_WIDTH_PX, "{width}");
        }
        assert_eq!([factor(0), factor(640), factor(641), factor(2592)], [1, 1, 2, 5]);
    }

    #[test]
    fn annotations_are_scaled_with_the_image() {
        let line = PointsAnnotation {
            points: vec![Point2 { x: 10.5, y: 4.0 }],
            ..PointsAnnotation::default()
        };
        let mut drawn = ImageAnnotations { points: vec![line], ..ImageAnnotations::default() };
        scale(&mut drawn, 5);
        let Point2 { x, y } = drawn.points[0].points[0];
        assert!((x - 2.1).abs() < 1e-12 && (y - 0.8).abs() < 1e-12, "{x} {y}");
    }
}
