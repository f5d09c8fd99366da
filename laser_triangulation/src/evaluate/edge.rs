//! Lateral resolution: the effect of a step along the stripe on the columns beside it. This is the cost of averaging
//! columns.

use std::ops::Range;

use serde::Serialize;

use super::{
    scene::{Course, Scene},
    trial::{self, Plan},
};
use crate::simulate::stripe::StripeScene;

/// A stripe with a step.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Standard deviation of the stripe, pixels.
    pub sigma_px: f64,
    /// Height of the step, pixels.
    pub height_px: f64,
}

/// Test cases. Blurring across a high step mixes two
/// separate stripes, across a low one it makes a ramp.
pub const CASES: [Step; 3] = [
    Step { sigma_px: 0.95, height_px: 7.0 },
    Step { sigma_px: 2.3, height_px: 7.0 },
    Step { sigma_px: 2.3, height_px: 2.0 },
];
/// Error beyond which a column counts as spoilt, pixels.
pub const SPOILT_PX: f64 = 0.5;
/// Sub-pixel phases of the stripe to average over.
const NUM_PHASES: u32 = 16;
/// First column after the step.
const COLUMN: u32 = 128;
/// Columns around the step that are examined.
const SEEN: Range<u32> = COLUMN - 20..COLUMN + 20;

/// The effect of a step on all methods, for one stripe.
#[derive(Clone, Debug, Serialize)]
pub struct Edge {
    /// Standard deviation of the stripe, pixels.
    pub sigma_px: f64,
    /// Height of the step, pixels.
    pub step_px: f64,
    /// Distance of each column from the step: −½ is the last one before it, ½ the first one after it.
    pub columns_px: Vec<f64>,
    /// The methods, in the plan's order.
    pub methods: Vec<EdgeResponse>,
}

/// The effect of a step on one method.
#[derive(Clone, Debug, Serialize)]
pub struct EdgeResponse {
    /// Name of the method.
    pub method: &'static str,
    /// Number of columns with an error above [`SPOILT_PX`], averaged over the sub-pixel phases.
    pub spoilt_columns: f64,
    /// Number of columns without a point, averaged over the sub-pixel phases.
    pub missing_columns: f64,
    /// Mean position in each column as a share of the step; null where no point was found.
    pub response: Vec<f64>,
}

/// Sums over the phases.
#[derive(Clone)]
struct Sums {
    spoilt: u32,
    missing: u32,
    response: Vec<(f64, u32)>,
}

/// Measures one combination of step height and stripe width.
pub fn run(plan: &Plan, step: Step) -> Edge {
    let Step { sigma_px, height_px: step_px } = step;
    let nothing = Sums { spoilt: 0, missing: 0, response: vec![(0.0, 0); SEEN.len()] };
    let mut sums = vec![nothing; plan.methods.len()];
    for phase in 0..NUM_PHASES {
        let start_px = 28.0 + f64::from(phase) / f64::from(NUM_PHASES);
        let course = Course::Step { start_px, column: COLUMN, rise_px: step_px };
        let stripe = StripeScene {
            width: 2 * COLUMN,
            height: 64,
            sigma_px,
            read_noise: 2.0,
            seed: plan.seed.wrapping_add(u64::from(phase)),
            ..StripeScene::default()
        };
        let scene = Scene { stripe, course, speckle: None };
        trial::centerlines(plan, &scene, 1, |_, method, points| {
            let sums = &mut sums[method];
            for (column, place) in SEEN.zip(&mut sums.response) {
                let Some((position_px, _)) = points[column as usize] else {
                    sums.missing += 1;
                    continue;
                };
                let error_px = position_px - course.center_px(f64::from(column));
                sums.spoilt += u32::from(error_px.abs() > SPOILT_PX);
                *place = (place.0 + (position_px - start_px) / step_px, place.1 + 1);
            }
        });
    }
    let mean = |sum: u32| f64::from(sum) / f64::from(NUM_PHASES);
    let methods = plan.methods.iter().zip(sums).map(|(method, sums)| EdgeResponse {
        method: method.name(),
        spoilt_columns: mean(sums.spoilt),
        missing_columns: mean(sums.missing),
        response: sums.response.iter().map(|(sum, count)| sum / f64::from(*count)).collect(),
    });
    let columns_px = SEEN.map(|column| f64::from(column) - f64::from(COLUMN) + 0.5);
    Edge { sigma_px, step_px, columns_px: columns_px.collect(), methods: methods.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        evaluate::trial::tests::plan,
        scanner::params::{ExtractionParams, Method},
    };

    #[test]
    fn a_blur_spoils_only_the_columns_within_its_kernel() {
        let blurred = plan(&[Method::GrayGravity], 1);
        let alone = Plan {
            params: ExtractionParams { blur_radius: 0, ..blurred.params },
            ..blurred.clone()
        };
        let [blurred, alone] = [blurred, alone]
            .map(|plan| run(&plan, Step { sigma_px: 2.3, height_px: 7.0 }).methods.remove(0));
        assert!((alone.spoilt_columns, alone.missing_columns) == (0.0, 0.0), "{alone:?}");
        // The kernel reaches three columns to either side.
        assert!(blurred.spoilt_columns > 0.5 && blurred.spoilt_columns <= 6.0, "{blurred:?}");
        let response = &alone.response;
        assert!(response[..20].iter().all(|share| share.abs() < 0.02), "{response:?}");
        assert!(response[20..].iter().all(|share| (share - 1.0).abs() < 0.02), "{response:?}");
    }
}
