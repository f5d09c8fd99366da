//! A JPEG decoder that rejects damaged data. That of `image` fills in grey for what it cannot decode.
//!
//! Even a strict decoder takes an early end-of-image marker for the end. So of pictures with one scan it gets the data without
//! that marker: data that end early then end the file.

use std::borrow::Cow;

use image::{
    ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult,
    error::{DecodingError, ImageFormatHint},
};
use zune_jpeg::{
    JpegDecoder,
    errors::DecodeErrors,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

use super::jpeg::Whole;

/// Zeros in place of the end: the decoder reads ahead by so many bytes.
const AHEAD: [u8; 8] = [0; 8];
const END_BYTES: usize = 2;

/// A file whose header has been read.
pub(super) struct StrictJpeg<'a> {
    file: Cow<'a, [u8]>,
    size_px: [u32; 2],
    /// Grey, or RGB for everything else.
    colors: ColorSpace,
}

impl<'a> StrictJpeg<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// The header is damaged.
    pub(super) fn new(Whole { picture, is_progressive }: Whole<'a>) -> ImageResult<Self> {
        let file = match picture.len().checked_sub(END_BYTES).and_then(|end| picture.get(..end)) {
            Some(data) if !is_progressive => Cow::Owned([data, &AHEAD].concat()),
            _ => picture,
        };
        let mut decoder = decoder(&file, ColorSpace::RGB);
        decoder.decode_headers().map_err(|error| broken(&error))?;
        let (width, height) = decoder.dimensions().unwrap_or_default();
        let colors = match decoder.input_colorspace() {
            Some(ColorSpace::Luma) => ColorSpace::Luma,
            _ => ColorSpace::RGB,
        };
        // JPEG states sizes with 16 bits.
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
        decoder(&self.file, self.colors).decode_into(pixels).map_err(|error| broken(&error))
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

fn broken(error: &DecodeErrors) -> ImageError {
    let format = ImageFormatHint::Exact(ImageFormat::Jpeg);
    ImageError::Decoding(DecodingError::new(format, error.to_string()))
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageBuffer, Luma, Rgb};

    use super::*;
    use crate::msg::convert::jpeg;

    const SIZES: [[u32; 2]; 6] = [[97, 61], [8, 8], [16, 8], [1, 1], [640, 24], [9, 400]];

    fn grey([width, height]: [u32; 2]) -> DynamicImage {
        ImageBuffer::from_fn(width, height, |x, y| Luma([(x * y % 251) as u8])).into()
    }

    fn colored([width, height]: [u32; 2]) -> DynamicImage {
        let levels = |x, y| Rgb([x as u8, (2 * y) as u8, (x ^ y) as u8]);
        ImageBuffer::from_fn(width, height, levels).into()
    }

    fn dark([width, height]: [u32; 2]) -> DynamicImage {
        DynamicImage::new_luma8(width, height)
    }

    fn file(picture: &DynamicImage) -> Vec<u8> {
        let mut file = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut file, ImageFormat::Jpeg).unwrap();
        file.into_inner()
    }

    fn decoded(file: &[u8]) -> ImageResult<DynamicImage> {
        DynamicImage::from_decoder(StrictJpeg::new(jpeg::whole(file).unwrap())?)
    }

    #[test]
    fn sound_files_are_those_of_the_usual_decoder() {
        let pictures = SIZES.into_iter().flat_map(|size| [grey(size), colored(size), dark(size)]);
        for picture in pictures {
            let file = file(&picture);
            let expected = image::load_from_memory(&file).unwrap();
            assert_eq!(decoded(&file).unwrap(), expected);
        }
    }

    #[test]
    fn data_that_end_early_are_rejected_although_the_file_has_its_end() {
        for picture in [grey([320, 240]), colored([320, 240])] {
            let file = file(&picture);
            for part in [0.4, 0.6, 0.9] {
                let kept = (part * file.len() as f64) as usize;
                let cut = [&file[..kept], &[0xff, 0xd9]].concat();
                assert!(decoded(&cut).is_err(), "{part}");
            }
        }
    }
}
