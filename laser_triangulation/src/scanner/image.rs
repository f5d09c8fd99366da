//! A camera image in a message's buffer: a checked view, never a copy.
//!
//! Pixel coordinates are (column, row); (0, 0) is the *centre* of the top-left pixel.

use thiserror::Error;

/// Longest side of an image, pixels. Positions in a centreline are 32-bit floats: they resolve 1/256 pixel there.
pub const MAX_SIDE_PX: u32 = 65_535;

/// Byte order of samples wider than one byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// Colours of the four pixels of a Bayer cell: top-left, top-right, bottom-left, bottom-right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BayerPattern {
    /// Red, green, green, blue.
    Rggb,
    /// Blue, green, green, red.
    Bggr,
    /// Green, blue, red, green.
    Gbrg,
    /// Green, red, blue, green.
    Grbg,
}

/// Memory layout of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// One 8-bit grey sample (`mono8`, `8UC1`).
    Mono8,
    /// One 16-bit grey sample (`mono16`, `16UC1`).
    Mono16(ByteOrder),
    /// Red, green, blue, 8 bit each.
    Rgb8,
    /// Blue, green, red, 8 bit each.
    Bgr8,
    /// Red, green, blue, alpha, 8 bit each; alpha is ignored.
    Rgba8,
    /// Blue, green, red, alpha, 8 bit each; alpha is ignored.
    Bgra8,
    /// One 8-bit sample behind a colour filter array.
    Bayer8(BayerPattern),
    /// One 16-bit sample behind a colour filter array.
    Bayer16(BayerPattern, ByteOrder),
    /// Red, green, blue, 16 bit each.
    Rgb16(ByteOrder),
    /// Blue, green, red, 16 bit each.
    Bgr16(ByteOrder),
    /// Red, green, blue, alpha, 16 bit each; alpha is ignored.
    Rgba16(ByteOrder),
    /// Blue, green, red, alpha, 16 bit each; alpha is ignored.
    Bgra16(ByteOrder),
    /// YUV 4:2:2, luma first: Y U Y V for two pixels, 8 bit each; chroma is ignored.
    Yuyv,
    /// YUV 4:2:2, chroma first: U Y V Y for two pixels, 8 bit each; chroma is ignored.
    Uyvy,
    /// The luma plane of a planar or semi-planar YUV image (NV12, I420), 8 bit.
    Luma8,
}

/// White of 8-bit YUV of limited range, as most cameras send it: ITU-R BT.601 has black at 16 and white at 235.
const WHITE_LUMA: u32 = 235;

impl PixelFormat {
    /// Bytes a pixel takes.
    pub const fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Mono8 | Self::Bayer8(_) | Self::Luma8 => 1,
            Self::Mono16(_) | Self::Bayer16(..) | Self::Yuyv | Self::Uyvy => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
            Self::Rgb16(_) | Self::Bgr16(_) => 6,
            Self::Rgba16(_) | Self::Bgra16(_) => 8,
        }
    }

    /// Largest value a sample can hold: 255 or 65535.
    pub const fn max_level(self) -> u32 {
        match self {
            Self::Mono16(_)
            | Self::Bayer16(..)
            | Self::Rgb16(_)
            | Self::Bgr16(_)
            | Self::Rgba16(_)
            | Self::Bgra16(_) => 65_535,
            _ => 255,
        }
    }

    /// Level from which a sample counts as saturated unless the parameter `full_scale` states another: 235 for YUV, whose
    /// samples do not tell whether white is 235 or 255, otherwise the largest level.
    pub const fn white_level(self) -> u32 {
        if self.is_yuv() { WHITE_LUMA } else { self.max_level() }
    }

    /// True if a pixel is luma and chroma.
    pub(crate) const fn is_yuv(self) -> bool {
        matches!(self, Self::Yuyv | Self::Uyvy | Self::Luma8)
    }

    /// True if a pixel has a red, a green and a blue level. Grey images have none; of YUV images the luma alone is read.
    pub const fn has_colors(self) -> bool {
        !(self.is_yuv() || matches!(self, Self::Mono8 | Self::Mono16(_)))
    }
}

/// Reasons why a buffer is not an image.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ImageError {
    /// Width or height is zero.
    #[error("image is {width} x {height} pixels: both sides must be at least 1")]
    Empty {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A side is longer than the maximum.
    #[error("image is {width} x {height} pixels: sides may have at most {MAX_SIDE_PX}")]
    TooLong {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A row does not fit into its step.
    #[error("step is {step} bytes, but a row of {width} pixels needs at least {needed}")]
    Step {
        /// Bytes from one row to the next, as stated.
        step: u64,
        /// Columns.
        width: u32,
        /// Bytes that a row needs.
        needed: u64,
    },
    /// The buffer is shorter or longer than height x step.
    #[error("data has {actual} bytes, but {height} rows with a step of {step} bytes make {needed}")]
    Length {
        /// Bytes in the buffer.
        actual: u64,
        /// Rows.
        height: u32,
        /// Bytes from one row to the next.
        step: u64,
        /// Bytes expected.
        needed: u64,
    },
}

/// A borrowed image whose size, step and length have been checked to agree.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    width: u32,
    height: u32,
    step: usize,
    format: PixelFormat,
    data: &'a [u8],
}

impl<'a> Image<'a> {
    /// Views `data` as `height` rows of `width` pixels, rows `step` bytes apart.
    ///
    /// # Errors
    /// A side of zero or longer than [`MAX_SIDE_PX`], a step shorter than a row, or a buffer whose length is not `height * step`.
    pub fn new(
        width: u32,
        height: u32,
        step: u32,
        format: PixelFormat,
        data: &'a [u8],
    ) -> Result<Self, ImageError> {
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { width, height });
        }
        if width.max(height) > MAX_SIDE_PX {
            return Err(ImageError::TooLong { width, height });
        }
        let needed = u64::from(width) * format.bytes_per_pixel() as u64;
        if u64::from(step) < needed {
            return Err(ImageError::Step { step: step.into(), width, needed });
        }
        let needed = u64::from(height) * u64::from(step);
        if data.len() as u64 != needed {
            return Err(ImageError::Length {
                actual: data.len() as u64,
                height,
                step: step.into(),
                needed,
            });
        }
        Ok(Self { width, height, step: step as usize, format, data })
    }

    /// Views `data` as `height` rows of `width` pixels without padding.
    ///
    /// # Errors
    /// A side of zero or longer than [`MAX_SIDE_PX`], or a buffer of another length than the pixels need.
    pub fn packed(
        width: u32,
        height: u32,
        format: PixelFormat,
        data: &'a [u8],
    ) -> Result<Self, ImageError> {
        let step = width.saturating_mul(format.bytes_per_pixel() as u32);
        Self::new(width, height, step, format, data)
    }

    /// Columns.
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Bytes from one row to the next.
    pub const fn step(&self) -> usize {
        self.step
    }

    /// Returns the memory layout of a pixel.
    pub const fn format(&self) -> PixelFormat {
        self.format
    }

    /// All bytes, `height * step` of them.
    pub const fn data(&self) -> &'a [u8] {
        self.data
    }
}

/// An image that owns its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnedImage {
    width: u32,
    height: u32,
    step: usize,
    format: PixelFormat,
    data: Vec<u8>,
}

impl OwnedImage {
    /// A view of it.
    pub fn view(&self) -> Image<'_> {
        let Self { width, height, step, format, ref data } = *self;
        Image { width, height, step, format, data }
    }
}

impl From<&Image<'_>> for OwnedImage {
    fn from(image: &Image<'_>) -> Self {
        let Image { width, height, step, format, data } = *image;
        Self { width, height, step, format, data: data.to_vec() }
    }
}

/// One image and the time at which it was taken.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Acquisition time, nanoseconds since the epoch of the camera's clock.
    pub stamp_ns: i64,
    /// The picture.
    pub image: Image<'a>,
}
