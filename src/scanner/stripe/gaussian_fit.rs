//! Step 5: the coarse peak, the maximum of a Gaussian through the blurred cross-section.

use super::{
    blur::UNITS,
    section::{Centre, Noise, Section},
};
use nalgebra::{Matrix3, Vector3};

/// Maximum of the Gaussian fitted to the candidate's samples.
///
/// The logarithm of a Gaussian is a parabola: ln G(t) = p₀ + p₁t + p₂t². Least squares in the logarithm, each sample
/// weighted by G² because noise of ln G is that of G divided by G (Guo 2011, doi 10.1109/MSP.2011.941846, eq. 8). Its
/// maximum lies at -p₁ / 2p₂; a parabola that opens upwards, or a maximum outside the candidate, gives the brightest
/// sample's position instead. Its uncertainty follows from the derivative of that position by each sample.
pub fn coarse_peak(section: &Section<'_>, noise: &Noise) -> Centre {
    let run = section.run();
    let peak = run.iter().position(|&s| s == section.candidate.peak).unwrap_or(0);
    let brightest = f64::from(section.candidate.first) + peak as f64;
    let half_length = f64::from(section.candidate.length()) / 2.0;
    let fallback = Centre { position_px: brightest, sigma_px: half_length };
    if run.len() < 3 {
        return fallback;
    }
    let level = |sample: u32| f64::from(sample) / f64::from(UNITS);
    let scale = 1.0 / level(section.candidate.peak);
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    let terms = || {
        run.iter().enumerate().map(move |(i, &sample)| {
            let t = i as f64 - peak as f64;
            (level(sample), Vector3::new(1.0, t, t * t))
        })
    };
    for (grey, powers) in terms() {
        let weight = (grey * scale).powi(2);
        normal += powers * powers.transpose() * weight;
        right += powers * (weight * (grey * scale).ln());
    }
    let Some(inverse) = normal.try_inverse() else { return fallback };
    let parabola = inverse * right;
    let offset = -parabola[1] / (2.0 * parabola[2]);
    let position_px = brightest + offset;
    let (first, last) = (f64::from(section.candidate.first), f64::from(section.candidate.last));
    // Also false for NaN.
    if !(parabola[2] < 0.0 && position_px >= first && position_px <= last) {
        return fallback;
    }
    // d(-p₁/2p₂) = -dp₁/2p₂ + p₁dp₂/2p₂²
    let gradient = Vector3::new(0.0, -0.5 / parabola[2], 0.5 * parabola[1] / parabola[2].powi(2))
        .transpose()
        * inverse;
    let variance: f64 = terms()
        .map(|(grey, powers)| {
            let by_sample = (gradient * powers)[0] * grey * scale * scale;
            by_sample * by_sample * noise.variance(grey)
        })
        .sum();
    Centre { position_px, sigma_px: variance.sqrt() }
}
