//! A JPEG decoder that rejects damaged data. That of `image` fills in grey for what it cannot decode.

use image::{
    ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult,
    error::{DecodingError, ImageFormatHint},
};
use zune_jpeg::{
    JpegDecoder,
    errors::DecodeErrors,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

/// A file whose header has been read.
pub(super) struct StrictJpeg<'a> {
    file: &'a [u8],
    size_px: [u32; 2],
    /// Grey, or RGB for everything else.
    colors: ColorSpace,
}

impl<'a> StrictJpeg<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// The header is damaged.
    pub(super) fn new(file: &'a [u8]) -> ImageResult<Self> {
        let mut decoder = decoder(file, ColorSpace::RGB);
        decoder.decode_headers().map_err(broken)?;
        let (width, height) = decoder.dimensions().unwrap_or_default();
        let colors = match decoder.input_colorspace() {
            Some(ColorSpace::Luma) => ColorSpace::Luma,
            _ => ColorSpace::RGB,
        };
        // The format has 16 bits for either.
        Ok(Self { file, size_px: [width as u32, height as u32], colors })
    }
}

impl ImageDecoder for StrictJpeg<'_> {
    fn dimensions(&self) -> (u32, u32) {
        self.size_px.into()
    }

    fn color_type(&self) -> ColorType {
        if self.colors == ColorSpace::Luma { ColorType::L8 } else { ColorType::Rgb8 }
    }

    fn read_image(self, pixels: &mut [u8]) -> ImageResult<()> {
        decoder(self.file, self.colors).decode_into(pixels).map_err(broken)
    }

    fn read_image_boxed(self: Box<Self>, pixels: &mut [u8]) -> ImageResult<()> {
        self.read_image(pixels)
    }
}

fn decoder(file: &[u8], colors: ColorSpace) -> JpegDecoder<ZCursor<&[u8]>> {
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(usize::MAX)
        .set_max_height(usize::MAX)
        .jpeg_set_out_colorspace(colors);
    JpegDecoder::new_with_options(ZCursor::new(file), options)
}

fn broken(error: DecodeErrors) -> ImageError {
    let format = ImageFormatHint::Exact(ImageFormat::Jpeg);
    ImageError::Decoding(DecodingError::new(format, error.to_string()))
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageBuffer, Luma, Rgb};

    use super::*;

    fn pictures() -> [DynamicImage; 2] {
        let grey = ImageBuffer::from_fn(97, 61, |x, y| Luma([(x * y % 251) as u8]));
        let colored =
            ImageBuffer::from_fn(97, 61, |x, y| Rgb([x as u8, (2 * y) as u8, (x ^ y) as u8]));
        [grey.into(), colored.into()]
    }

    fn file(picture: &DynamicImage) -> Vec<u8> {
        let mut file = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut file, ImageFormat::Jpeg).unwrap();
        file.into_inner()
    }

    fn decoded(file: &[u8]) -> ImageResult<DynamicImage> {
        DynamicImage::from_decoder(StrictJpeg::new(file)?)
    }

    #[test]
    fn sound_files_are_those_of_the_usual_decoder() {
        for picture in pictures() {
            let file = file(&picture);
            let expected = image::load_from_memory(&file).unwrap();
            assert_eq!(decoded(&file).unwrap(), expected);
        }
    }

    #[test]
    fn data_that_end_early_are_rejected_although_the_file_has_its_end() {
        for picture in pictures() {
            let file = file(&picture);
            for part in [0.5, 0.7, 0.9] {
                let kept = (part * file.len() as f64) as usize;
                let cut = [&file[..kept], &[0xff, 0xd9]].concat();
                assert!(decoded(&cut).is_err(), "{part}");
            }
        }
    }
}
