use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::*;
use crate::scanner::image::BayerPattern;

const LIMIT: u64 = 1 << 20;

fn png(width: u32, height: u32, pixels: &[u8], color: ExtendedColorType) -> Vec<u8> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(pixels, width, height, color).unwrap();
    file
}

fn jpeg(width: u32, height: u32, pixels: &[u8], color: ExtendedColorType) -> Vec<u8> {
    let mut file = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 100)
        .write_image(pixels, width, height, color)
        .unwrap();
    file
}

fn message<'a>(format: &'a str, data: &'a [u8]) -> CompressedImage<'a> {
    CompressedImage { format: format.into(), data, ..Default::default() }
}

#[test]
fn png_decodes_exactly() {
    let grey: Vec<u8> = (0..6).collect();
    let deep: Vec<u8> =
        [1, 500, 65535, 256, 0, 7].iter().flat_map(|v: &u16| v.to_ne_bytes()).collect();
    let color: Vec<u8> = (0..18).collect();
    let alpha: Vec<u8> = (0..24).collect();
    let bayer8 = PixelFormat::Bayer8(BayerPattern::Gbrg);
    let mut pixels = vec![9; 100];
    for (format, file, expected, samples) in [
        ("png", png(3, 2, &grey, ExtendedColorType::L8), PixelFormat::Mono8, &grey),
        (
            "mono16; png compressed ",
            png(3, 2, &deep, ExtendedColorType::L16),
            PixelFormat::Mono16(NATIVE),
            &deep,
        ),
        (
            "bgr8; png compressed bgr8",
            png(3, 2, &color, ExtendedColorType::Rgb8),
            PixelFormat::Rgb8,
            &color,
        ),
        ("PNG", png(3, 2, &alpha, ExtendedColorType::Rgba8), PixelFormat::Rgba8, &alpha),
        (
            "rgb16; png compressed ",
            png(1, 2, &deep, ExtendedColorType::Rgb16),
            PixelFormat::Rgb16(NATIVE),
            &deep,
        ),
        ("bayer_gbrg8; png compressed ", png(3, 2, &grey, ExtendedColorType::L8), bayer8, &grey),
    ] {
        let image = image(&message(format, &file), LIMIT, &mut pixels).unwrap();
        assert_eq!((image.height(), image.format()), (2, expected), "{format}");
        assert_eq!(image.data(), samples, "{format}");
    }
}

#[test]
fn jpeg_decodes_approximately() {
    // 16 x 8 pixels: whole blocks, each of a single colour.
    let grey: Vec<u8> = (0..128).map(|i| if i % 16 < 8 { 40 } else { 200 }).collect();
    let color: Vec<u8> = grey.iter().flat_map(|&v| [v, 100, 255 - v]).collect();
    for (format, file, expected, samples) in [
        ("jpeg", jpeg(16, 8, &grey, ExtendedColorType::L8), PixelFormat::Mono8, &grey),
        (
            "mono8; jpeg compressed ",
            jpeg(16, 8, &grey, ExtendedColorType::L8),
            PixelFormat::Mono8,
            &grey,
        ),
        (
            "rgb8; jpeg compressed bgr8",
            jpeg(16, 8, &color, ExtendedColorType::Rgb8),
            PixelFormat::Rgb8,
            &color,
        ),
    ] {
        let mut pixels = Vec::new();
        let image = image(&message(format, &file), LIMIT, &mut pixels).unwrap();
        assert_eq!((image.width(), image.height(), image.format()), (16, 8, expected), "{format}");
        let farthest = image.data().iter().zip(samples).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(farthest.unwrap() <= 8, "{format}: {farthest:?}");
    }
}

#[test]
fn false_sizes_are_rejected_before_allocation() {
    let mut false_jpeg = jpeg(16, 8, &[0; 128], ExtendedColorType::L8);
    let frame = false_jpeg.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
    false_jpeg[frame + 5..frame + 9].fill(0xff);
    // Width and height of the header chunk, and its checksum (computed with zlib).
    let mut false_png = png(3, 2, &[0; 6], ExtendedColorType::L8);
    false_png[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
    false_png[29..33].copy_from_slice(&[0x93, 0x6e, 0x86, 0x8c]);
    for (format, file) in [("jpeg", false_jpeg), ("png", false_png)] {
        let mut pixels = Vec::new();
        let error = image(&message(format, &file), LIMIT, &mut pixels).unwrap_err();
        assert!(
            matches!(error, FrameRejected::TooLarge { width: 65535, height: 65535, .. }),
            "{format}: {error}"
        );
        assert_eq!(pixels.capacity(), 0, "{format}");
    }
}

#[test]
fn damaged_and_unknown_files_are_rejected() {
    let grey: Vec<u8> = (0..128).collect();
    let jpeg = jpeg(16, 8, &grey, ExtendedColorType::L8);
    let png = png(16, 8, &grey, ExtendedColorType::L8);
    let rejected = |format: &str, data: &[u8]| {
        image(&message(format, data), LIMIT, &mut Vec::new()).unwrap_err()
    };
    for length in 2..jpeg.len() {
        let error = rejected("jpeg", &jpeg[..length]);
        assert!(matches!(error, FrameRejected::Truncated { .. }), "{length}: {error}");
    }
    for length in 8..png.len() - 16 {
        let error = rejected("png", &png[..length]);
        assert!(
            matches!(error, FrameRejected::File { kind: FileKind::Png, .. }),
            "{length}: {error}"
        );
    }
    assert!(matches!(rejected("jpeg", b"\xff\xd8\xff\xd9"), FrameRejected::File { .. }));
    for too_short in [&jpeg[..1], &png[..7], &[0xff, 0xd9]] {
        assert!(matches!(rejected("jpeg", too_short), FrameRejected::Format(_)));
    }
    let depth = [&[0; 12], &png[..]].concat();
    assert!(matches!(rejected("16UC1; compressedDepth png", &depth), FrameRejected::Format(_)));
}

/// Labels of `image_transport`, Lichtblick, `usb_cam` and hand-written publishers, some of them wrong.
#[test]
fn the_data_decide_not_the_label() {
    let grey: Vec<u8> = (0..128).collect();
    let jpeg = jpeg(16, 8, &grey, ExtendedColorType::L8);
    let png = png(16, 8, &grey, ExtendedColorType::L8);
    for label in [
        "",
        ";",
        "jpeg",
        "JPG",
        "png",
        "image/jpeg",
        "mjpeg",
        "tiff",
        "mono8",
        "rgb8; jpeg compressed; bgr8",
        "mono8; png compressed ",
        "16UC1; compressedDepth",
    ] {
        for (file, exact) in [(&jpeg, false), (&png, true)] {
            let mut pixels = Vec::new();
            let message = message(label, file);
            let image = image(&message, LIMIT, &mut pixels).unwrap();
            assert_eq!(image.format(), PixelFormat::Mono8, "{label}");
            let near = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= if exact { 0 } else { 4 };
            assert!(image.data().iter().zip(&grey).all(near), "{label}");
        }
    }
}

/// The encoder's tables are those of T.81, Annex K.3, so that the file without them means the same.
#[test]
fn a_jpeg_without_huffman_tables_decodes_like_the_one_with_them() {
    let colors: Vec<u8> = (0..3 * 64 * 32).map(|at: u32| (at * at / 57) as u8).collect();
    for (pixels, color) in
        [(&colors[..], ExtendedColorType::Rgb8), (&colors[..64 * 32], ExtendedColorType::L8)]
    {
        let whole = jpeg(64, 32, pixels, color);
        let mut bare = whole.clone();
        let mut num_tables = 0;
        while let Some(at) = bare.windows(2).position(|pair| pair == [0xff, 0xc4]) {
            let length = usize::from(u16::from_be_bytes([bare[at + 2], bare[at + 3]]));
            bare.drain(at..at + 2 + length);
            num_tables += 1;
        }
        assert!(num_tables > 0);
        bare.extend(b"\0\0APPENDED\xff\xd9");
        let decoded = |file: &[u8]| {
            let mut pixels = Vec::new();
            image(&message("mjpeg", file), LIMIT, &mut pixels).map(drop).map(|()| pixels)
        };
        assert_eq!(decoded(&bare).unwrap(), decoded(&whole).unwrap());
    }
}

#[test]
fn padded_jpeg_is_accepted() {
    let mut padded = jpeg(16, 8, &[7; 128], ExtendedColorType::L8);
    padded.extend([0; 5]);
    assert!(image(&message("jpeg", &padded), LIMIT, &mut Vec::new()).is_ok());
}

#[test]
fn the_header_names_kind_size_and_pixels() {
    let files = [
        (jpeg(16, 8, &[7; 3 * 128], ExtendedColorType::Rgb8), "jpeg rgb8"),
        (png(16, 8, &[7; 256], ExtendedColorType::L16), "png mono16"),
        ([&b"P5 16 8 255\n"[..], &[7; 128]].concat(), "pnm mono8"),
    ];
    for (file, expected) in files {
        let Kind { width, height, encoding } = kind(&message("", &file)).unwrap();
        assert_eq!((width, height, &*encoding), (16, 8, expected));
    }
}
