//! Steps 5 to 8 on cross-sections side by side; assembles the points into a centreline.

use super::{
    Centerline,
    broad::Broad,
    fir_peak::fir_peak,
    flag,
    fractional::fractional_window_gravity,
    gaussian_fit::{coarse_peak, gaussian_fit},
    gaussian_ml::gaussian_ml,
    gravity::{gray_gravity, rounded_window_gravity, width_samples, window_half_length_px},
    lanes::{Centres, LANES, Lane, Sections, append},
    log_gaussian::log_gaussian,
    section::{Candidate, Levels, LineCandidate},
    shape::{SHARES, Shape, Shapes},
    width::{Edges, brightest, brightest_raw, full_width_half_maximum, raw_at},
};
use crate::scanner::{
    channel::Offset,
    params::{GravityWindow, Method, StripeDirection},
};

/// Steps 5 to 8: returns the centres of cross-sections by the chosen method; `brightest` is the position of each one's
/// peak.
///
/// **To add an estimator, add an arm here**: a function from [`Sections`] to [`Centres`] in a file of its own, its name in
/// [`Method`], and the correlation of its centres in [`super::correlation`]. The parameter's choices and the test that fast
/// equals reference follow from the name.
#[inline(always)]
pub(super) fn centres(sections: &Sections, brightest: &Lane, levels: &Levels<'_>) -> Centres {
    let noise = &levels.noise;
    let full_scale = levels.full_scale as f32;
    match levels.method {
        Method::GrayGravity => gray_gravity(sections, noise),
        // The ridge search needs the picture; it starts at the fit's maximum.
        Method::GaussianFit | Method::Steger => gaussian_fit(sections, brightest, noise),
        Method::GaussianMl => gaussian_ml(sections, noise.into(), full_scale),
        Method::LogGaussian => log_gaussian(sections, noise.into(), full_scale),
        Method::FirPeak => fir_peak(sections, noise.into(), full_scale),
        Method::ImprovedGravity => {
            let coarse_px = coarse_peak(sections, brightest);
            let width_samples = width_samples(sections, levels.width_threshold);
            let half_length_px = window_half_length_px(&width_samples);
            match levels.window {
                GravityWindow::Rounded => {
                    rounded_window_gravity(sections, &coarse_px, &half_length_px, noise)
                }
                GravityWindow::Fractional => {
                    fractional_window_gravity(sections, &coarse_px, &half_length_px, noise)
                }
            }
        }
    }
}

/// Points of one batch of cross-sections, one per lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    /// Positions from which the centres count: the first samples of the candidates.
    first: [u32; LANES],
    centres: Centres,
    width_px: Lane,
    intensity: Lane,
    brightest_raw: Lane,
    /// Shapes of the cross-sections.
    shape: Shape,
}

impl Points {
    /// Measures the cross-sections of these candidates, one per lane. `refine` may correct the centres with further
    /// information from the picture.
    #[inline(always)]
    pub(super) fn measure(
        found: &[LineCandidate],
        sections: &Sections,
        levels: &Levels<'_>,
        refine: impl FnOnce(&mut Centres),
    ) -> Self {
        let brightest = brightest(sections);
        let mut centres = centres(sections, &brightest, levels);
        refine(&mut centres);
        let edges = Edges::at(sections, &brightest, SHARES);
        let [_, half, _] = &edges;
        let mut first = [0; LANES];
        for (first, found) in first.iter_mut().zip(found) {
            *first = found.candidate.first;
        }
        Self {
            first,
            centres,
            width_px: full_width_half_maximum(half, levels.noise.kernel.variance_px2()),
            intensity: raw_at(sections, &centres.position_px),
            brightest_raw: brightest_raw(sections),
            shape: Shape::of(sections, &edges, levels),
        }
    }

    /// Measures these candidates, one per lane, with `measure`; where a halo lies under the stripe or a neighbour touches
    /// it, the centre is that of its top alone.
    #[inline(always)]
    pub(super) fn of_batch(
        batch: &[LineCandidate],
        mut measure: impl FnMut(&[LineCandidate]) -> Self,
    ) -> Self {
        let mut points = measure(batch);
        let (mut tops, mut lanes) = ([LineCandidate::default(); LANES], [0; LANES]);
        let mut num_tops = 0;
        for (lane, found) in batch.iter().enumerate() {
            if let Some(top) = points.top(lane, found) {
                (tops[num_tops], lanes[num_tops]) = (top, lane);
                num_tops += 1;
            }
        }
        if num_tops > 0 {
            let again = measure(&tops[..num_tops]);
            for (other, &lane) in lanes[..num_tops].iter().enumerate() {
                points.first[lane] = again.first[other];
                points.centres.position_px[lane] = again.centres.position_px[other];
                points.centres.sigma_px[lane] = again.centres.sigma_px[other];
                points.intensity[lane] = again.intensity[other];
            }
        }
        points
    }

    /// Returns the top of the candidate, if it has to be measured alone.
    fn top(&self, lane: usize, found: &LineCandidate) -> Option<LineCandidate> {
        let has_company = self.shape.has_halo(lane) || found.candidate.touches_neighbour();
        let [first, last] = has_company.then(|| self.shape.top(lane)).flatten()?;
        let candidate = found.candidate.part(first as u32, last as u32);
        Some(LineCandidate { candidate, ..*found })
    }
}

/// Builds a centreline from cross-sections in order along the stripe.
#[derive(Debug)]
pub(super) struct Assembler<'a> {
    centerline: &'a mut Centerline,
    shapes: &'a mut Shapes,
    direction: StripeDirection,
    /// Column and row of the searched region in the image.
    offset: Offset,
    /// Positions across the stripe: rows of the region for a horizontal stripe.
    length_across: u32,
    /// The cross-section pushed last.
    previous: Option<Place>,
}

impl<'a> Assembler<'a> {
    /// Starts an empty centreline in a region of `length_across` positions across the stripe.
    pub(super) fn new(
        centerline: &'a mut Centerline,
        shapes: &'a mut Shapes,
        direction: StripeDirection,
        offset: Offset,
        length_across: usize,
    ) -> Self {
        centerline.clear();
        shapes.clear();
        let length_across = length_across as u32;
        Self { centerline, shapes, direction, offset, length_across, previous: None }
    }

    /// Adds the points of these candidates.
    pub(super) fn push(&mut self, found: &[LineCandidate], points: &Points, levels: &Levels<'_>) {
        let (mut across_px, mut along_px, mut flags) = ([0.0; LANES], [0.0; LANES], [0; LANES]);
        for (lane, found) in found.iter().enumerate() {
            let is_saturated = points.brightest_raw[lane] >= levels.full_scale as f32;
            let is_low = levels.is_low(found.candidate.peak, points.intensity[lane]);
            flags[lane] = (u8::from(is_saturated) * flag::SATURATED)
                | (u8::from(is_low) * flag::LOW_CONTRAST)
                | self.flags_of(&found.candidate);
            along_px[lane] = self.along_px(found.line);
            let position_px = points.centres.position_px[lane].into();
            across_px[lane] = self.across_px(points.first[lane], position_px);
        }
        let at = self.centerline.flags.len();
        for (lane, found) in found.iter().enumerate() {
            self.join(at + lane, found);
        }
        let count = found.len();
        append(self.along(), &along_px, count);
        append(self.across(), &across_px, count);
        append(&mut self.centerline.flags, &flags, count);
        append(&mut self.centerline.width_px, &points.width_px, count);
        append(&mut self.centerline.intensity, &points.intensity, count);
        append(&mut self.centerline.sigma_px, &points.centres.sigma_px, count);
        self.shapes.push(&points.shape, count);
    }

    /// Adds the point of a candidate that is too long for a cross-section of the stripe: its centre of gravity. The
    /// true centre may be anywhere in it.
    pub(super) fn push_broad(&mut self, found: &LineCandidate, broad: &Broad, levels: &Levels<'_>) {
        let is_saturated = broad.brightest_raw >= levels.full_scale;
        let flags = flag::LOW_CONTRAST | if is_saturated { flag::SATURATED } else { 0 };
        self.join(self.centerline.flags.len(), found);
        self.centerline.flags.push(flags | self.flags_of(&found.candidate));
        let along_px = self.along_px(found.line);
        self.along().push(along_px);
        let across_px = self.across_px(found.candidate.first, broad.position_px);
        self.across().push(across_px);
        self.shapes.push_broad();
        self.centerline.width_px.push(f32::NAN);
        self.centerline.intensity.push(broad.intensity);
        // Uniform distribution over the candidate.
        let sigma_px = f64::from(found.candidate.length()) / 12.0_f64.sqrt();
        self.centerline.sigma_px.push(sigma_px as f32);
    }

    /// Starts a stripe at the point of that index if its candidate does not continue the one before.
    #[inline(always)]
    fn join(&mut self, at: usize, found: &LineCandidate) {
        let LineCandidate { line, candidate: Candidate { first, last, .. } } = *found;
        let next = Place { line, first, last };
        if !self.previous.is_some_and(|previous| previous.continues_in(&next)) {
            self.centerline.stripe_start.push(at as u32);
        }
        self.previous = Some(next);
    }

    /// Returns the flags that follow from a candidate's place.
    #[inline(always)]
    fn flags_of(&self, candidate: &Candidate) -> u8 {
        let is_one_of_several = candidate.count > 1;
        let is_clipped = (candidate.first == 0) | (candidate.last + 1 == self.length_across);
        (u8::from(is_one_of_several) * flag::MULTIPLE_PEAKS)
            | (u8::from(is_clipped) * flag::CLIPPED)
    }

    /// Returns the position of a line in the image, pixels.
    #[inline(always)]
    const fn along_px(&self, line: u32) -> f32 {
        let offset = match self.direction {
            StripeDirection::Horizontal => self.offset.column,
            StripeDirection::Vertical => self.offset.row,
        };
        (offset as u32 + line) as f32
    }

    /// Returns the array that holds the lines' positions.
    #[inline(always)]
    const fn along(&mut self) -> &mut Vec<f32> {
        match self.direction {
            StripeDirection::Horizontal => &mut self.centerline.u_px,
            StripeDirection::Vertical => &mut self.centerline.v_px,
        }
    }

    /// Returns the position across the stripe in the image of a position counted from `first`, pixels.
    #[inline(always)]
    fn across_px(&self, first: u32, position_px: f64) -> f32 {
        let offset = match self.direction {
            StripeDirection::Horizontal => self.offset.row,
            StripeDirection::Vertical => self.offset.column,
        };
        (f64::from(offset as u32 + first) + position_px) as f32
    }

    /// Returns the array that holds positions across the stripe.
    #[inline(always)]
    const fn across(&mut self) -> &mut Vec<f32> {
        match self.direction {
            StripeDirection::Horizontal => &mut self.centerline.v_px,
            StripeDirection::Vertical => &mut self.centerline.u_px,
        }
    }
}

/// The samples of a candidate in the searched region.
#[derive(Clone, Copy, Debug)]
struct Place {
    line: u32,
    first: u32,
    last: u32,
}

impl Place {
    /// True if `next` lies in the next line and touches this one, corners included.
    const fn continues_in(&self, next: &Self) -> bool {
        (self.line + 1 == next.line) & (next.first <= self.last + 1) & (self.first <= next.last + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::{
        params::ExtractionParams,
        stripe::{
            blur::{Kernel, UNITS},
            reference::Section,
            section::grey,
        },
    };
    use proptest::prelude::*;

    /// Returns the longest run of samples above the threshold.
    fn longest_run(samples: &[u32], threshold: u32) -> Option<Candidate> {
        let mut longest: Option<Candidate> = None;
        let mut first = 0;
        for run in samples.split_inclusive(|&sample| sample <= threshold) {
            let length = run.iter().filter(|&&sample| sample > threshold).count() as u32;
            if length > longest.map_or(0, |longest| longest.length()) {
                let peak = run.iter().copied().max().unwrap_or(0);
                longest = Some(Candidate::alone(first, first + length - 1, peak, 0));
            }
            first += run.len() as u32;
        }
        longest
    }

    /// Any levels, or a symmetric section.
    fn any_section() -> impl Strategy<Value = Vec<u32>> {
        (prop::collection::vec(0..255_u32, 6..20), any::<bool>(), 0..2_usize).prop_map(
            |(half, is_even, shared)| {
                let back: Vec<u32> = half.iter().rev().skip(shared).copied().collect();
                if is_even { [half, back].concat() } else { half }
            },
        )
    }

    /// Sections of whole samples, each starting in its own row.
    fn placed(lanes: &[(usize, &Vec<u32>, Candidate)]) -> Sections {
        let mut sections = Sections::default();
        let rows = lanes.iter().map(|(start, samples, _)| start + samples.len()).max();
        sections.clear(lanes.len(), rows.unwrap_or(0));
        for (lane, (start, samples, candidate)) in lanes.iter().enumerate() {
            for (row, &sample) in (*start..).zip(*samples) {
                sections.raw[row][lane] = (sample / UNITS) as f32;
                sections.blurred[row][lane] = grey(sample) as f32;
            }
            sections.place_lane(lane, *start, &(0..samples.len()), candidate);
        }
        sections
    }

    proptest! {
        /// No estimator reads anything beyond the margin of its section.
        #[test]
        fn the_margin_is_wide_enough(
            samples in prop::collection::vec(0..255 * UNITS, 1..80),
            threshold in 0..255_u32,
            width_threshold in 0..255_u32,
            blur_radius in 0..4_u32,
        ) {
            let kernel = Kernel::gaussian(blur_radius);
            for method in Method::NAMES.iter().filter_map(|name| Method::from_name(name)) {
                for window in [GravityWindow::Fractional, GravityWindow::Rounded] {
                    let params = ExtractionParams {
                        method,
                        window,
                        blur_radius,
                        segment_threshold: f64::from(threshold),
                        width_threshold: f64::from(width_threshold),
                        ..ExtractionParams::default()
                    };
                    let levels = Levels::new(&params, &kernel, 255);
                    let Some(candidate) = longest_run(&samples, levels.segment_threshold) else {
                        continue;
                    };
                    let held = candidate.reach(levels.margin(&candidate), samples.len());
                    let others: Vec<u32> = (0..)
                        .zip(&samples)
                        .map(|(at, &sample)| if held.contains(&at) { sample } else { 0 })
                        .collect();
                    let [expected, actual] = [&samples, &others].map(|samples| {
                        let mut sections = Sections::default();
                        let samples = samples.clone();
                        let section =
                            Section { raw: samples.clone(), samples, origin: 0, candidate };
                        sections.load(std::iter::once(section));
                        let centres = centres(&sections, &brightest(&sections), &levels);
                        (centres.position_px[0], centres.sigma_px[0])
                    });
                    // These use the whole loaded section as their window.
                    let takes_all =
                        [Method::GaussianMl, Method::LogGaussian, Method::FirPeak].contains(&method);
                    prop_assert!(takes_all || expected == actual, "{expected:?} {actual:?}");
                    prop_assert!(actual.0.is_finite() && actual.1.is_finite());
                }
            }
        }

        /// A lane gives the same bits wherever in the batch its window begins, and beside any neighbour. In even
        /// sections, windows end within a rounding error of a sample, where a dependence on position would show.
        #[test]
        fn a_lane_does_not_know_its_place(
            samples in any_section(),
            other in any_section(),
            starts in prop::array::uniform2(0..120_usize),
            threshold in 0..200_u32,
        ) {
            let kernel = Kernel::gaussian(3);
            let [samples, other] =
                [samples, other].map(|s| s.iter().map(|&s| s * UNITS).collect::<Vec<_>>());
            let runs = [&samples, &other].map(|s| longest_run(s, threshold * UNITS));
            let [Some(candidate), Some(neighbour)] = runs else { return Ok(()) };
            for method in Method::NAMES.iter().filter_map(|name| Method::from_name(name)) {
                let params = ExtractionParams { method, ..ExtractionParams::default() };
                let levels = Levels::new(&params, &kernel, 255);
                let [alone, beside] = [
                    vec![(0, &samples, candidate)],
                    vec![(starts[0], &samples, candidate), (starts[1], &other, neighbour)],
                ]
                .map(|lanes| {
                    let sections = placed(&lanes);
                    let centres = centres(&sections, &brightest(&sections), &levels);
                    (centres.position_px[0].to_bits(), centres.sigma_px[0].to_bits())
                });
                prop_assert_eq!(alone, beside, "{:?}", method);
            }
        }
    }
}
