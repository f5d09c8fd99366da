//! Cross-sections that no stripe produces. Whatever they hold, the estimated centre must lie within reach of the
//! candidate and its sigma must admit the uncertainty.

use super::{
    fir_peak::fir_peak,
    gaussian_ml::gaussian_ml,
    lanes::{Centres, Sections},
    log_gaussian::log_gaussian,
    noise::PixelNoise,
    reference::Section,
    section::Candidate,
};
use proptest::prelude::*;

type Estimator = fn(&Sections, PixelNoise, f32) -> Centres;

const ESTIMATORS: [(&str, Estimator); 3] =
    [("gaussian_ml", gaussian_ml), ("log_gaussian", log_gaussian), ("fir_peak", fir_peak)];
const NOISE: PixelNoise = PixelNoise { constant: 4.0, per_level: 0.01, blur_variance_px2: 0.0 };

/// Returns position from the candidate's first sample, and sigma, of a single section.
fn alone(estimator: Estimator, raw: &[u32], first: usize, last: usize) -> (f32, f32) {
    let samples: Vec<u32> = raw.iter().map(|&sample| sample * 256).collect();
    let peak = samples[first..=last].iter().copied().max().unwrap_or(0);
    let candidate = Candidate::alone(first as u32, last as u32, peak, 0);
    let mut sections = Sections::default();
    sections.load(std::iter::once(Section { samples, raw: raw.to_vec(), origin: 0, candidate }));
    let centres = estimator(&sections, NOISE, 255.0);
    (centres.position_px[0], centres.sigma_px[0])
}

fn assert_honest(name: &str, estimator: Estimator, raw: &[u32], first: usize, last: usize) {
    let length = (last - first + 1) as f32;
    let (position, sigma) = alone(estimator, raw, first, last);
    assert!((-1.0..=length).contains(&position), "{name}: {position} of {raw:?} {first} {last}");
    assert!(
        sigma > 0.0 && sigma <= 2.0 * length,
        "{name}: sigma {sigma} of {raw:?} {first} {last}"
    );
}

#[test]
fn sections_without_a_flank_are_uncertain() {
    for (name, estimator) in ESTIMATORS {
        for (raw, first, last) in [
            (&[0, 0, 0, 200, 0, 0, 0][..], 3, 3),
            (&[0, 0, 90, 200, 0, 0], 2, 3),
            (&[200], 0, 0),
            (&[255; 9], 0, 8),
            (&[77; 9], 2, 6),
            (&[255, 255, 255, 40, 0, 0, 0], 0, 3),
            (&[0, 0, 0, 60, 120, 190, 250], 3, 6),
        ] {
            assert_honest(name, estimator, raw, first, last);
        }
        // All saturated or all equal: the centre may be anywhere.
        for raw in [[255; 9], [77; 9]] {
            let (_, sigma) = alone(estimator, &raw, 0, 8);
            assert!(sigma > 1.0, "{name}: sigma {sigma} of {raw:?}");
        }
    }
}

proptest! {
    #[test]
    fn whatever_the_samples_are_the_answer_is_a_place(
        raw in prop::collection::vec(prop_oneof![0..=255_u32, Just(255), 0..3_u32], 1..60),
        ends in (0..1000_usize, 0..1000_usize),
    ) {
        let (a, b) = (ends.0 % raw.len(), ends.1 % raw.len());
        let (first, last) = (a.min(b), a.max(b));
        for (name, estimator) in ESTIMATORS {
            assert_honest(name, estimator, &raw, first, last);
        }
    }
}
