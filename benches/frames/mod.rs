//! Frames for the benchmarks of the extraction: one stripe, many stripes, frames in which no block can be skipped.

use laser_profiler::{
    scanner::{
        channel::{AnyPlane, Plane},
        params::StripeDirection,
    },
    simulate::{
        exposure::{CrossSection, Exposure},
        noise::frame_rng,
        sensor::{BitDepth, Sensor},
    },
};
use std::{cell::Cell, hint::black_box};

/// The paper's frame, columns and rows.
pub(crate) const FULL: (u32, u32) = (2592, 2048);
/// The default segment threshold: pixels above it are bright.
const THRESHOLD: u8 = 35;
/// Above the threshold a cross-section of the stripe is 2 · 2.2 · √(2 ln(199 / 35)) wide, pixels.
const BRIGHT_PX: f64 = 8.2;
/// Largest block of pixels that is skipped at once: one bright pixel in each prevents all skipping.
const BLOCK: (usize, usize) = (64, 8);

/// Samples row by row, without padding.
#[derive(Clone)]
pub(crate) struct Frame {
    size: (u32, u32),
    samples: Samples,
}

#[derive(Clone)]
enum Samples {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

/// Frames that are taken in turn.
pub(crate) struct Ring {
    frames: Vec<Frame>,
    next: Cell<usize>,
}

impl Ring {
    /// Returns the next frame.
    pub(crate) fn turn(&self) -> &Frame {
        let next = self.next.get();
        self.next.set((next + 1) % self.frames.len());
        &self.frames[next]
    }
}

impl Frame {
    /// One stripe along all of the frame, 8 bit: amplitude 199, standard deviation 2.2 px, read noise 2, slope 0.05.
    pub(crate) fn new(direction: StripeDirection) -> Self {
        Self::render(FULL, BitDepth::Eight, |exposure, level| {
            exposure.add_stripe(direction, |along| stripe(900.0 + 0.05 * f64::from(along), level));
        })
    }

    /// The same with 16 bits, horizontal.
    pub(crate) fn deep() -> Self {
        Self::render(FULL, BitDepth::Sixteen, |exposure, level| {
            exposure.add_stripe(StripeDirection::Horizontal, |column| {
                stripe(900.0 + 0.05 * f64::from(column), level)
            });
        })
    }

    /// A stripe of `columns` columns from the left border, in the middle row of a frame of any size.
    pub(crate) fn short_stripe(size: (u32, u32), columns: u32) -> Self {
        let row = f64::from(size.1) / 2.0;
        Self::render(size, BitDepth::Eight, |exposure, level| {
            exposure.add_stripe(StripeDirection::Horizontal, |column| {
                let row = if column < columns { row + 0.05 * f64::from(column) } else { f64::NAN };
                stripe(row, level)
            });
        })
    }

    /// Evenly spaced stripes that make this share of all pixels bright; the last one is shortened to match it.
    pub(crate) fn bright(share: f64) -> Self {
        let (width, height) = (f64::from(FULL.0), f64::from(FULL.1));
        let columns = share * width * height / BRIGHT_PX;
        let stripes = (columns / width).ceil();
        let spacing = height / (stripes + 1.0);
        let frame = Self::render(FULL, BitDepth::Eight, |exposure, level| {
            for number in 0..stripes as u32 {
                let left = columns - f64::from(number) * width;
                exposure.add_stripe(StripeDirection::Horizontal, |column| {
                    let row = spacing * f64::from(number + 1);
                    let row = if f64::from(column) < left { row } else { f64::NAN };
                    stripe(row, level)
                });
            }
        });
        let is = frame.bright_share();
        assert!((is / share - 1.0).abs() < 0.1, "{is} of the pixels are bright, not {share}");
        frame
    }

    /// The same frame with one pixel of full scale in each block of 64 x 8. The blur lowers it to 21 grey levels, so the
    /// stripes are unchanged, but no block can be skipped.
    pub(crate) fn with_salt(mut self) -> Self {
        let Samples::Eight(samples) = &mut self.samples else { panic!("salt is for 8 bit") };
        for row in samples.chunks_exact_mut(self.size.0 as usize).skip(BLOCK.1 / 2).step_by(BLOCK.1)
        {
            row.iter_mut().skip(BLOCK.0 / 2).step_by(BLOCK.0).for_each(|sample| *sample = 255);
        }
        self
    }

    /// Full scale everywhere.
    pub(crate) fn white() -> Self {
        Self { size: FULL, samples: Samples::Eight(vec![255; (FULL.0 * FULL.1) as usize]) }
    }

    /// This frame repeatedly.
    pub(crate) fn alone(self) -> Ring {
        self.times(1)
    }

    /// Copies of this frame, each in its own memory.
    pub(crate) fn times(self, number: usize) -> Ring {
        Ring { frames: vec![self; number], next: Cell::new(0) }
    }

    /// Returns the frame as input of the extraction.
    pub(crate) fn plane(&self) -> AnyPlane<'_> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let plane = match &self.samples {
            Samples::Eight(samples) => Plane::new(width, height, width, samples).map(Into::into),
            Samples::Sixteen(samples) => Plane::new(width, height, width, samples).map(Into::into),
        };
        plane.expect("as many samples as pixels")
    }

    /// Level of a saturated sample.
    pub(crate) fn full_scale(&self) -> u32 {
        match self.samples {
            Samples::Eight(_) => u8::MAX.into(),
            Samples::Sixteen(_) => u16::MAX.into(),
        }
    }

    /// Reads the frame once: returns the maximum of all pixels.
    pub(crate) fn read(&self) -> u16 {
        match &self.samples {
            Samples::Eight(samples) => {
                black_box(samples).iter().copied().max().unwrap_or_default().into()
            }
            Samples::Sixteen(samples) => {
                black_box(samples).iter().copied().max().unwrap_or_default()
            }
        }
    }

    fn bright_share(&self) -> f64 {
        let Samples::Eight(samples) = &self.samples else { panic!("bright means 8 bit") };
        let bright = samples.iter().filter(|&&sample| sample > THRESHOLD).count();
        bright as f64 / samples.len() as f64
    }

    /// `draw` gets the grey levels of that depth for one of 8 bit.
    fn render(
        size: (u32, u32),
        bit_depth: BitDepth,
        draw: impl FnOnce(&mut Exposure, f64),
    ) -> Self {
        let level = f64::from(bit_depth.full_scale()) / 255.0;
        let mut exposure = Exposure::default();
        exposure.reset(size.0, size.1, 0.0);
        draw(&mut exposure, level);
        let sensor = Sensor { bit_depth, read_noise: 2.0 * level, shot_gain: 0.0 };
        let mut bytes = Vec::new();
        sensor.read_out(&exposure, &mut frame_rng(0, 0), &mut bytes);
        let samples = match bit_depth {
            BitDepth::Eight => Samples::Eight(bytes),
            BitDepth::Twelve | BitDepth::Sixteen => {
                let pairs = bytes.as_chunks().0;
                Samples::Sixteen(pairs.iter().map(|&pair| u16::from_le_bytes(pair)).collect())
            }
        };
        Self { size, samples }
    }
}

fn stripe(center_px: f64, level: f64) -> CrossSection {
    CrossSection { center_px, amplitude: 199.0 * level, sigma_px: 2.2 }
}
