//! Decodes picture files of every kind into a buffer that is reused between frames.

use image::{
    ColorType, ImageDecoder, ImageResult, Limits,
    codecs::{bmp::BmpDecoder, png::PngDecoder, pnm::PnmDecoder, tiff::TiffDecoder},
};

use super::{
    file_kind::{FileKind, reader},
    frame::FrameRejected,
    jpeg,
    strict_jpeg::StrictJpeg,
};
use crate::scanner::image::{ByteOrder, Image, PixelFormat};

/// Byte order of the 16-bit samples from a decoder.
pub(super) const NATIVE: ByteOrder =
    if cfg!(target_endian = "big") { ByteOrder::Big } else { ByteOrder::Little };

/// Memory that a decoder may always use for its own buffers: 64 KiB.
const MIN_DECODER_BYTES: u64 = 1 << 16;

/// Size and pixel format of a decoded image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    width: u32,
    height: u32,
    pub(super) format: PixelFormat,
}

impl Shape {
    /// Columns and rows.
    pub(crate) const fn size_px(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Memory layout of a pixel.
    pub(crate) const fn format(&self) -> PixelFormat {
        self.format
    }

    /// Views `pixels` as an image of this shape.
    ///
    /// # Errors
    /// The length of `pixels` does not match.
    pub(crate) fn image<'a>(&self, pixels: &'a [u8]) -> Result<Image<'a>, FrameRejected> {
        let &Self { width, height, format } = self;
        let step = width.saturating_mul(format.bytes_per_pixel() as u32);
        Ok(Image::new(width, height, step, format, pixels)?)
    }
}

/// Decodes a file of this kind into `pixels`: grey with 8 or 16 bits, or colour with 8 or 16 bits and with or without
/// alpha. Alpha of grey pixels is left out.
///
/// Allocates no pixels before the size in the file's header is checked against `max_frame_bytes`; the decoders use a small
/// multiple of that.
///
/// # Errors
/// A size above the limit, pixels that are not supported, or a damaged file.
pub(super) fn decode(
    kind: FileKind,
    data: &[u8],
    max_frame_bytes: u64,
    pixels: &mut Vec<u8>,
) -> Result<Shape, FrameRejected> {
    let file = File { kind, length: data.len(), max_frame_bytes };
    match kind {
        FileKind::Png => file.read(PngDecoder::with_limits(reader(data), file.limits()), pixels),
        FileKind::Jpeg => {
            let whole = jpeg::whole(data);
            let whole = whole.ok_or(FrameRejected::Truncated { length: data.len() })?;
            file.read(StrictJpeg::new(whole), pixels)
        }
        FileKind::Tiff => file.read(TiffDecoder::new(reader(data)), pixels),
        FileKind::Bmp => {
            let mut shape = file.read(BmpDecoder::new(reader(data)), pixels)?;
            if shape.format == PixelFormat::Rgb8 && has_grey_palette(data) {
                keep_samples(pixels, 3, 1);
                shape.format = PixelFormat::Mono8;
            }
            Ok(shape)
        }
        FileKind::Pnm => file.read(PnmDecoder::new(reader(data)), pixels),
    }
}

/// A picture file and the limit of its pixels.
struct File {
    kind: FileKind,
    length: usize,
    max_frame_bytes: u64,
}

impl File {
    /// Limits of the decoder's own buffers.
    fn limits(&self) -> Limits {
        let largest = match self.kind {
            FileKind::Png | FileKind::Jpeg => self.max_frame_bytes,
            // These decoders count the pixels, too, and hold a strip or tile beside them.
            FileKind::Tiff | FileKind::Bmp | FileKind::Pnm => {
                self.max_frame_bytes.saturating_mul(2)
            }
        };
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(largest.max(MIN_DECODER_BYTES));
        limits
    }

    fn read<D: ImageDecoder>(
        &self,
        decoder: ImageResult<D>,
        pixels: &mut Vec<u8>,
    ) -> Result<Shape, FrameRejected> {
        let &Self { kind, length, max_frame_bytes } = self;
        let broken = |reason| FrameRejected::File { kind, length, reason };
        let mut decoder = decoder.map_err(broken)?;
        let (width, height) = decoder.dimensions();
        let color = decoder.color_type();
        let bytes = decoder.total_bytes();
        if bytes > max_frame_bytes {
            return Err(FrameRejected::TooLarge { width, height, bytes, max_frame_bytes });
        }
        decoder.set_limits(self.limits()).map_err(broken)?;
        // Zeroed, so that a partial frame contains no pixels of an earlier one. The PNG decoder fills all pixels or fails.
        if kind != FileKind::Png {
            pixels.clear();
        }
        pixels.resize(bytes as usize, 0);
        decoder.read_image(pixels).map_err(broken)?;
        let format = match color {
            ColorType::L8 => PixelFormat::Mono8,
            ColorType::L16 => PixelFormat::Mono16(NATIVE),
            ColorType::La8 => {
                keep_samples(pixels, 2, 1);
                PixelFormat::Mono8
            }
            ColorType::La16 => {
                keep_samples(pixels, 4, 2);
                PixelFormat::Mono16(NATIVE)
            }
            ColorType::Rgb8 => PixelFormat::Rgb8,
            ColorType::Rgba8 => PixelFormat::Rgba8,
            ColorType::Rgb16 => PixelFormat::Rgb16(NATIVE),
            ColorType::Rgba16 => PixelFormat::Rgba16(NATIVE),
            _ => return Err(FrameRejected::Color { kind, color }),
        };
        Ok(Shape { width, height, format })
    }
}

/// Keeps the first bytes of every pixel.
fn keep_samples(pixels: &mut Vec<u8>, bytes_per_pixel: usize, kept: usize) {
    let num_pixels = pixels.len() / bytes_per_pixel;
    for pixel in 0..num_pixels {
        let from = pixel * bytes_per_pixel;
        pixels.copy_within(from..from + kept, pixel * kept);
    }
    pixels.truncate(num_pixels * kept);
}

/// True for a bitmap with a palette of grey levels, which the decoder expands to colours.
fn has_grey_palette(file: &[u8]) -> bool {
    let u16_at = |at: usize| Some(u16::from_le_bytes(*file.get(at..)?.first_chunk()?));
    let u32_at = |at: usize| Some(u32::from_le_bytes(*file.get(at..)?.first_chunk()?));
    let palette = || {
        // The file header has 14 bytes; the information header begins with its length.
        let (data_at, header_bytes, bits) = (u32_at(10)?, u32_at(14)?, u16_at(28)?);
        let palette = file.get(14_usize.checked_add(header_bytes as usize)?..data_at as usize)?;
        (bits <= 8 && header_bytes >= 40).then_some(palette)
    };
    palette().is_some_and(|palette| {
        let mut colors = palette.chunks_exact(4).peekable();
        colors.peek().is_some()
            && colors.all(
                |color| matches!(color, [blue, green, red, _] if blue == green && green == red),
            )
    })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use image::{
        DynamicImage, GrayImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, RgbImage, Rgba,
        RgbaImage,
    };

    use super::*;

    const LIMIT: u64 = 1 << 20;

    fn file(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        picture.write_to(&mut file, format).unwrap();
        file.into_inner()
    }

    fn grey() -> DynamicImage {
        GrayImage::from_fn(5, 3, |x, y| Luma([(40 * x + 9 * y) as u8])).into()
    }

    fn deep() -> DynamicImage {
        ImageBuffer::from_fn(5, 3, |x, y| Luma([(9000 * x + 77 * y) as u16])).into()
    }

    fn colored() -> DynamicImage {
        RgbImage::from_fn(5, 3, |x, y| Rgb([x as u8, 100 + y as u8, 255])).into()
    }

    fn decoded(file: &[u8]) -> Result<(PixelFormat, Vec<u8>), FrameRejected> {
        let mut pixels = vec![9; 70];
        let shape = decode(FileKind::of(file).unwrap(), file, LIMIT, &mut pixels)?;
        assert_eq!(shape.size_px(), [5, 3]);
        Ok((shape.format(), pixels))
    }

    #[test]
    fn files_decode_exactly() {
        let kinds = [
            (ImageFormat::Png, FileKind::Png),
            (ImageFormat::Tiff, FileKind::Tiff),
            (ImageFormat::Bmp, FileKind::Bmp),
            (ImageFormat::Pnm, FileKind::Pnm),
        ];
        for (format, kind) in kinds {
            for (picture, expected) in [
                (grey(), PixelFormat::Mono8),
                (deep(), PixelFormat::Mono16(NATIVE)),
                (colored(), PixelFormat::Rgb8),
            ] {
                if kind == FileKind::Bmp && expected == PixelFormat::Mono16(NATIVE) {
                    continue;
                }
                let file = file(&picture, format);
                assert_eq!(FileKind::of(&file), Some(kind));
                assert_eq!(kind.size_px(&file).unwrap(), [5, 3]);
                let (found, pixels) = decoded(&file).unwrap();
                assert_eq!(found, expected, "{kind}");
                assert_eq!(pixels, picture.as_bytes(), "{kind} {expected:?}");
            }
        }
    }

    #[test]
    fn alpha_is_dropped_or_kept_as_such() {
        let alpha: DynamicImage =
            RgbaImage::from_fn(5, 3, |x, y| Rgba([x as u8, y as u8, 7, 200])).into();
        let (format, pixels) = decoded(&file(&alpha, ImageFormat::Tiff)).unwrap();
        assert_eq!((format, &*pixels), (PixelFormat::Rgba8, alpha.as_bytes()));
        let grey_alpha: DynamicImage =
            ImageBuffer::from_fn(5, 3, |x, y| LumaA([(40 * x + 9 * y) as u8, 7])).into();
        let (format, pixels) = decoded(&file(&grey_alpha, ImageFormat::Png)).unwrap();
        assert_eq!((format, &*pixels), (PixelFormat::Mono8, grey().as_bytes()));
        // A PAM file of grey with alpha.
        let mut pam =
            b"P7\nWIDTH 5\nHEIGHT 3\nDEPTH 2\nMAXVAL 255\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n"
                .to_vec();
        pam.extend((0..15).flat_map(|level| [level * 10, 255]));
        let (format, pixels) = decoded(&pam).unwrap();
        assert_eq!(format, PixelFormat::Mono8);
        assert_eq!(pixels, (0..15).map(|level| level * 10).collect::<Vec<u8>>());
    }

    #[test]
    fn text_and_other_scales_are_read() {
        let (format, pixels) =
            decoded(b"P2\n# of a camera\n5 3\n255\n0 1 2 3 4 5 6 7 8 9 10 11 12 13 255\n").unwrap();
        assert_eq!((format, pixels[14]), (PixelFormat::Mono8, 255));
        let mut twelve_bit = b"P5 5 3 4095\n".to_vec();
        twelve_bit.extend([0x0f, 0xff].repeat(15));
        let (format, pixels) = decoded(&twelve_bit).unwrap();
        assert_eq!(
            (format, pixels),
            (PixelFormat::Mono16(NATIVE), vec![0xff; 30]),
            "white is white"
        );
    }

    /// Pixels of the picture before are never shown: the decoder fills all of them or fails.
    #[test]
    fn png_files_with_too_few_pixels_are_rejected() {
        // 5 x 4 pixels: data for two rows, and an animation whose first frame has 2 x 2.
        let short = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x05\x00\x00\x00\x04\x08\x00\x00\x00\x00cX\xaa\x9c\
            \x00\x00\x00\x0eIDATx\x9cc`\x07\x01\x060\t\x00\x01\xb0\x00G\xfe/\x03%\
            \x00\x00\x00\x00IEND\xaeB`\x82";
        let part = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x05\x00\x00\x00\x04\x08\x00\x00\x00\x00cX\xaa\x9c\
            \x00\x00\x00\x08acTL\x00\x00\x00\x01\x00\x00\x00\x00\xb4-\xe9\xa0\
            \x00\x00\x00\x1afcTL\x00\x00\x00\x00\x00\x00\x00\x02\x00\x00\x00\x02\x00\x00\x00\x00\x00\x00\x00\x00\
            \x00\x01\x00\x01\x00\x00\xe4\x013\xe1\
            \x00\x00\x00\x0eIDATx\x9cc`\x07\x01\x06\x0c\x12\x00\x06\xa8\x00\x8d\x0c\xae\xdf\x84\
            \x00\x00\x00\x00IEND\xaeB`\x82";
        for (file, reason) in [(&short[..], "NoMoreImageData"), (&part[..], "BadSubFrameBounds")] {
            let error = decode(FileKind::Png, file, LIMIT, &mut vec![9; 20]).unwrap_err();
            assert!(format!("{error:?}").contains(reason), "{error:?}");
        }
    }

    #[test]
    fn damaged_and_false_files_are_rejected() {
        for format in [ImageFormat::Tiff, ImageFormat::Bmp, ImageFormat::Pnm] {
            let whole = file(&grey(), format);
            for length in [8, whole.len() / 2, whole.len() - 1] {
                let kind = FileKind::of(&whole).unwrap();
                let rejected = decode(kind, &whole[..length], LIMIT, &mut Vec::new());
                // The directory of a TIFF file may lie before its last byte.
                let is_whole = format == ImageFormat::Tiff && length == whole.len() - 1;
                assert!(is_whole || rejected.is_err(), "{format:?} {length}");
            }
        }
        let mut pixels = Vec::new();
        let file_of_gigabytes = b"P5 60000 60000 255\n";
        let error = decode(FileKind::Pnm, file_of_gigabytes, LIMIT, &mut pixels).unwrap_err();
        assert!(matches!(error, FrameRejected::TooLarge { width: 60_000, .. }), "{error}");
        assert_eq!(pixels.capacity(), 0);
        let float = ImageBuffer::<Rgb<f32>, _>::from_fn(5, 3, |_, _| Rgb([0.5_f32; 3]));
        let error = decoded(&file(&float.into(), ImageFormat::Tiff)).unwrap_err();
        assert!(error.to_string().starts_with("TIFF image has Rgb32F pixels"), "{error}");
    }
}
