//! The experiments: noise, width, saturation, slope and speckle are varied one at a time; six reference scenes compare
//! the methods.

use serde::Serialize;

use super::{
    bound::{self, Samples},
    scene::{Course, Scene},
    statistics::Accuracy,
    trial::{self, Plan},
};
use crate::{
    named_enum,
    simulate::{speckle::Speckle, stripe::StripeScene},
};

named_enum! {
    /// An experiment on rendered scenes.
    Experiment {
        /// Six scenes from quiet to saturated.
        Reference = "reference",
        /// Read noise.
        Noise = "noise",
        /// Width of the stripe.
        Width = "width",
        /// Light above full scale.
        Saturation = "saturation",
        /// Slope of the stripe.
        Slope = "slope",
        /// Contrast of the speckle.
        Speckle = "speckle",
        /// Error as a function of the sub-pixel phase: [`super::locking`].
        Locking = "locking",
        /// Columns that a step spoils: [`super::edge`].
        Edge = "edge",
        /// Noise and resolution as functions of the number of smoothed points: [`super::smoothing`].
        Smoothing = "smoothing",
    }
}

/// Amplitude that stays just below full scale with noise, grey levels.
const UNSATURATED: f64 = 230.0;
/// Correlation length of the speckle's brightness, pixels.
const GRAIN_PX: f64 = 1.0;

/// One scene of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the scene.
    pub(crate) name: String,
    /// Value of the varied quantity; NaN if none is varied.
    pub(crate) value: f64,
    /// The scene.
    pub(crate) scene: Scene,
}

/// Results of an experiment, scene by scene.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// Name of the experiment.
    pub experiment: &'static str,
    /// Varied quantity and its unit; empty if none is varied.
    pub axis: &'static str,
    /// The scenes.
    pub scenes: Vec<SceneResult>,
}

/// Results of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneResult {
    /// Name of the scene.
    pub scene: String,
    /// Value of the varied quantity, in the unit of the series; null if none is varied.
    pub value: f64,
    /// Amplitude of the stripe, grey levels.
    pub amplitude: f64,
    /// Standard deviation of the stripe, pixels.
    pub sigma_px: f64,
    /// Read noise, grey levels.
    pub read_noise: f64,
    /// Cramér–Rao bound of one column for the real samples, clipped ones censored, pixels.
    pub bound_px: f64,
    /// The same bound with rounding as noise, no clipping at 0 and saturated samples left out, pixels.
    pub simple_bound_px: f64,
    /// Error that speckle alone causes in a centroid over the whole column, pixels; null without speckle.
    pub speckle_centroid_px: f64,
    /// The methods, in the plan's order.
    pub methods: Vec<MethodResult>,
}

/// Results of a method on a scene.
#[derive(Clone, Debug, Serialize)]
pub struct MethodResult {
    /// Name of the method.
    pub method: &'static str,
    /// Accuracy of the method.
    #[serde(flatten)]
    pub accuracy: Accuracy,
    /// Number of columns that it averages, estimated from the correlation of its noise; null without noise.
    pub columns_averaged: f64,
    /// RMS error divided by the bound of one column. A method that averages columns may reach less than 1.
    pub over_bound: f64,
    /// RMS error divided by the simple bound of one column.
    pub over_simple_bound: f64,
}

/// Light and noise levels of a scene; everything else is the same in all scenes.
const fn light(amplitude: f64, sigma_px: f64, read_noise: f64) -> StripeScene {
    StripeScene {
        width: 2592,
        height: 256,
        direction: crate::scanner::params::StripeDirection::Horizontal,
        bit_depth: crate::simulate::sensor::BitDepth::Eight,
        amplitude,
        sigma_px,
        background: 0.0,
        read_noise,
        shot_gain: 0.0,
        seed: 0,
    }
}

impl Experiment {
    /// Returns the varied quantity and its unit.
    pub const fn axis(self) -> &'static str {
        match self {
            Self::Reference | Self::Locking | Self::Edge | Self::Smoothing => "",
            Self::Noise => "read noise [grey levels]",
            Self::Width => "standard deviation of the stripe [px]",
            Self::Saturation => "light [times full scale]",
            Self::Slope => "slope [degrees]",
            Self::Speckle => "speckle contrast",
        }
    }

    /// Returns the scenes; empty for locking, edge and smoothing, which have scenes of their own.
    pub fn cases(self, seed: u64) -> Vec<Case> {
        let mut cases = match self {
            Self::Reference => reference(),
            Self::Noise => vary(&[1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0], |noise| {
                on_wave(light(199.0, 2.3, noise))
            }),
            Self::Width => vary(&[0.7, 0.95, 1.3, 1.8, 2.3, 3.2, 4.2, 5.0, 6.0], |sigma_px| {
                on_wave(light(183.0, sigma_px, 2.0))
            }),
            Self::Saturation => vary(&[1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0], |times| {
                on_wave(light(times * UNSATURATED, 2.3, 2.0))
            }),
            Self::Slope => vary(&[0.0, 15.0, 30.0, 45.0, 55.0, 60.0], sloping),
            Self::Speckle => vary(&[0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0], |contrast| Scene {
                speckle: Some(Speckle { contrast, grain_px: GRAIN_PX }),
                ..on_wave(light(120.0, 2.3, 2.0))
            }),
            Self::Locking | Self::Edge | Self::Smoothing => Vec::new(),
        };
        for case in &mut cases {
            case.scene.stripe.seed = seed;
        }
        cases
    }

    /// Measures all scenes. Calls `on_scene` after each one.
    pub fn run(self, plan: &Plan, mut on_scene: impl FnMut()) -> Series {
        let scenes = self.cases(plan.seed).into_iter().map(|case| {
            let result = measure(plan, case);
            on_scene();
            result
        });
        Series { experiment: self.name(), axis: self.axis(), scenes: scenes.collect() }
    }
}

const fn on_wave(stripe: StripeScene) -> Scene {
    Scene { stripe, course: Course::Wave, speckle: None }
}

fn vary(values: &[f64], scene: impl Fn(f64) -> Scene) -> Vec<Case> {
    let case = |&value| Case { name: format!("{value}"), value, scene: scene(value) };
    values.iter().map(case).collect()
}

fn reference() -> Vec<Case> {
    let scenes = [
        ("clean", 183.0, 2.3, 2.0),
        ("thin", 183.0, 0.95, 2.0),
        ("wide", 183.0, 4.2, 2.0),
        ("noisy", 123.0, 2.2, 9.0),
        ("very noisy", 199.0, 2.2, 30.0),
        ("saturated", 690.0, 2.9, 2.0),
    ];
    let case = |(name, amplitude, sigma_px, noise): (&str, f64, f64, f64)| Case {
        name: name.to_owned(),
        value: f64::NAN,
        scene: on_wave(light(amplitude, sigma_px, noise)),
    };
    scenes.map(case).into()
}

fn sloping(degrees: f64) -> Scene {
    let rise_px = libm::tan(degrees.to_radians());
    let (width, margin_px) = (400, 50.0);
    let height = (f64::from(width) * rise_px + 2.0 * margin_px) as u32;
    let course = Course::Slope { start_px: margin_px + 0.3, rise_px };
    Scene { stripe: StripeScene { width, height, ..light(183.0, 2.3, 2.0) }, course, speckle: None }
}

fn measure(plan: &Plan, case: Case) -> SceneResult {
    let Case { name, value, scene } = case;
    let bound_of = |samples| bound::of_scene(&scene.stripe, scene.course.slope_px(), samples);
    let (bound_px, simple_bound_px) =
        (bound_of(Samples::Exact), bound_of(Samples::SaturatedLeftOut));
    let results = trial::run(plan, &scene);
    let method = |(method, (accuracy, columns_averaged)): (_, (Accuracy, f64))| MethodResult {
        method,
        accuracy,
        columns_averaged,
        over_bound: accuracy.rms_px / bound_px,
        over_simple_bound: accuracy.rms_px / simple_bound_px,
    };
    let StripeScene { amplitude, sigma_px, read_noise, .. } = scene.stripe;
    let of_speckle = |speckle: Speckle| speckle.centroid_sigma_px(sigma_px);
    SceneResult {
        scene: name,
        value,
        amplitude,
        sigma_px,
        read_noise,
        bound_px,
        simple_bound_px,
        speckle_centroid_px: scene.speckle.map_or(f64::NAN, of_speckle),
        methods: plan.methods.iter().map(|m| m.name()).zip(results).map(method).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_keeps_its_stripe_inside() {
        for experiment in Experiment::NAMES.iter().filter_map(|name| Experiment::from_name(name)) {
            let cases = experiment.cases(7);
            for Case { name, scene, .. } in &cases {
                let StripeScene { width, height, seed, .. } = scene.stripe;
                assert_eq!(seed, 7);
                for column in 0..width {
                    let center = scene.course.center_px(f64::from(column));
                    let inside = 40.0..f64::from(height) - 40.0;
                    assert!(inside.contains(&center), "{name}: {center} in column {column}");
                }
            }
            assert_eq!(
                cases.is_empty(),
                experiment.axis().is_empty() && experiment != Experiment::Reference
            );
        }
    }

    #[test]
    fn bounds_follow_the_varied_quantity() {
        let of = |experiment: Experiment, samples| -> Vec<f64> {
            let bound = |case: &Case| {
                bound::of_scene(&case.scene.stripe, case.scene.course.slope_px(), samples)
            };
            experiment.cases(1).iter().map(bound).collect()
        };
        assert!(of(Experiment::Noise, Samples::Exact).is_sorted());
        assert!(of(Experiment::Slope, Samples::Exact).is_sorted());
        // A stripe thinner than a fifth of a pixel is blurred by the pixel itself.
        assert!(of(Experiment::Width, Samples::Exact)[1..].is_sorted());
        let simple = of(Experiment::Reference, Samples::SaturatedLeftOut);
        // 1.062 (2 / 183) √2.3, plus a few percent for pixels of that size and the rounding.
        assert!((simple[0] / 0.0176 - 1.0).abs() < 0.05, "{simple:?}");
    }
}
