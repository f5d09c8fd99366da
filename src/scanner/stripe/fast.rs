//! The same method, its costly steps only where stripe can be. Equal to [`reference`](super::reference) bit for bit.

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
    blurred: Vec<u32>,
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
            let wide = candidate.reach(levels.margin(&candidate), length);
            let near = candidate.reach(1, length);
            let (wide_start, near_start) = (wide.start as u32, near.start as u32);
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
            let section = Section { samples: &cut.blurred, origin: wide_start, candidate };
            let raw = Raw { samples: &cut.raw, origin: near_start };
            assembler.push(line, &section, &raw, &levels);
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
        stripe::{
            reference,
            tiles::{COLUMNS, ROWS},
        },
    };
    use proptest::prelude::*;

    /// Width, height, stride and samples.
    type OwnedPlane<S> = (usize, usize, usize, Vec<S>);

    /// Every value of a choice, by its names: a new estimator is tested as soon as it has one.
    fn any_of<T: Clone + std::fmt::Debug + 'static>(
        names: &'static [&'static str],
        from_name: fn(&str) -> Option<T>,
    ) -> impl Strategy<Value = T> {
        prop::sample::select(names.iter().filter_map(|name| from_name(name)).collect::<Vec<_>>())
    }

    fn any_params() -> impl Strategy<Value = ExtractionParams> {
        let choices = (
            any_of(Method::NAMES, Method::from_name),
            any_of(Window::NAMES, Window::from_name),
            any_of(PeakSelection::NAMES, PeakSelection::from_name),
        );
        // The plain definition takes (2r + 1)² steps a pixel: large radii now and then.
        let radius = prop_oneof![3 => 0..4_u32, 1 => 4..=15_u32];
        // Halves of grey levels: samples can lie exactly on a threshold, and between two.
        let threshold = prop_oneof![0..20_u32, 0..200_u32];
        (choices, radius, threshold, 0..40_u32, 0..255_u32).prop_map(
            |((method, window, peak_selection), blur_radius, threshold, area, width)| {
                ExtractionParams {
                    method,
                    window,
                    blur_radius,
                    segment_threshold: f64::from(threshold) / 2.0,
                    min_segment_area: area,
                    width_threshold: f64::from(width),
                    peak_selection,
                    read_noise: 2.0,
                    shot_gain: 0.1,
                }
            },
        )
    }

    /// From 1 to `tiles` tiles and a little, half of them about the border of a tile.
    fn any_side(tile: usize, tiles: usize) -> impl Strategy<Value = usize> {
        let about_borders = (1..=tiles, 0..=2_usize);
        prop_oneof![
            about_borders.prop_map(move |(count, beyond)| count * tile + beyond - 1),
            1..=tiles * tile + 8,
        ]
    }

    /// Any level, or one about the lower thresholds.
    fn any_level<S: Sample + Arbitrary + From<u8>>() -> impl Strategy<Value = S> {
        prop_oneof![any::<S>(), (0..12_u8).prop_map(S::from)]
    }

    /// Over an even background, a few blocks that leave most tiles cold, or dense noise; a stride wider than the rows.
    fn any_plane<S: Sample + Arbitrary + From<u8>>(
        (width, height, padding): (usize, usize, usize),
    ) -> impl Strategy<Value = OwnedPlane<S>> {
        let stride = width + padding;
        let block = (0..stride, 0..height, 1..9_usize, 1..17_usize, any_level::<S>());
        let few = prop::collection::vec(block, 0..5);
        let many = (1..50_usize).prop_flat_map(move |sparsity| {
            let pixel = (0..stride, 0..height, Just(1), Just(1), any_level::<S>());
            prop::collection::vec(pixel, stride * height / sparsity)
        });
        let background = prop_oneof![Just(0), 0..12_u8];
        (background, prop_oneof![few, many]).prop_map(move |(background, blocks)| {
            let mut samples = vec![S::from(background); stride * height];
            for (x, y, columns, rows, level) in blocks {
                for row in y..(y + rows).min(height) {
                    let end = (x + columns).min(stride);
                    samples[row * stride + x..row * stride + end].fill(level);
                }
            }
            (width, height, stride, samples)
        })
    }

    /// Frames of one size, then frames of another.
    fn any_planes<S: Sample + Arbitrary + From<u8>>() -> impl Strategy<Value = Vec<OwnedPlane<S>>> {
        let size = || (any_side(COLUMNS, 2), any_side(ROWS, 5), 0..5_usize);
        let frames = |size| prop::collection::vec(any_plane(size), 1..4);
        (size().prop_flat_map(frames), size().prop_flat_map(frames))
            .prop_map(|(one, other)| one.into_iter().chain(other).collect())
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

    fn check<S: Sample>(params: ExtractionParams, full_scale: u32, planes: &[OwnedPlane<S>]) {
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
            planes in any_planes::<u8>(),
        ) {
            check(params, 255, &planes);
        }

        #[test]
        fn fast_equals_reference_on_16_bit(
            params in any_params(),
            planes in any_planes::<u16>(),
            full_scale in prop::sample::select(vec![1023_u32, 4095, 65_535]),
        ) {
            check(params, full_scale, &planes);
        }
    }

    /// One run every second pixel, joined into one region (a checkerboard) or each a region of its own (dots).
    #[test]
    fn the_densest_patterns_are_measured_too() {
        let (width, height) = (130, 70);
        let pattern = |is_bright: fn(usize, usize) -> bool| {
            let samples = (0..width * height)
                .map(|at| if is_bright(at % width, at / width) { 255_u8 } else { 0 })
                .collect();
            (width, height, width, samples)
        };
        let planes = [pattern(|x, y| (x + y) % 2 == 0), pattern(|x, y| x % 2 == 0 && y % 2 == 0)];
        for min_segment_area in [0, 1, 4549, 4550] {
            let params = ExtractionParams {
                method: Method::ImprovedGravity,
                window: Window::Fractional,
                blur_radius: 0,
                segment_threshold: 35.0,
                min_segment_area,
                width_threshold: 50.0,
                peak_selection: PeakSelection::Brightest,
                read_noise: 2.0,
                shot_gain: 0.1,
            };
            check(params, 255, &planes);
        }
    }
}
