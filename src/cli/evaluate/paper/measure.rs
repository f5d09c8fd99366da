//! The protocol on the frames of a recording, without and with added noise.

use std::ops::RangeInclusive;

use anyhow::{Context, ensure};
use rand::Rng;

use super::{
    super::{
        progress_bar,
        recording::{Message, Read, Recording, Wanted},
        settings::usage,
    },
    NoiseStep, NoisyFigures,
};
use crate::{
    evaluate::{
        added_noise::{GAMMAS, NoisyPlane},
        paper::{METHODS, Protocol},
        trial::{Point, by_line},
    },
    scanner::{
        channel::{AnyPlane, Decoder, Offset, SearchedRegion},
        image::Frame,
        params::{ExtractionParams, Params, StripeDirection},
        stripe::{Centerline, Extractor},
    },
    simulate::noise::frame_rng,
};

/// The part of a recording to use.
pub(super) struct Run {
    pub(super) frames: u32,
    pub(super) columns: Option<RangeInclusive<u32>>,
    pub(super) seed: u64,
}

/// Results of the protocol.
pub(super) struct Measured {
    pub(super) read: Read,
    /// First and last column used.
    pub(super) columns: [u32; 2],
    /// Results without added noise, and at each noise level.
    pub(super) steps: Vec<NoiseStep>,
}

impl Run {
    /// Measures the first frames of a recording.
    ///
    /// # Errors
    /// Columns that the images do not have, or no frame that could be measured.
    pub(super) fn measure(&self, recording: &Recording) -> anyhow::Result<Measured> {
        let params = recording.camera.scanner;
        let mut steps: Vec<_> =
            [0.0].iter().chain(&GAMMAS).map(|&gamma| Step::new(gamma, &params)).collect();
        let mut columns = None;
        let mut decoder = Decoder::default();
        let mut refused = None;
        let available = recording.num_images().map(|count| count.min(self.frames.into()));
        let bar = progress_bar(available, "frames");
        let mut number = 0;
        let read = recording.read(None, |message| {
            let Message::Frame(frame) = message else { return Ok(Wanted::More) };
            let seen = self.columns_of(frame, &params)?;
            let Some(seen) = seen else {
                refused = Some((frame.image.width(), frame.image.height()));
                return Ok(Wanted::Nothing);
            };
            self.take(
                &Taken { frame, params: &params, columns: &seen, number },
                &mut decoder,
                &mut steps,
            )?;
            columns.get_or_insert([*seen.start(), *seen.end()]);
            number += 1;
            bar.set_position(number);
            Ok(if number < self.frames.into() { Wanted::More } else { Wanted::Nothing })
        });
        bar.finish_and_clear();
        if let (Some((width, height)), Some(wanted)) = (refused, &self.columns) {
            return Err(usage(format!(
                "columns {}..{} do not lie in the searched part of images of {width} x {height} pixels",
                wanted.start(),
                wanted.end()
            )));
        }
        let columns = columns
            .with_context(|| format!("no frame could be measured on {}", recording.topic.name))?;
        let steps: Vec<_> = steps.into_iter().map(Step::finish).collect();
        ensure!(steps[0].points > 1, "the three methods have less than two columns in common");
        Ok(Measured { read, columns, steps })
    }

    /// Returns the columns to use; `None` if the frame does not have the requested ones.
    fn columns_of(
        &self,
        frame: &Frame<'_>,
        params: &Params,
    ) -> anyhow::Result<Option<RangeInclusive<u32>>> {
        let searched = SearchedRegion::new(params.roi, frame.image.width(), frame.image.height())?;
        let (first, count) = match params.stripe_direction {
            StripeDirection::Horizontal => (searched.x, searched.width),
            StripeDirection::Vertical => (searched.y, searched.height),
        };
        let all = first as u32..=(first + count - 1) as u32;
        Ok(match &self.columns {
            None => Some(all),
            Some(wanted) if all.contains(wanted.start()) && all.contains(wanted.end()) => {
                Some(wanted.clone())
            }
            Some(_) => None,
        })
    }

    fn take(
        &self,
        taken: &Taken<'_>,
        decoder: &mut Decoder,
        steps: &mut [Step],
    ) -> anyhow::Result<()> {
        let Taken { frame, params, columns, number } = *taken;
        let image = &frame.image;
        let searched = SearchedRegion::new(params.roi, image.width(), image.height())?;
        let full_scale = params.full_scale_of(image.format())?;
        let plane = decoder.decode(image, params.channel, &searched);
        let length = match params.stripe_direction {
            StripeDirection::Horizontal => image.width(),
            StripeDirection::Vertical => image.height(),
        };
        let mut own: Option<[Vec<Option<Point>>; 3]> = None;
        for step in steps {
            let input = Input {
                plane: &plane,
                offset: searched.offset(),
                full_scale,
                length: length as usize,
                direction: params.stripe_direction,
            };
            let found = step.extract(&input, &mut frame_rng(self.seed, number));
            step.compare(&found, own.as_ref().unwrap_or(&found), columns);
            own.get_or_insert(found);
        }
        Ok(())
    }
}

/// One frame of the recording, as read.
struct Taken<'a> {
    frame: &'a Frame<'a>,
    params: &'a Params,
    columns: &'a RangeInclusive<u32>,
    /// Number of the frame, the seed of its noise.
    number: u64,
}

/// One frame, prepared for the extractors.
struct Input<'a> {
    plane: &'a AnyPlane<'a>,
    offset: Offset,
    full_scale: u32,
    /// Columns of the image (rows, for a vertical stripe).
    length: usize,
    direction: StripeDirection,
}

/// One noise level and its sums.
struct Step {
    gamma: f64,
    extractors: [Extractor; 3],
    noisy: NoisyPlane,
    line: Centerline,
    protocol: Protocol,
    /// Number of columns examined.
    columns: u64,
    found: [u64; 3],
    /// Sum of squares and number of the distances from the result without noise.
    from_own: [(f64, u64); 3],
}

impl Step {
    fn new(gamma: f64, params: &Params) -> Self {
        let extractor = |method| {
            let params_of = ExtractionParams { method, ..params.extraction };
            Extractor::new(params_of, params.stripe_direction)
        };
        Self {
            gamma,
            extractors: METHODS.map(extractor),
            noisy: NoisyPlane::default(),
            line: Centerline::default(),
            protocol: Protocol::default(),
            columns: 0,
            found: [0; 3],
            from_own: [(0.0, 0); 3],
        }
    }

    fn extract(&mut self, input: &Input<'_>, rng: &mut impl Rng) -> [Vec<Option<Point>>; 3] {
        let sigma = self.gamma * f64::from(input.full_scale) / 255.0;
        let noisy;
        let plane = if self.gamma > 0.0 {
            noisy = self.noisy.add(input.plane, sigma, input.full_scale, rng);
            &noisy
        } else {
            input.plane
        };
        self.extractors.each_mut().map(|extractor| {
            extractor.extract_plane(plane, input.offset, input.full_scale, &mut self.line);
            by_line(&self.line, input.direction, input.length)
        })
    }

    fn compare(
        &mut self,
        found: &[Vec<Option<Point>>; 3],
        own: &[Vec<Option<Point>>; 3],
        columns: &RangeInclusive<u32>,
    ) {
        for column in columns.clone().map(|column| column as usize) {
            self.columns += 1;
            let points = found.each_ref().map(|points| points[column]);
            for (method, point) in points.into_iter().enumerate() {
                let Some((position_px, _)) = point else { continue };
                self.found[method] += 1;
                if let Some((own_px, _)) = own[method][column] {
                    let sums = &mut self.from_own[method];
                    *sums = (sums.0 + (position_px - own_px).powi(2), sums.1 + 1);
                }
            }
            if let [Some((a, _)), Some((b, _)), Some((c, _))] = points {
                self.protocol.add([a, b, c]);
            }
        }
    }

    fn finish(self) -> NoiseStep {
        let deviations = self.protocol.deviations();
        let method = |number: usize| NoisyFigures {
            method: METHODS[number].name(),
            deviations: deviations[number],
            found: self.found[number] as f64 / self.columns as f64,
            from_own_rms_px: {
                let (sum, count) = self.from_own[number];
                (sum / count as f64).sqrt()
            },
        };
        NoiseStep {
            gamma: self.gamma,
            points: self.protocol.points(),
            methods: [0, 1, 2].map(method).into(),
        }
    }
}
