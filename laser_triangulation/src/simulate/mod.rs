//! Rendering of scenes with a known answer. Pure: a frame is a function of the scene, the seed and its number.
//!
//! A [`scenario`] describes everything in one file; [`world`] renders any of its frames and states the exact centre of
//! the stripe. [`stripe::render_stripe`] draws one stripe around a centre that the caller chooses, which is enough for
//! tests and benchmarks.

pub mod scenario;
pub(crate) mod scenario_error;
pub mod scene;
pub mod rig;
pub(crate) mod part;
pub(crate) mod camera;
pub(crate) mod clutter;
pub mod exposure;
pub mod noise;
pub(crate) mod speckle;
pub mod sensor;
pub mod stripe;
pub mod texture;
pub mod world;

use serde::{Deserialize, de::IgnoredAny};

use rig::RigScenario;
use scenario::Scenario;
use scenario_error::{ScenarioError, parsed};
use scene::Scene;

/// Reads a scenario of either kind: with a `rig`, gauges or boards in front of any camera; without, a part under the
/// camera of formula 6.
///
/// # Errors
/// The text is not a scenario, or a value is out of range; both errors name the key.
pub fn scene_from_yaml(text: &str) -> Result<Box<dyn Scene>, ScenarioError> {
    #[derive(Deserialize)]
    struct Head {
        rig: Option<IgnoredAny>,
    }
    Ok(match parsed::<Head>(text)?.rig {
        Some(_) => Box::new(RigScenario::from_yaml(text)?),
        None => Box::new(Scenario::from_yaml(text)?),
    })
}
