//! The channel that `channel: auto` stands for, chosen from the picture.
//!
//! A colour camera clips a bright line in the laser's own colour first, and sees the halo around it in that colour, too.
//! The other colours hold less light, but the whole shape of the line. So among the channels that show the line well,
//! the one that clips it in the fewest cross-sections is measured; if several clip it everywhere, the one that clips the
//! fewest samples. The choice is made in the first frame with a line and held, because every channel sees the line at a
//! slightly different place.

use super::{
    channel::{AnyPlane, Decoder, Plane, SearchedRegion},
    image::Image,
    params::{Channel, Params, StripeDirection, Threshold},
};
use crate::statistics::{MAD_TO_SIGMA, median, quantile};

/// Channels to choose from; the first of equals is taken.
const CANDIDATES: [Channel; 4] = [Channel::Gray, Channel::Green, Channel::Red, Channel::Blue];
/// Number of colours among the candidates.
const COLOURS: [usize; 3] = [1, 2, 3];
/// Maximum number of cross-sections evaluated.
const MOST_SECTIONS: usize = 64;
/// Maximum number of samples for the background of a cross-section.
const MOST_SAMPLES: usize = 512;
/// A channel needs this share of the best channel's contrast.
const LEAST_SHARE: f64 = 0.2;
/// With a fixed threshold, a channel needs this multiple of it.
const THRESHOLD_MARGIN: f64 = 1.5;
/// A cross-section shows the line if it has this share of the contrast of the brightest ones.
const LIT_SHARE: f64 = 0.25;
/// Up to this share of clipped cross-sections, specks and highlights, counts as none.
const FEW_CLIPPED: f64 = 0.05;
/// A difference of the contrast by less than this share is none.
const SAME_CONTRAST: f64 = 0.1;
/// Up to this ratio, numbers of clipped samples count as equal.
const SAME_WIDTH: f64 = 1.1;
/// Least contrast of a line: grey levels of an 8-bit scale, and standard deviations of the noise.
const LEAST_CONTRAST: (f64, f64) = (16.0, 5.0);

/// The channel that `channel: auto` stands for, and the reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelChoice {
    /// The channel.
    pub channel: Channel,
    /// Share of its cross-sections that are clipped, 0 to 1.
    pub clipped: f64,
    /// The channel with the highest contrast.
    pub brightest: Channel,
    /// Share of that channel's cross-sections that are clipped, 0 to 1.
    pub brightest_clipped: f64,
}

/// Chooses a channel and holds it.
#[derive(Debug, Default)]
pub(super) struct AutoChannel {
    choice: Option<ChannelChoice>,
    decoder: Decoder,
    samples: Vec<u32>,
    sections: Vec<[Section; 4]>,
    order: Vec<f64>,
}

/// A cross-section in one channel.
#[derive(Clone, Copy, Debug, Default)]
struct Section {
    /// Largest mean of three neighbouring samples minus the median, grey levels of the image.
    contrast: f64,
    /// Standard deviation of the mean of three samples about the median, grey levels of the image.
    noise: f64,
    /// Samples at full scale.
    clipped: u32,
}

/// One channel over all cross-sections with a line.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    /// Contrast that three quarters of the cross-sections exceed.
    contrast: f64,
    /// Share of the cross-sections that are clipped.
    clipped: f64,
    /// Clipped samples a cross-section.
    clipped_px: f64,
}

impl AutoChannel {
    /// Chooses again in the next frame.
    pub(super) const fn forget(&mut self) {
        self.choice = None;
    }

    /// The choice; `None` before the first frame that shows a line.
    pub(super) const fn choice(&self) -> Option<ChannelChoice> {
        self.choice
    }

    /// Returns the channel to measure in a frame: that of the parameters unless it is `auto`. Until a frame shows a line,
    /// `auto` is the largest colour; of grey images it is the image.
    pub(super) fn channel(
        &mut self,
        image: &Image<'_>,
        searched: &SearchedRegion,
        params: &Params,
        full_scale: u32,
    ) -> Channel {
        if params.channel != Channel::Auto || !image.format().has_colors() {
            return params.channel;
        }
        if self.choice.is_none() {
            self.choice = self.choose(image, searched, params, full_scale);
        }
        self.choice.map_or(Channel::Max, |choice| choice.channel)
    }

    fn choose(
        &mut self,
        image: &Image<'_>,
        searched: &SearchedRegion,
        params: &Params,
        full_scale: u32,
    ) -> Option<ChannelChoice> {
        self.look(image, searched, params.stripe_direction, full_scale);
        let Self { sections, order, .. } = self;
        let strongest = |sections: &[Section; 4]| {
            sections.iter().map(|section| section.contrast).fold(0.0, f64::max)
        };
        let typical = quantile_of(sections.iter().map(strongest), 0.9, order)?;
        let unit = f64::from(full_scale) / 255.0;
        let least = LEAST_CONTRAST.0 * unit;
        if typical < least {
            return None;
        }
        let is_lit = |sections: &[Section; 4]| {
            let is_line = |section: &Section| section.contrast >= LEAST_CONTRAST.1 * section.noise;
            sections.iter().any(is_line) && strongest(sections) >= (LIT_SHARE * typical).max(least)
        };
        let num_sections = sections.len();
        sections.retain(is_lit);
        // A tenth of the cross-sections: less may be clutter.
        if 10 * sections.len() < num_sections.max(10) {
            return None;
        }
        let num_lit = sections.len() as f64;
        let figures = [0, 1, 2, 3].map(|at| {
            let of_channel = || sections.iter().map(|sections| &sections[at]);
            let clipped = of_channel().filter(|section| section.clipped > 0).count();
            let samples: u32 = of_channel().map(|section| section.clipped).sum();
            let contrasts = of_channel().map(|section| section.contrast);
            Figures {
                contrast: quantile_of(contrasts, 0.25, order).unwrap_or_default(),
                clipped: clipped as f64 / num_lit,
                clipped_px: f64::from(samples) / num_lit,
            }
        });
        Some(best(&figures, least_of(params, unit)))
    }

    /// Measures evenly spaced cross-sections in every channel.
    fn look(
        &mut self,
        image: &Image<'_>,
        searched: &SearchedRegion,
        direction: StripeDirection,
        full_scale: u32,
    ) {
        let Self { decoder, samples, sections, .. } = self;
        let lines = match direction {
            StripeDirection::Horizontal => searched.width,
            StripeDirection::Vertical => searched.height,
        };
        let count = lines.min(MOST_SECTIONS);
        sections.clear();
        for i in 0..count {
            // The middle of each of `count` equal parts.
            let line = (2 * i + 1) * lines / (2 * count);
            let region = match direction {
                StripeDirection::Horizontal => {
                    SearchedRegion { x: searched.x + line, width: 1, ..*searched }
                }
                StripeDirection::Vertical => {
                    SearchedRegion { y: searched.y + line, height: 1, ..*searched }
                }
            };
            let mut found = CANDIDATES.map(|channel| {
                read(&decoder.decode(image, channel, &region), samples);
                section(samples, full_scale)
            });
            // Gray is a sum of the colours: it is distorted where one of them is clipped.
            let clipped = COLOURS.iter().map(|&at| found[at].clipped);
            found[0].clipped = clipped.fold(found[0].clipped, u32::max);
            sections.push(found);
        }
    }
}

/// Least contrast that the threshold requires, grey levels of the image; `unit` is one of an 8-bit scale.
fn least_of(params: &Params, unit: f64) -> f64 {
    match params.extraction.threshold {
        Threshold::Fixed => THRESHOLD_MARGIN * params.extraction.segment_threshold * unit,
        Threshold::Adaptive => 0.0,
    }
}

/// Returns the least clipped candidate with enough contrast; of equals, the one with the clearly highest contrast, and
/// of these the first.
fn best(figures: &[Figures; 4], least_contrast: f64) -> ChannelChoice {
    let mut left = figures.map(Some);
    let top = highest(&left);
    let brightest = first(&left, top).unwrap_or_default();
    let least = (LEAST_SHARE * top).max(least_contrast).min(top);
    keep(&mut left, |figures| figures.contrast >= least);
    // Specks and highlights are no reason to prefer a darker channel.
    let clipped = smallest(&left, |figures| figures.clipped);
    keep(&mut left, |figures| figures.clipped <= clipped + FEW_CLIPPED);
    if clipped > FEW_CLIPPED {
        let fewest = smallest(&left, |figures| figures.clipped_px);
        keep(&mut left, |figures| figures.clipped_px <= SAME_WIDTH * fewest);
    }
    let chosen = first(&left, (1.0 - SAME_CONTRAST) * highest(&left)).unwrap_or(brightest);
    ChannelChoice {
        channel: CANDIDATES[chosen],
        clipped: figures[chosen].clipped,
        brightest: CANDIDATES[brightest],
        brightest_clipped: figures[brightest].clipped,
    }
}

/// The candidates that are left.
type Left = [Option<Figures>; 4];

fn keep(left: &mut Left, is_kept: impl Fn(&Figures) -> bool) {
    for figures in left {
        *figures = figures.filter(&is_kept);
    }
}

fn smallest(left: &Left, figure: impl Fn(&Figures) -> f64) -> f64 {
    left.iter().flatten().map(figure).fold(f64::INFINITY, f64::min)
}

fn highest(left: &Left) -> f64 {
    left.iter().flatten().map(|figures| figures.contrast).fold(0.0, f64::max)
}

/// Place of the first candidate with at least this contrast.
fn first(left: &Left, contrast: f64) -> Option<usize> {
    left.iter().position(|figures| figures.is_some_and(|figures| figures.contrast >= contrast))
}

/// Returns the quantile of numbers, which replace the content of `order`.
fn quantile_of(
    numbers: impl Iterator<Item = f64>,
    share: f64,
    order: &mut Vec<f64>,
) -> Option<f64> {
    order.clear();
    order.extend(numbers);
    order.sort_unstable_by(f64::total_cmp);
    quantile(order, share)
}

/// Replaces `samples` by those of a plane one sample wide or high.
fn read(plane: &AnyPlane<'_>, samples: &mut Vec<u32>) {
    fn copy<S: Copy + Into<u32>>(plane: &Plane<'_, S>, samples: &mut Vec<u32>) {
        for row in plane.rows() {
            samples.extend(row.iter().map(|&sample| sample.into()));
        }
    }
    samples.clear();
    match plane {
        AnyPlane::Eight(plane) => copy(plane, samples),
        AnyPlane::Sixteen(plane) => copy(plane, samples),
    }
}

/// Measures a cross-section. Replaces its samples.
fn section(samples: &mut Vec<u32>, full_scale: u32) -> Section {
    let clipped = samples.iter().filter(|&&sample| sample >= full_scale).count() as u32;
    // Sums of three neighbours.
    let num = samples.len().saturating_sub(2);
    for at in 0..num {
        samples[at] += samples[at + 1] + samples[at + 2];
    }
    samples.truncate(num);
    let peak = samples.iter().copied().max().unwrap_or_default();
    let step = num.div_ceil(MOST_SAMPLES).max(1);
    let kept = num.div_ceil(step);
    for at in 0..kept {
        samples[at] = samples[at * step];
    }
    samples.truncate(kept);
    let middle = median(samples).unwrap_or_default();
    for sample in &mut *samples {
        *sample = sample.abs_diff(middle);
    }
    let deviation = f64::from(median(samples).unwrap_or_default());
    Section {
        contrast: f64::from(peak.saturating_sub(middle)) / 3.0,
        noise: MAD_TO_SIGMA * deviation / 3.0,
        clipped,
    }
}

#[cfg(test)]
mod tests;
