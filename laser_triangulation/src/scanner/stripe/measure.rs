//! Steps 5 to 8 on cross-sections side by side.

use super::{
    fir_peak::fir_peak,
    fractional::fractional_window_gravity,
    gaussian_fit::{coarse_peak, gaussian_fit},
    gaussian_ml::gaussian_ml,
    gravity::{gray_gravity, rounded_window_gravity, width_samples, window_half_length_px},
    lanes::{Centres, LANES, Lane, Sections},
    log_gaussian::log_gaussian,
    section::{Levels, LineCandidate},
    shape::{SHARES, Shape},
    width::{Edges, brightest, brightest_raw, full_width_half_maximum, raw_at},
};
use crate::scanner::params::{GravityWindow, Method};

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
    pub(crate) first: [u32; LANES],
    pub(crate) centres: Centres,
    pub(crate) width_px: Lane,
    pub(crate) intensity: Lane,
    pub(crate) brightest_raw: Lane,
    /// Shapes of the cross-sections.
    pub(crate) shape: Shape,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::{
        params::ExtractionParams,
        stripe::{
            blur::{Kernel, UNITS},
            reference::Section,
            section::{Candidate, grey},
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
