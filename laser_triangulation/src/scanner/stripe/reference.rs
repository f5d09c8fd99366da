//! The definition: the method on a whole image, written as plainly as possible. The fast extractor must equal it.

use super::{
    Centerline,
    assemble::Assembler,
    blur::{Kernel, Sample, blurred_at},
    broad::Broad,
    lanes::{LANES, Sections},
    measure::Points,
    misfit::Shapes,
    noise_estimate::NoiseEstimator,
    picture::Picture,
    section::{Candidate, Levels, LineCandidate, grey},
    select::Selector,
    steger::Ridge,
    texture::TextureEstimator,
    threshold::NoiseThreshold,
    valley::ValleyNoiseEstimator,
};
use crate::scanner::{
    channel::{Offset, Plane},
    params::{Background, ExtractionParams, Method, NoiseSource, StripeDirection, Threshold},
};
use std::ops::Range;

/// Returns the centreline of a plane whose top-left sample lies at `offset` in the image.
pub(super) fn extract<S: Sample>(
    plane: &Plane<'_, S>,
    offset: Offset,
    params: &ExtractionParams,
    direction: StripeDirection,
    full_scale: u32,
) -> Centerline {
    let mut selector = Selector::new(*params);
    let frame = LitFrame { plane, ambient: None, full_scale };
    extract_next(&frame, offset, params, &mut selector, direction)
}

/// A frame, and the same scene without laser.
#[derive(Clone, Copy, Debug)]
pub(super) struct LitFrame<'a, S> {
    /// With laser.
    pub(crate) plane: &'a Plane<'a, S>,
    /// Without laser, same size; `None`: black.
    pub(crate) ambient: Option<&'a Plane<'a, S>>,
    /// Full scale, sample units.
    pub(crate) full_scale: u32,
}

/// The same for one frame of a sequence: `selector`, made with these parameters, has seen the earlier frames.
pub(super) fn extract_next<S: Sample>(
    frame: &LitFrame<'_, S>,
    offset: Offset,
    params: &ExtractionParams,
    selector: &mut Selector,
    direction: StripeDirection,
) -> Centerline {
    let LitFrame { plane, full_scale, .. } = *frame;
    let kernel = Kernel::gaussian(params.blur_radius);
    let mut levels = Levels::new(params, &kernel, full_scale);
    let (width, height) = (plane.width, plane.height);
    let blurred = without_background(frame, &kernel, params, direction);
    if params.threshold == Threshold::Adaptive {
        let sample = |x: usize, y: usize| blurred[y * width + x];
        let found =
            NoiseThreshold::default().find((width, height), sample, params.threshold_sigmas);
        levels = levels.with_segment_threshold(found);
    }
    let mask: Vec<bool> = blurred.iter().map(|&sample| sample > levels.segment_threshold).collect();
    let stripe = keep_large_regions(&mask, width, params.min_segment_area);

    let picture = Picture { plane, direction };
    let (lines, length) = picture.size();
    let pixel = |line: usize, position: usize| match direction {
        StripeDirection::Horizontal => (line, position),
        StripeDirection::Vertical => (position, line),
    };
    let mut found = Vec::new();
    for line in 0..lines {
        let sample = |position: usize| {
            let (x, y) = pixel(line, position);
            stripe[y * width + x].then(|| blurred[y * width + x])
        };
        let candidates = candidates(length, sample).into_iter();
        found.extend(candidates.map(|candidate| LineCandidate { line: line as u32, candidate }));
    }
    let mut chosen = Vec::new();
    let sample = |line: u32, position: u32| {
        let (x, y) = pixel(line as usize, position as usize);
        blurred[y * width + x]
    };
    ValleyNoiseEstimator::default().adapt(&picture, &found, &mut levels);
    selector.select(&found, &levels, sample, &mut chosen);

    if params.noise == NoiseSource::Estimated {
        NoiseEstimator::default().estimate(&picture, &chosen, full_scale, &mut levels.noise);
    }
    let mut ridge = Ridge::new(params.ridge_sigma_px);

    let (mut centerline, mut shapes) = (Centerline::default(), Shapes::default());
    let mut assembler = Assembler::new(&mut centerline, &mut shapes, direction, offset, length);
    let cut = |found: &LineCandidate| {
        let LineCandidate { line, candidate } = *found;
        let margin = if candidate.is_broad() { 0 } else { levels.margin(&candidate) };
        let held = candidate.reach(margin, length);
        let origin = held.start as u32;
        let pixels: Vec<_> = held.map(|position| pixel(line as usize, position)).collect();
        let samples = pixels.iter().map(|&(x, y)| blurred[y * width + x]).collect();
        let raw = pixels.iter().map(|&(x, y)| plane.at(x, y).into()).collect();
        Section { samples, raw, origin, candidate }
    };
    for found in chosen {
        if found.candidate.is_broad() {
            assembler.push_broad(&found, &Broad::of(&cut(&found)), &levels);
            continue;
        }
        let points = Points::of_batch(&[found], |batch| {
            let mut alone = Sections::default();
            alone.load(batch.iter().map(cut));
            Points::measure(batch, &alone, &levels, |centres| {
                if params.method == Method::Steger {
                    ridge.refine(&picture, batch, &levels, centres);
                }
            })
        });
        assembler.push(&[found], &points, &levels);
    }
    TextureEstimator::new(params, direction).add_to(&mut centerline);
    shapes.judge(&mut centerline, direction, kernel.weights().len());
    centerline
}

/// Returns the blurred image minus its background.
fn without_background<S: Sample>(
    frame: &LitFrame<'_, S>,
    kernel: &Kernel,
    params: &ExtractionParams,
    direction: StripeDirection,
) -> Vec<u32> {
    let (width, height) = (frame.plane.width, frame.plane.height);
    let blur = |plane: &Plane<'_, S>| -> Vec<u32> {
        (0..width * height).map(|i| blurred_at(plane, kernel, i % width, i / width)).collect()
    };
    let mut blurred = blur(frame.plane);
    let background = match (params.background, frame.ambient) {
        (Background::Local, _) => local_background(&blurred, width, params, direction),
        (Background::Reference, Some(ambient)) => blur(ambient),
        (Background::None, _) | (Background::Reference, None) => vec![0; width * height],
    };
    for (sample, background) in blurred.iter_mut().zip(background) {
        *sample = sample.saturating_sub(background);
    }
    blurred
}

/// Returns the local background: structures across the stripe at least as wide as the window.
fn local_background(
    blurred: &[u32],
    width: usize,
    params: &ExtractionParams,
    direction: StripeDirection,
) -> Vec<u32> {
    let window_px = params.background_window_px;
    match direction {
        StripeDirection::Vertical => {
            blurred.chunks_exact(width).flat_map(|row| opened(row, window_px)).collect()
        }
        StripeDirection::Horizontal => {
            let column =
                |x: usize| -> Vec<u32> { blurred.chunks_exact(width).map(|row| row[x]).collect() };
            let columns: Vec<_> = (0..width).map(|x| opened(&column(x), window_px)).collect();
            (0..blurred.len()).map(|i| columns[i % width][i / width]).collect()
        }
    }
}

/// Marks pixels of 8-connected regions with more than `min_area` pixels, by flood fill.
fn keep_large_regions(mask: &[bool], width: usize, min_area: u32) -> Vec<bool> {
    let height = mask.len() / width;
    let mut kept = vec![false; mask.len()];
    let mut seen = vec![false; mask.len()];
    for seed in 0..mask.len() {
        if !mask[seed] || seen[seed] {
            continue;
        }
        seen[seed] = true;
        let mut region = vec![seed];
        let mut next = 0;
        while next < region.len() {
            let (x, y) = (region[next] % width, region[next] / width);
            next += 1;
            for near_y in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                for near_x in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    let near = near_y * width + near_x;
                    if mask[near] && !seen[near] {
                        seen[near] = true;
                        region.push(near);
                    }
                }
            }
        }
        if region.len() > min_area as usize {
            for pixel in region {
                kept[pixel] = true;
            }
        }
    }
    kept
}

/// Returns the runs of stripe pixels in a cross-section; `sample` returns the blurred sample at a position, or `None`
/// off the stripe.
fn candidates(length: usize, sample: impl Fn(usize) -> Option<u32>) -> Vec<Candidate> {
    let mut found: Vec<Candidate> = Vec::new();
    for position in 0..length {
        let Some(level) = sample(position) else { continue };
        let position = position as u32;
        match found.last_mut() {
            Some(run) if run.last + 1 == position => {
                run.last = position;
                run.peak = run.peak.max(level);
            }
            _ => found.push(Candidate::alone(position, position, level, 0)),
        }
    }
    for run in &mut found {
        run.dip = deepest_valley(run.first as usize..run.last as usize + 1, &sample);
    }
    found
}

/// Returns the largest depth of a sample below the lower of the largest samples on its two sides.
fn deepest_valley(run: Range<usize>, sample: impl Fn(usize) -> Option<u32>) -> u32 {
    let highest = |range: Range<usize>| range.filter_map(&sample).max().unwrap_or(0);
    run.clone()
        .filter_map(|at| {
            let lower = highest(run.start..at).min(highest(at + 1..run.end));
            Some(lower.saturating_sub(sample(at)?))
        })
        .max()
        .unwrap_or(0)
}

/// A single cross-section: the candidate's samples and their surroundings.
#[derive(Clone, Debug)]
pub(super) struct Section {
    /// Blurred samples, blurred units, of consecutive positions.
    pub(crate) samples: Vec<u32>,
    /// Unblurred samples at the same positions, sample units.
    pub(crate) raw: Vec<u32>,
    /// Position of `samples[0]` and `raw[0]`.
    pub(crate) origin: u32,
    /// The run of stripe pixels. It lies within `samples`; only the border cuts its margin short.
    pub(crate) candidate: Candidate,
}

impl Sections {
    /// Replaces all lanes by these sections. The window of each is all of its samples.
    ///
    /// # Panics
    /// More than [`LANES`] of them.
    pub(super) fn load(&mut self, sections: impl ExactSizeIterator<Item = Section> + Clone) {
        assert!(sections.len() <= LANES, "{} sections", sections.len());
        let rows = sections.clone().map(|section| section.samples.len()).max().unwrap_or(0);
        self.clear(sections.len(), rows);
        for (lane, section) in sections.enumerate() {
            for (i, (&raw, &blurred)) in section.raw.iter().zip(&section.samples).enumerate() {
                self.raw[i][lane] = raw as f32;
                self.blurred[i][lane] = grey(blurred) as f32;
            }
            let origin = section.origin as usize;
            self.place_lane(lane, 0, &(origin..origin + section.samples.len()), &section.candidate);
        }
    }
}

impl Broad {
    /// Returns the levels of a section that holds the candidate and nothing else.
    pub(super) fn of(section: &Section) -> Self {
        let (mut level, mut moment) = (0_u64, 0_u64);
        for (place, &sample) in (0_u64..).zip(&section.samples) {
            level += u64::from(sample);
            moment += place * u64::from(sample);
        }
        let brightest_raw = section.raw.iter().copied().max().unwrap_or(0);
        let raw_at = |place: usize| section.raw[place.min(section.raw.len() - 1)];
        Self::from_sums(level, moment, brightest_raw, raw_at)
    }
}

/// Returns the local background of every sample of a line: the definition of the opening in `background`.
pub(super) fn opened(line: &[u32], window_px: u32) -> Vec<u32> {
    let reach = window_px as usize / 2;
    let windows = |line: &[u32], extreme: fn(u32, u32) -> u32| -> Vec<u32> {
        let window = |at: usize| at.saturating_sub(reach)..(at + reach + 1).min(line.len());
        (0..line.len()).filter_map(|at| line[window(at)].iter().copied().reduce(extreme)).collect()
    };
    windows(&windows(line, u32::min), u32::max)
}
