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

/// Step 2: one grey level per pixel. Borrows grey 8-bit images; converts everything else into buffers that are kept.
#[derive(Debug, Default)]
pub struct Decoder {
    eight: Vec<u8>,
    sixteen: Vec<u16>,
}

impl Decoder {
    /// Returns the chosen channel of the searched part.
    ///
    /// Bayer images are demosaiced bilinearly: a missing colour is the mean of the nearest pixels that have it.
    pub fn decode<'a>(
        &'a mut self,
        image: &Image<'a>,
        channel: Channel,
        region: &SearchedRegion,
    ) -> AnyPlane<'a> {
        match image.format() {
            PixelFormat::Mono8 => AnyPlane::Eight(bytes(image).crop(region)),
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
        }
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
mod tests {
    use super::*;

    const ALL: RegionOfInterest =
        RegionOfInterest { x_offset: 0, y_offset: 0, width: None, height: None };

    fn eight(format: PixelFormat, width: u32, step: u32, data: &[u8], channel: Channel) -> Vec<u8> {
        let image = Image::new(width, data.len() as u32 / step, step, format, data).unwrap();
        let mut decoder = Decoder::default();
        match decoder.decode(
            &image,
            channel,
            &SearchedRegion::new(ALL, image.width(), image.height()).unwrap(),
        ) {
            AnyPlane::Eight(plane) => {
                (0..plane.height).flat_map(|y| plane.row(y).to_vec()).collect()
            }
            AnyPlane::Sixteen(_) => panic!("8-bit image became 16 bit"),
        }
    }

    #[test]
    fn padding_at_the_end_of_rows_is_no_pixel() {
        let data = [1, 2, 99, 3, 4, 99];
        assert_eq!(eight(PixelFormat::Mono8, 2, 3, &data, Channel::Auto), [1, 2, 3, 4]);
    }

    #[test]
    fn every_colour_order_gives_the_same_channels() {
        let cases: [(PixelFormat, &[u8]); 4] = [
            (PixelFormat::Rgb8, &[10, 20, 30]),
            (PixelFormat::Bgr8, &[30, 20, 10]),
            (PixelFormat::Rgba8, &[10, 20, 30, 200]),
            (PixelFormat::Bgra8, &[30, 20, 10, 200]),
        ];
        for (format, data) in cases {
            let step = data.len() as u32;
            assert_eq!(eight(format, 1, step, data, Channel::Red), [10], "{format:?}");
            assert_eq!(eight(format, 1, step, data, Channel::Green), [20], "{format:?}");
            assert_eq!(eight(format, 1, step, data, Channel::Blue), [30], "{format:?}");
            assert_eq!(eight(format, 1, step, data, Channel::Max), [30], "{format:?}");
            assert_eq!(eight(format, 1, step, data, Channel::Auto), [30], "{format:?}");
            for (channel, excess) in
                [(Channel::RedExcess, 0), (Channel::GreenExcess, 0), (Channel::BlueExcess, 10)]
            {
                assert_eq!(eight(format, 1, step, data, channel), [excess], "{format:?}");
            }
            // 0.299 * 10 + 0.587 * 20 + 0.114 * 30 = 18.15
            assert_eq!(eight(format, 1, step, data, Channel::Gray), [18], "{format:?}");
        }
    }

    #[test]
    fn sixteen_bit_samples_follow_their_byte_order_and_need_no_alignment() {
        let data = [0xff, 0x01, 0x02, 0x03, 0x04];
        for (order, expected) in
            [(ByteOrder::Little, [0x0201, 0x0403]), (ByteOrder::Big, [0x0102, 0x0304])]
        {
            let image = Image::new(2, 1, 4, PixelFormat::Mono16(order), &data[1..]).unwrap();
            let mut decoder = Decoder::default();
            let AnyPlane::Sixteen(plane) =
                decoder.decode(&image, Channel::Auto, &SearchedRegion::new(ALL, 2, 1).unwrap())
            else {
                panic!("16-bit image became 8 bit")
            };
            assert_eq!(plane.row(0), expected);
        }
    }

    /// A scene of one colour comes back as that colour for every pattern, borders included.
    #[test]
    fn a_uniform_bayer_scene_stays_uniform() {
        for pattern in
            [BayerPattern::Rggb, BayerPattern::Bggr, BayerPattern::Gbrg, BayerPattern::Grbg]
        {
            let rgb = [200, 100, 50];
            let data: Vec<u8> = (0..5 * 4).map(|i| rgb[colour_at(pattern, i % 5, i / 5)]).collect();
            for (channel, level) in [
                (Channel::Red, 200),
                (Channel::Green, 100),
                (Channel::Blue, 50),
                (Channel::RedExcess, 100),
            ] {
                let plane = eight(PixelFormat::Bayer8(pattern), 5, 5, &data, channel);
                assert_eq!(plane, vec![level; 20], "{pattern:?} {channel:?}");
            }
        }
    }

    #[test]
    fn the_roi_selects_and_is_checked() {
        let data: Vec<u8> = (0..12).collect();
        let image = Image::new(4, 3, 4, PixelFormat::Mono8, &data).unwrap();
        let mut decoder = Decoder::default();
        let roi = RegionOfInterest { x_offset: 1, y_offset: 1, width: Some(2), height: None };
        let AnyPlane::Eight(plane) =
            decoder.decode(&image, Channel::Auto, &SearchedRegion::new(roi, 4, 3).unwrap())
        else {
            panic!()
        };
        assert_eq!((plane.width, plane.height, plane.row(1)), (2, 2, &[9, 10][..]));
        for roi in [
            RegionOfInterest { x_offset: 4, ..ALL },
            RegionOfInterest { x_offset: 3, width: Some(2), ..ALL },
            RegionOfInterest { y_offset: 1, height: Some(u32::MAX), ..ALL },
        ] {
            assert!(SearchedRegion::new(roi, 4, 3).is_err(), "{roi:?}");
        }
    }
}
