//! Steps 1 and 2 of Yao et al. 2023: the region of interest, and one grey level per pixel.

use super::{
    image::{BayerPattern, ByteOrder, Image, PixelFormat},
    params::{Channel, RegionOfInterest},
};
use thiserror::Error;

pub use super::plane::{AnyPlane, Plane, PlaneError};

/// The region of interest lies outside the image.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("roi {roi:?} does not lie inside the image of {width} x {height} pixels")]
pub struct RoiError {
    /// The requested region.
    pub roi: RegionOfInterest,
    /// Columns of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
}

/// The channel that the parameters name cannot be read from YUV images.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error(
    "channel is {}, but of YUV images only the luma is read, not the colours: set channel to auto or gray, or let the driver \
     publish rgb8", .channel.name()
)]
pub struct ChannelError {
    /// Value of the parameter.
    pub channel: Channel,
}

/// Tests that the channel can be read from images of that format. Grey images have one channel, whichever is asked for.
/// Of YUV images only the luma is read: that is [`Channel::Auto`], [`Channel::Gray`] and [`Channel::Max`].
///
/// # Errors
/// The channel is a colour, and the images are YUV.
pub const fn check_channel(channel: Channel, format: PixelFormat) -> Result<(), ChannelError> {
    match channel {
        Channel::Auto | Channel::Gray | Channel::Max => Ok(()),
        _ if format.is_yuv() => Err(ChannelError { channel }),
        _ => Ok(()),
    }
}

/// The part of an image that is searched: a region of interest with its size resolved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchedRegion {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns, at least 1.
    pub width: usize,
    /// Rows, at least 1.
    pub height: usize,
}

impl SearchedRegion {
    /// Step 1: resolves `roi` in an image of that size.
    ///
    /// # Errors
    /// A region that is empty or reaches beyond the image.
    pub fn new(roi: RegionOfInterest, width: u32, height: u32) -> Result<Self, RoiError> {
        let span = |offset: u32, wanted: Option<u32>, available: u32| match wanted {
            None => available.checked_sub(offset),
            Some(wanted) => {
                offset.checked_add(wanted).filter(|&end| end <= available).and(Some(wanted))
            }
        };
        let columns = span(roi.x_offset, roi.width, width);
        let rows = span(roi.y_offset, roi.height, height);
        match (columns, rows) {
            (Some(columns @ 1..), Some(rows @ 1..)) => Ok(Self {
                x: roi.x_offset as usize,
                y: roi.y_offset as usize,
                width: columns as usize,
                height: rows as usize,
            }),
            _ => Err(RoiError { roi, width, height }),
        }
    }

    /// The whole image.
    pub const fn whole(image: &Image<'_>) -> Self {
        Self { x: 0, y: 0, width: image.width() as usize, height: image.height() as usize }
    }

    /// Position of the region's top-left pixel in the image.
    pub const fn offset(&self) -> Offset {
        Offset { column: self.x, row: self.y }
    }
}

/// Position of a plane's top-left sample in its image, pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offset {
    /// Column.
    pub column: usize,
    /// Row.
    pub row: usize,
}

/// Step 2: one grey level per pixel. Borrows 8-bit grey images and luma planes; copies one level a pixel of everything
/// else into buffers that are kept.
#[derive(Debug, Default)]
pub struct Decoder {
    eight: Vec<u8>,
    sixteen: Vec<u16>,
}

impl Decoder {
    /// Returns the chosen channel of the searched part.
    ///
    /// Bayer images are demosaiced bilinearly: a missing colour is the mean of the nearest pixels that have it. Of YUV
    /// images it is the luma as it is stored, without a conversion of colours or of the range. Formats without colours
    /// have one channel, whichever is asked for: see [`check_channel`].
    pub fn decode<'a>(
        &'a mut self,
        image: &Image<'a>,
        channel: Channel,
        region: &SearchedRegion,
    ) -> AnyPlane<'a> {
        match image.format() {
            PixelFormat::Mono8 | PixelFormat::Luma8 => AnyPlane::Eight(bytes(image).crop(region)),
            PixelFormat::Yuyv => self.every_second(image, region, 0),
            PixelFormat::Uyvy => self.every_second(image, region, 1),
            PixelFormat::Mono16(order) => {
                self.sixteen.clear();
                let sample = sample_of(order);
                for y in region.y..region.y + region.height {
                    let row = &image.data()[y * image.step() + 2 * region.x..][..2 * region.width];
                    self.sixteen.extend(row.as_chunks().0.iter().map(|&pair| sample(pair)));
                }
                AnyPlane::Sixteen(packed(&self.sixteen, region))
            }
            PixelFormat::Rgb8 => self.colour::<3>(image, region, channel, [0, 1, 2]),
            PixelFormat::Bgr8 => self.colour::<3>(image, region, channel, [2, 1, 0]),
            PixelFormat::Rgba8 => self.colour::<4>(image, region, channel, [0, 1, 2]),
            PixelFormat::Bgra8 => self.colour::<4>(image, region, channel, [2, 1, 0]),
            PixelFormat::Bayer8(pattern) => {
                let mosaic = bytes(image);
                let sample = |x: usize, y: usize| u32::from(mosaic.at(x, y));
                self.eight.clear();
                demosaic(image, region, pattern, sample, |rgb| {
                    self.eight.push(select(channel, rgb) as u8);
                });
                AnyPlane::Eight(packed(&self.eight, region))
            }
            PixelFormat::Bayer16(pattern, order) => {
                let convert = sample_of(order);
                let sample = |x: usize, y: usize| {
                    let at = y * image.step() + 2 * x;
                    u32::from(convert([image.data()[at], image.data()[at + 1]]))
                };
                self.sixteen.clear();
                demosaic(image, region, pattern, sample, |rgb| {
                    self.sixteen.push(select(channel, rgb) as u16);
                });
                AnyPlane::Sixteen(packed(&self.sixteen, region))
            }
            PixelFormat::Rgb16(order) => self.deep_colour::<6>(image, region, channel, (order, 0)),
            PixelFormat::Bgr16(order) => self.deep_colour::<6>(image, region, channel, (order, 2)),
            PixelFormat::Rgba16(order) => self.deep_colour::<8>(image, region, channel, (order, 0)),
            PixelFormat::Bgra16(order) => self.deep_colour::<8>(image, region, channel, (order, 2)),
        }
    }

    /// The luma of interleaved YUV: the first or the second byte of each pixel.
    fn every_second<'a>(
        &'a mut self,
        image: &Image<'_>,
        region: &SearchedRegion,
        place: usize,
    ) -> AnyPlane<'a> {
        self.eight.clear();
        for y in region.y..region.y + region.height {
            let row = &image.data()[y * image.step() + 2 * region.x..][..2 * region.width];
            self.eight.extend(row.as_chunks::<2>().0.iter().map(|pair| pair[place]));
        }
        AnyPlane::Eight(packed(&self.eight, region))
    }

    /// One level of colours of 16 bits. `red` is the place of red in the pixel, 0 or 2; blue has the other.
    fn deep_colour<'a, const BYTES: usize>(
        &'a mut self,
        image: &Image<'_>,
        region: &SearchedRegion,
        channel: Channel,
        (order, red): (ByteOrder, usize),
    ) -> AnyPlane<'a> {
        self.sixteen.clear();
        let sample = sample_of(order);
        for y in region.y..region.y + region.height {
            let row = &image.data()[y * image.step() + BYTES * region.x..][..BYTES * region.width];
            self.sixteen.extend(row.as_chunks::<BYTES>().0.iter().map(|pixel| {
                let at = |place: usize| u32::from(sample([pixel[2 * place], pixel[2 * place + 1]]));
                select(channel, [at(red), at(1), at(2 - red)]) as u16
            }));
        }
        AnyPlane::Sixteen(packed(&self.sixteen, region))
    }

    fn colour<'a, const BYTES: usize>(
        &'a mut self,
        image: &Image<'_>,
        region: &SearchedRegion,
        channel: Channel,
        [red, green, blue]: [usize; 3],
    ) -> AnyPlane<'a> {
        self.eight.clear();
        for y in region.y..region.y + region.height {
            let row = &image.data()[y * image.step() + BYTES * region.x..][..BYTES * region.width];
            let pixels = row.as_chunks::<BYTES>().0.iter();
            match channel {
                Channel::Red => self.eight.extend(pixels.map(|p| p[red])),
                Channel::Green => self.eight.extend(pixels.map(|p| p[green])),
                Channel::Blue => self.eight.extend(pixels.map(|p| p[blue])),
                Channel::Auto | Channel::Max => {
                    self.eight.extend(pixels.map(|p| p[red].max(p[green]).max(p[blue])));
                }
                Channel::RedExcess => {
                    self.eight.extend(pixels.map(|p| p[red].saturating_sub(p[green].max(p[blue]))));
                }
                Channel::GreenExcess => {
                    self.eight.extend(pixels.map(|p| p[green].saturating_sub(p[red].max(p[blue]))));
                }
                Channel::BlueExcess => {
                    self.eight.extend(pixels.map(|p| p[blue].saturating_sub(p[red].max(p[green]))));
                }
                Channel::Gray => {
                    self.eight.extend(pixels.map(|p| {
                        luma([u32::from(p[red]), u32::from(p[green]), u32::from(p[blue])]) as u8
                    }));
                }
            }
        }
        AnyPlane::Eight(packed(&self.eight, region))
    }
}

fn bytes<'a>(image: &Image<'a>) -> Plane<'a, u8> {
    Plane {
        width: image.width() as usize,
        height: image.height() as usize,
        stride: image.step(),
        samples: image.data(),
    }
}

fn packed<'a, S>(samples: &'a [S], region: &SearchedRegion) -> Plane<'a, S> {
    Plane { width: region.width, height: region.height, stride: region.width, samples }
}

fn sample_of(order: ByteOrder) -> fn([u8; 2]) -> u16 {
    match order {
        ByteOrder::Little => u16::from_le_bytes,
        ByteOrder::Big => u16::from_be_bytes,
    }
}

/// Luma of ITU-R BT.601 in integers: weights 77, 150 and 29 of 256.
const fn luma([red, green, blue]: [u32; 3]) -> u32 {
    (77 * red + 150 * green + 29 * blue + 128) >> 8
}

fn select(channel: Channel, rgb: [u32; 3]) -> u32 {
    match channel {
        Channel::Red => rgb[0],
        Channel::Green => rgb[1],
        Channel::Blue => rgb[2],
        Channel::Gray => luma(rgb),
        Channel::Auto | Channel::Max => rgb[0].max(rgb[1]).max(rgb[2]),
        Channel::RedExcess => rgb[0].saturating_sub(rgb[1].max(rgb[2])),
        Channel::GreenExcess => rgb[1].saturating_sub(rgb[0].max(rgb[2])),
        Channel::BlueExcess => rgb[2].saturating_sub(rgb[0].max(rgb[1])),
    }
}

/// Returns the index of the colour (0 red, 1 green, 2 blue) that the filter array passes at a pixel.
const fn colour_at(pattern: BayerPattern, x: usize, y: usize) -> usize {
    let cell = match pattern {
        BayerPattern::Rggb => [0, 1, 1, 2],
        BayerPattern::Bggr => [2, 1, 1, 0],
        BayerPattern::Gbrg => [1, 2, 0, 1],
        BayerPattern::Grbg => [1, 0, 2, 1],
    };
    cell[2 * (y % 2) + x % 2]
}

/// Calls `put` with red, green and blue of every pixel of the region, row by row.
fn demosaic(
    image: &Image<'_>,
    region: &SearchedRegion,
    pattern: BayerPattern,
    sample: impl Fn(usize, usize) -> u32,
    mut put: impl FnMut([u32; 3]),
) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    for y in region.y..region.y + region.height {
        for x in region.x..region.x + region.width {
            let (mut sum, mut count) = ([0; 3], [0; 3]);
            for near_y in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                for near_x in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    let colour = colour_at(pattern, near_x, near_y);
                    sum[colour] += sample(near_x, near_y);
                    count[colour] += 1;
                }
            }
            let own = colour_at(pattern, x, y);
            (sum[own], count[own]) = (sample(x, y), 1);
            put([0, 1, 2].map(|c| (sum[c] + count[c] / 2).checked_div(count[c]).unwrap_or(0)));
        }
    }
}

#[cfg(test)]
mod tests;
