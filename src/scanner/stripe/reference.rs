//! The definition: the method on a whole image, as plainly as it can be written. What is fast must equal it.

use super::{
    Centerline,
    blur::{Kernel, Sample, blurred_at},
    measure::{Assembler, Raw},
    section::{Candidate, Levels, Section},
    select::Selected,
};
use crate::scanner::{
    channel::Plane,
    params::{ExtractionParams, StripeDirection},
};

/// The centreline of a plane whose top-left sample lies at `offset` (column, row) of the image.
pub fn extract<S: Sample>(
    plane: &Plane<'_, S>,
    offset: (usize, usize),
    params: &ExtractionParams,
    direction: StripeDirection,
    full_scale: u32,
) -> Centerline {
    let kernel = Kernel::gaussian(params.blur_radius);
    let levels = Levels::new(params, &kernel, full_scale);
    let (width, height) = (plane.width, plane.height);
    let blurred: Vec<u32> =
        (0..width * height).map(|i| blurred_at(plane, &kernel, i % width, i / width)).collect();
    let mask: Vec<bool> = blurred.iter().map(|&sample| sample > levels.segment_threshold).collect();
    let stripe = keep_large_regions(&mask, width, params.min_segment_area);

    let (lines, length) = match direction {
        StripeDirection::Horizontal => (width, height),
        StripeDirection::Vertical => (height, width),
    };
    let pixel = |line: usize, position: usize| match direction {
        StripeDirection::Horizontal => (line, position),
        StripeDirection::Vertical => (position, line),
    };
    let mut centerline = Centerline::default();
    let mut assembler = Assembler::new(&mut centerline, direction, offset, length);
    for line in 0..lines {
        let at = |position: usize| {
            let (x, y) = pixel(line, position);
            y * width + x
        };
        let mut selected = Selected::default();
        for candidate in
            candidates(length, |position| stripe[at(position)].then(|| blurred[at(position)]))
        {
            selected.offer(candidate, params.peak_selection);
        }
        let Some(candidate) = selected.take() else { continue };
        let wide = candidate.reach(levels.margin(&candidate), length);
        let near = candidate.reach(1, length);
        let (blurred_origin, raw_origin) = (wide.start as u32, near.start as u32);
        let samples: Vec<u32> = wide.map(|position| blurred[at(position)]).collect();
        let section = Section { samples: &samples, origin: blurred_origin, candidate };
        let raw: Vec<u32> = near
            .map(|position| {
                let (x, y) = pixel(line, position);
                plane.at(x, y).into()
            })
            .collect();
        assembler.push(line, &section, &Raw { samples: &raw, origin: raw_origin }, &levels);
    }
    centerline
}

/// Pixels of 8-connected regions with more than `min_area` pixels, by flood fill.
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

/// Runs of stripe pixels in a cross-section; `sample` gives the blurred sample at a position, or none off the stripe.
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
            _ => found.push(Candidate { first: position, last: position, peak: level, count: 1 }),
        }
    }
    found
}
