//! Smoothing along the stripe: it trades noise for lateral resolution, and both are measured.

use serde::Serialize;

use super::{
    edge,
    experiment::Experiment,
    trial::{self, Plan},
};
use crate::scanner::params::ExtractionParams;

/// Tested values of `extraction.smoothing_columns`.
pub const COLUMNS: [u32; 5] = [1, 3, 5, 9, 17];
/// The reference scene on which noise is measured.
pub const SCENE: &str = "noisy";
/// The stripe and the step on which the response is measured.
pub const EDGE: edge::Step = edge::Step { sigma_px: 2.3, height_px: 2.0 };

/// All methods with one smoothing.
#[derive(Clone, Debug, Serialize)]
pub struct Smoothing {
    /// `extraction.smoothing_columns`.
    pub smoothing_columns: u32,
    /// The methods, in the plan's order.
    pub methods: Vec<SmoothedMethod>,
}

/// One method with that smoothing.
#[derive(Clone, Debug, Serialize)]
pub struct SmoothedMethod {
    /// Name of the method.
    pub method: &'static str,
    /// Root mean square error on the scene [`SCENE`], pixels.
    pub rms_px: f64,
    /// Number of columns that it averages, estimated from the correlation of its noise.
    pub columns_averaged: f64,
    /// Number of spoilt columns beside a step: [`edge`].
    pub spoilt_columns: f64,
}

/// Measures one smoothing.
pub fn run(plan: &Plan, smoothing_columns: u32) -> Smoothing {
    let params = ExtractionParams { smoothing_columns, ..plan.params };
    let plan = Plan { params, ..plan.clone() };
    let cases = Experiment::Reference.cases(plan.seed);
    let noisy = cases.iter().find(|case| case.name == SCENE);
    let noise = noisy.map(|case| trial::run(&plan, &case.scene)).unwrap_or_default();
    let edges = edge::run(&plan, EDGE).methods;
    let methods =
        noise.iter().zip(edges).map(|((accuracy, columns_averaged), edge)| SmoothedMethod {
            method: edge.method,
            rms_px: accuracy.rms_px,
            columns_averaged: *columns_averaged,
            spoilt_columns: edge.spoilt_columns,
        });
    Smoothing { smoothing_columns, methods: methods.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{evaluate::trial::tests::plan, scanner::params::Method};

    #[test]
    fn the_scene_exists_and_every_method_is_measured() {
        let plan = plan(&[Method::GrayGravity, Method::ImprovedGravity], 2);
        let smoothed = run(&plan, COLUMNS[0]);
        let names: Vec<_> = smoothed.methods.iter().map(|method| method.method).collect();
        assert_eq!(names, ["gray_gravity", "improved_gravity"]);
        assert!(smoothed.methods.iter().all(|m| m.rms_px > 0.0 && m.columns_averaged > 1.0));
    }
}
