//! Steps 5 to 8 on one cross-section, and the points put together to a centreline.

use super::{
    Centerline,
    fir_peak::fir_peak,
    flag,
    fractional::fractional_window_gravity,
    gaussian_fit::{coarse_peak, gaussian_fit},
    gaussian_ml::gaussian_ml,
    gravity::{gray_gravity, rounded_window_gravity, width_samples, window_half_length_px},
    lanes::{Centres, Sections},
    log_gaussian::log_gaussian,
    noise::PixelNoise,
    section::{Candidate, Centre, Levels, Section, full_width_half_maximum},
};
use crate::scanner::params::{Method, StripeDirection, Window};

/// Steps 5 to 8: the centre of a cross-section by the chosen method.
///
/// **A new estimator is one more arm here**: a function from a [`Section`] to a [`Centre`] in a file of its own, and its
/// name in [`Method`]. The parameter's choices and the property that fast equals reference follow from the name.
pub fn centre(section: &Section<'_>, levels: &Levels<'_>) -> Centre {
    match levels.method {
        Method::GrayGravity => gray_gravity(section, &levels.noise),
        // The ridge needs the picture, not a section.
        Method::GaussianFit | Method::Steger => gaussian_fit(section, &levels.noise),
        Method::GaussianMl => alone(gaussian_ml, section, levels),
        Method::LogGaussian => alone(log_gaussian, section, levels),
        Method::FirPeak => alone(fir_peak, section, levels),
        Method::ImprovedGravity => {
            let coarse_px = coarse_peak(section);
            let half_length_px =
                window_half_length_px(width_samples(section, levels.width_threshold));
            match levels.window {
                Window::Rounded => {
                    rounded_window_gravity(section, coarse_px, half_length_px, &levels.noise)
                }
                Window::Fractional => {
                    fractional_window_gravity(section, coarse_px, half_length_px, &levels.noise)
                }
            }
        }
    }
}

/// An estimator of lanes on one cross-section.
fn alone(
    estimator: impl Fn(&Sections, PixelNoise, f32) -> Centres,
    section: &Section<'_>,
    levels: &Levels<'_>,
) -> Centre {
    let mut sections = Sections::default();
    sections.load(std::iter::once(*section));
    let centres = estimator(&sections, (&levels.noise).into(), levels.full_scale as f32);
    Centre {
        position_px: f64::from(section.candidate.first) + f64::from(centres.position_px[0]),
        sigma_px: f64::from(centres.sigma_px[0]),
    }
}

/// Builds a centreline from cross-sections in order along the stripe.
#[derive(Debug)]
pub struct Assembler<'a> {
    centerline: &'a mut Centerline,
    direction: StripeDirection,
    /// Column and row of the searched region in the image.
    offset: (usize, usize),
    /// Positions across the stripe: rows of the region for a horizontal stripe.
    length_across: u32,
    /// The cross-section pushed last: its line and its candidate.
    previous: Option<(usize, Candidate)>,
}

impl<'a> Assembler<'a> {
    /// Starts an empty centreline.
    pub fn new(
        centerline: &'a mut Centerline,
        direction: StripeDirection,
        offset: (usize, usize),
        length_across: usize,
    ) -> Self {
        centerline.clear();
        Self { centerline, direction, offset, length_across: length_across as u32, previous: None }
    }

    /// Measures the cross-section of line `line` (a column of the region for a horizontal stripe) and adds its point.
    pub fn push(&mut self, line: usize, section: &Section<'_>, levels: &Levels<'_>) {
        let candidate = section.candidate;
        let centre = centre(section, levels);
        if !self.continues(line, candidate) {
            self.centerline.stripe_start.push(self.centerline.len() as u32);
        }
        self.previous = Some((line, candidate));
        let mut flags = 0;
        if near(section).iter().any(|&sample| sample >= levels.full_scale) {
            flags |= flag::SATURATED;
        }
        if candidate.count > 1 {
            flags |= flag::MULTIPLE_PEAKS;
        }
        if candidate.first == 0 || candidate.last + 1 == self.length_across {
            flags |= flag::CLIPPED;
        }
        let (x, y) = (self.offset.0 as f64, self.offset.1 as f64);
        let (u_px, v_px) = match self.direction {
            StripeDirection::Horizontal => (x + line as f64, y + centre.position_px),
            StripeDirection::Vertical => (x + centre.position_px, y + line as f64),
        };
        self.centerline.u_px.push(u_px as f32);
        self.centerline.v_px.push(v_px as f32);
        self.centerline
            .width_px
            .push(full_width_half_maximum(section, levels.noise.kernel.variance_px2()) as f32);
        self.centerline.intensity.push(raw_at(section, centre.position_px));
        self.centerline.sigma_px.push(centre.sigma_px as f32);
        self.centerline.flags.push(flags);
    }

    /// Whether the candidate touches the one of the line before, corners included.
    fn continues(&self, line: usize, candidate: Candidate) -> bool {
        self.previous.is_some_and(|(previous_line, previous)| {
            previous_line + 1 == line
                && candidate.first <= previous.last + 1
                && previous.first <= candidate.last + 1
        })
    }
}

/// Unblurred samples of the candidate and of one neighbour to either side.
fn near<'a>(section: &Section<'a>) -> &'a [u32] {
    let first = (section.candidate.first - section.origin) as usize;
    let end = first + section.candidate.length() as usize + 1;
    &section.raw[first.saturating_sub(1)..end.min(section.raw.len())]
}

/// Unblurred level at a place between samples, linear.
fn raw_at(section: &Section<'_>, position_px: f64) -> f32 {
    let raw = section.raw;
    let at = (position_px - f64::from(section.origin)).clamp(0.0, (raw.len() - 1) as f64);
    let left = at.floor() as usize;
    let right = (left + 1).min(raw.len() - 1);
    let share = at - left as f64;
    (f64::from(raw[left]) * (1.0 - share) + f64::from(raw[right]) * share) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::{
        params::ExtractionParams,
        stripe::blur::{Kernel, UNITS},
    };
    use proptest::prelude::*;

    /// The longest run of samples above the threshold.
    fn longest_run(samples: &[u32], threshold: u32) -> Option<Candidate> {
        let mut longest: Option<Candidate> = None;
        let mut first = 0;
        for run in samples.split_inclusive(|&sample| sample <= threshold) {
            let length = run.iter().filter(|&&sample| sample > threshold).count() as u32;
            if length > longest.map_or(0, |longest| longest.length()) {
                let peak = run.iter().copied().max().unwrap_or(0);
                longest = Some(Candidate { first, last: first + length - 1, peak, count: 1 });
            }
            first += run.len() as u32;
        }
        longest
    }

    proptest! {
        /// Nothing that any estimator looks at lies beyond the margin of its section.
        #[test]
        fn the_margin_is_wide_enough(
            samples in prop::collection::vec(0..255 * UNITS, 1..80),
            threshold in 0..255_u32,
            width_threshold in 0..255_u32,
            blur_radius in 0..4_u32,
        ) {
            let kernel = Kernel::gaussian(blur_radius);
            for method in Method::NAMES.iter().filter_map(|name| Method::from_name(name)) {
                for window in [Window::Fractional, Window::Rounded] {
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
                    let [expected, actual] = [&samples, &others]
                        .map(|samples| centre(&Section { samples, raw: samples, origin: 0, candidate }, &levels));
                    prop_assert_eq!(expected, actual);
                    prop_assert!(actual.position_px.is_finite() && actual.sigma_px.is_finite());
                }
            }
        }
    }
}
