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
    cut: Cut,
}

/// Samples about one candidate.
#[derive(Debug, Default)]
struct Cut {
    /// Blurred ones, and the position of the first.
    blurred: Vec<u32>,
    blurred_origin: u32,
    /// Raw ones, and the position of the first.
    raw: Vec<u32>,
    raw_origin: u32,
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
            cut: Cut::default(),
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
        let Self { kernel, params, direction, tiles, regions, lines, cut } = self;
        let levels = Levels::new(params, kernel, full_scale);
        tiles.compute(plane, kernel, levels.segment_threshold);
        tiles.segment(levels.segment_threshold, regions);
        let (count, length) = match direction {
            StripeDirection::Horizontal => (plane.width, plane.height),
            StripeDirection::Vertical => (plane.height, plane.width),
        };
        lines.clear();
        lines.resize(count, Line::default());
        choose(lines, regions, tiles, (params, *direction));
        let mut assembler = Assembler::new(centerline, *direction, offset, length);
        for (line, chosen) in lines.iter_mut().enumerate() {
            let Some(candidate) = chosen.selected.take() else { continue };
            let reach = |margin: u32| {
                let from = candidate.first.saturating_sub(margin) as usize;
                from..((candidate.last + margin) as usize + 1).min(length)
            };
            let (wide, near) = (reach(levels.margin(&candidate)), reach(1));
            (cut.blurred_origin, cut.raw_origin) = (wide.start as u32, near.start as u32);
            cut.raw.clear();
            match direction {
                StripeDirection::Horizontal => {
                    tiles.column(plane, kernel, (line, wide), &mut cut.blurred);
                    cut.raw.extend(near.map(|y| Into::<u32>::into(plane.at(line, y))));
                }
                StripeDirection::Vertical => {
                    tiles.row(plane, kernel, (line, wide), &mut cut.blurred);
                    cut.raw.extend(
                        plane.row(line)[near].iter().map(|&sample| Into::<u32>::into(sample)),
                    );
                }
            }
            let section = Section { samples: &cut.blurred, origin: cut.blurred_origin, candidate };
            assembler.push(
                line,
                &section,
                &Raw { samples: &cut.raw, origin: cut.raw_origin },
                &levels,
            );
        }
    }
}

/// Finds every cross-section's candidates in the kept runs and chooses one.
fn choose<S: Sample>(
    lines: &mut [Line],
    regions: &mut Regions,
    tiles: &BlurredTiles<S>,
    (params, direction): (&ExtractionParams, StripeDirection),
) {
    let selection = params.peak_selection;
    for run in regions.larger_than(params.min_segment_area) {
        match direction {
            StripeDirection::Horizontal => add_across(lines, run, tiles, selection),
            StripeDirection::Vertical => {
                let row = run.row as usize;
                let peak =
                    (run.start..run.end).map(|x| tiles.known(x as usize, row)).max().unwrap_or(0);
                let candidate = Candidate { first: run.start, last: run.end - 1, peak, count: 1 };
                lines[row].selected.offer(candidate, selection);
            }
        }
    }
    for line in lines {
        line.close(selection);
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
