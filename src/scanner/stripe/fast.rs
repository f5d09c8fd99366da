//! The same method at the speed of one read of the frame. Equal to [`reference`](super::reference) bit for bit.

use super::{
    Centerline,
    blur::{Kernel, Sample},
    measure::{Assembler, Raw},
    section::{Candidate, Levels, Section},
    segment::{Regions, Run},
    select::Selected,
    tiles::BlurredTiles,
};
use crate::scanner::{
    channel::Plane,
    params::{ExtractionParams, PeakSelection, StripeDirection},
};

/// Extracts frame after frame without allocating once the first of a size has been seen.
#[derive(Debug)]
pub struct FastExtractor<S: Sample> {
    kernel: Kernel,
    params: ExtractionParams,
    direction: StripeDirection,
    tiles: BlurredTiles<S>,
    regions: Regions,
    lines: Vec<Line>,
    samples: Vec<u32>,
    raw: Vec<u32>,
}

/// What is known of one cross-section while runs arrive row by row.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// The candidate that may still grow; `count` 0: none.
    open: Candidate,
    selected: Selected,
}

impl Line {
    fn close(&mut self, selection: PeakSelection) {
        if self.open.count > 0 {
            self.selected.offer(std::mem::take(&mut self.open), selection);
        }
    }
}

impl<S: Sample> FastExtractor<S> {
    /// An extractor with these settings.
    pub fn new(params: ExtractionParams, direction: StripeDirection) -> Self {
        Self {
            kernel: Kernel::gaussian(params.blur_radius),
            params,
            direction,
            tiles: BlurredTiles::default(),
            regions: Regions::default(),
            lines: Vec::new(),
            samples: Vec::new(),
            raw: Vec::new(),
        }
    }

    /// Replaces `centerline` by that of a plane whose top-left sample lies at `offset` (column, row) of the image.
    pub fn extract(
        &mut self,
        plane: &Plane<'_, S>,
        offset: (usize, usize),
        full_scale: u32,
        centerline: &mut Centerline,
    ) {
        let levels = Levels::new(&self.params, &self.kernel, full_scale);
        self.tiles.compute(plane, &self.kernel, levels.segment_threshold);
        self.tiles.segment(levels.segment_threshold, &mut self.regions);
        self.choose(plane.width, plane.height);
        let length = match self.direction {
            StripeDirection::Horizontal => plane.height,
            StripeDirection::Vertical => plane.width,
        };
        let mut assembler = Assembler::new(centerline, self.direction, offset, length);
        for line in 0..self.lines.len() {
            if let Some(candidate) = self.lines[line].selected.take() {
                let (section_start, raw_start) = self.gather(plane, line, candidate, &levels);
                let section = Section { samples: &self.samples, origin: section_start, candidate };
                assembler.push(
                    line,
                    &section,
                    &Raw { samples: &self.raw, origin: raw_start },
                    &levels,
                );
            }
        }
    }

    /// Finds every cross-section's candidates in the kept runs and chooses one.
    fn choose(&mut self, width: usize, height: usize) {
        let selection = self.params.peak_selection;
        self.lines.clear();
        match self.direction {
            StripeDirection::Horizontal => {
                self.lines.resize(width, Line::default());
                for run in self.regions.larger_than(self.params.min_segment_area) {
                    add_across(&mut self.lines, run, &self.tiles, selection);
                }
                self.lines.iter_mut().for_each(|line| line.close(selection));
            }
            StripeDirection::Vertical => {
                self.lines.resize(height, Line::default());
                for run in self.regions.larger_than(self.params.min_segment_area) {
                    let row = run.row as usize;
                    let peak = (run.start..run.end)
                        .map(|x| self.tiles.known(x as usize, row))
                        .max()
                        .unwrap_or(0);
                    let candidate =
                        Candidate { first: run.start, last: run.end - 1, peak, count: 1 };
                    self.lines[row].selected.offer(candidate, selection);
                }
            }
        }
    }

    /// Copies the samples about a candidate into `self.samples` and `self.raw`; returns where each begins.
    fn gather(
        &mut self,
        plane: &Plane<'_, S>,
        line: usize,
        candidate: Candidate,
        levels: &Levels,
    ) -> (u32, u32) {
        let length = match self.direction {
            StripeDirection::Horizontal => plane.height,
            StripeDirection::Vertical => plane.width,
        };
        let reach = |margin: u32| {
            let from = candidate.first.saturating_sub(margin) as usize;
            from..((candidate.last + margin) as usize + 1).min(length)
        };
        let (wide, near) = (reach(levels.margin(&candidate)), reach(1));
        let starts = (wide.start as u32, near.start as u32);
        self.raw.clear();
        match self.direction {
            StripeDirection::Horizontal => {
                self.tiles.column(plane, &self.kernel, (line, wide), &mut self.samples);
                self.raw.extend(near.map(|y| Into::<u32>::into(plane.at(line, y))));
            }
            StripeDirection::Vertical => {
                self.tiles.row(plane, &self.kernel, (line, wide), &mut self.samples);
                self.raw
                    .extend(plane.row(line)[near].iter().map(|&sample| Into::<u32>::into(sample)));
            }
        }
        starts
    }
}

/// Adds a run of one row to the columns it covers.
fn add_across<S: Sample>(
    lines: &mut [Line],
    run: Run,
    tiles: &BlurredTiles<S>,
    selection: PeakSelection,
) {
    let columns = run.start as usize..run.end as usize;
    for (x, line) in columns.clone().zip(&mut lines[columns]) {
        let level = tiles.known(x, run.row as usize);
        if line.open.count > 0 && line.open.last + 1 == run.row {
            line.open.last = run.row;
            line.open.peak = line.open.peak.max(level);
        } else {
            line.close(selection);
            line.open = Candidate { first: run.row, last: run.row, peak: level, count: 1 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::{
        params::{Method, Window},
        stripe::reference,
    };
    use proptest::prelude::*;

    fn any_params() -> impl Strategy<Value = ExtractionParams> {
        let methods = prop::sample::select(vec![
            Method::GrayGravity,
            Method::GaussianFit,
            Method::ImprovedGravity,
        ]);
        let windows = prop::sample::select(vec![Window::Fractional, Window::Rounded]);
        let peaks = prop::sample::select(vec![
            PeakSelection::Brightest,
            PeakSelection::First,
            PeakSelection::Last,
            PeakSelection::Widest,
        ]);
        (methods, windows, peaks, 0..12_u32, 0..200_u32, 0..40_u32, 0..255_u32).prop_map(
            |(method, window, peak_selection, blur_radius, threshold, min_segment_area, width)| {
                ExtractionParams {
                    method,
                    window,
                    blur_radius,
                    segment_threshold: f64::from(threshold) / 2.0,
                    min_segment_area,
                    width_threshold: f64::from(width),
                    peak_selection,
                    read_noise: 2.0,
                    shot_gain: 0.1,
                }
            },
        )
    }

    /// Sizes from 1 x 1 to several tiles; black, sparse spots and dense noise; a stride wider than the rows.
    fn any_plane<S: Sample + Arbitrary>() -> impl Strategy<Value = (usize, usize, usize, Vec<S>)> {
        (1..140_usize, 1..40_usize, 0..5_usize, 1..200_usize).prop_flat_map(
            |(width, height, padding, sparsity)| {
                let stride = width + padding;
                let spots = prop::collection::vec(
                    (0..stride * height, any::<S>()),
                    stride * height / sparsity,
                );
                spots.prop_map(move |spots| {
                    let mut samples = vec![S::default(); stride * height];
                    for (at, sample) in spots {
                        samples[at] = sample;
                    }
                    (width, height, stride, samples)
                })
            },
        )
    }

    /// Bits, so that NaN equals itself.
    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    fn assert_equal(fast: &Centerline, reference: &Centerline) {
        assert_eq!(bits(&fast.u_px), bits(&reference.u_px));
        assert_eq!(bits(&fast.v_px), bits(&reference.v_px));
        assert_eq!(fast.stripe_start, reference.stripe_start);
        assert_eq!(bits(&fast.width_px), bits(&reference.width_px));
        assert_eq!(bits(&fast.intensity), bits(&reference.intensity));
        assert_eq!(bits(&fast.sigma_px), bits(&reference.sigma_px));
        assert_eq!(fast.flags, reference.flags);
    }

    fn check<S: Sample>(
        params: ExtractionParams,
        full_scale: u32,
        planes: &[(usize, usize, usize, Vec<S>)],
    ) {
        for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
            // One extractor for all: what an earlier frame left behind must not show.
            let mut fast = FastExtractor::new(params, direction);
            let mut centerline = Centerline::default();
            for (width, height, stride, samples) in planes {
                let plane = Plane { width: *width, height: *height, stride: *stride, samples };
                fast.extract(&plane, (3, 7), full_scale, &mut centerline);
                let expected = reference::extract(&plane, (3, 7), &params, direction, full_scale);
                assert_equal(&centerline, &expected);
            }
        }
    }

    proptest! {
        #[test]
        fn fast_equals_reference_on_8_bit(
            params in any_params(),
            planes in prop::collection::vec(any_plane::<u8>(), 1..4),
        ) {
            check(params, 255, &planes);
        }

        #[test]
        fn fast_equals_reference_on_16_bit(
            params in any_params(),
            planes in prop::collection::vec(any_plane::<u16>(), 1..4),
            full_scale in prop::sample::select(vec![1023_u32, 4095, 65_535]),
        ) {
            check(params, full_scale, &planes);
        }
    }
}
