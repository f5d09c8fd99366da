//! All experiments on rendered scenes.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{
    plots::{Curve, Plot},
    progress_bar, settings,
};
use crate::evaluate::{
    edge::{self, Edge},
    experiment::{Experiment, MethodResult, Series},
    locking::{self, Locking},
    smoothing::{self, Smoothing},
    trial::Plan,
};

/// Results of the requested experiments.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Study {
    pub(super) source: &'static str,
    pub(super) seed: u64,
    pub(super) frames: u32,
    pub(super) methods: Vec<&'static str>,
    /// Parameters of the extraction; read noise and shot gain are those of each scene.
    pub(super) extraction: BTreeMap<String, String>,
    pub(super) series: Vec<Series>,
    pub(super) locking: Vec<Locking>,
    pub(super) edge: Vec<Edge>,
    pub(super) smoothing: Vec<Smoothing>,
}

/// Returns the experiments of a list of names, or all if the list is empty.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an unknown or repeated name.
pub(super) fn experiments(names: &[String]) -> anyhow::Result<Vec<Experiment>> {
    settings::choose(names, Experiment::NAMES, |name| {
        Experiment::from_name(name).ok_or_else(|| {
            let all = Experiment::NAMES.join(", ");
            settings::usage(format!("no experiment is called {name:?}; there are {all}"))
        })
    })
}

/// Runs the experiments.
pub(super) fn study(
    plan: &Plan,
    experiments: &[Experiment],
    extraction: BTreeMap<String, String>,
) -> Study {
    let num_steps = |experiment: &Experiment| match experiment {
        Experiment::Locking => locking::SIGMAS_PX.len(),
        Experiment::Edge => edge::CASES.len(),
        Experiment::Smoothing => smoothing::COLUMNS.len(),
        varied => varied.cases(plan.seed).len(),
    };
    let bar = progress_bar(Some(experiments.iter().map(num_steps).sum::<usize>() as u64), "scenes");
    let mut study = Study {
        source: "rendered",
        seed: plan.seed,
        frames: plan.frames,
        methods: plan.methods.iter().map(|method| method.name()).collect(),
        extraction,
        series: Vec::new(),
        locking: Vec::new(),
        edge: Vec::new(),
        smoothing: Vec::new(),
    };
    for experiment in experiments {
        match experiment {
            Experiment::Locking => {
                let all = locking::SIGMAS_PX.iter().map(|&s| locking::run(plan, s));
                study.locking = all.inspect(|_| bar.inc(1)).collect();
            }
            Experiment::Edge => {
                let all = edge::CASES.iter().map(|&case| edge::run(plan, case));
                study.edge = all.inspect(|_| bar.inc(1)).collect();
            }
            Experiment::Smoothing => {
                let all = smoothing::COLUMNS.iter().map(|&columns| smoothing::run(plan, columns));
                study.smoothing = all.inspect(|_| bar.inc(1)).collect();
            }
            varied => study.series.push(varied.run(plan, || bar.inc(1))),
        }
    }
    bar.finish_and_clear();
    study
}

/// A plot of each curve.
pub(super) fn plots(study: &Study) -> Vec<Plot> {
    let varied = study.series.iter().filter(|series| !series.axis.is_empty());
    let mut plots: Vec<_> = varied.map(series_plot).collect();
    plots.extend(study.locking.iter().map(locking_plot));
    plots.extend(study.edge.iter().map(edge_plot));
    plots
}

/// Returns the file name of the plot of a series.
pub(super) fn series_file(series: &Series) -> String {
    format!("accuracy_{}.svg", series.experiment)
}

/// Returns the file name of the plot of a locking curve.
pub(super) fn locking_file(locking: &Locking) -> String {
    format!("accuracy_locking_s{}.svg", locking.sigma_px)
}

/// Returns the file name of the plot of a response to a step.
pub(super) fn edge_file(edge: &Edge) -> String {
    format!("accuracy_edge_s{}_step{}.svg", edge.sigma_px, edge.step_px)
}

fn series_plot(series: &Series) -> Plot {
    let curve = |number: usize, value: &dyn Fn(&MethodResult) -> f64| {
        let point = |scene: &crate::evaluate::experiment::SceneResult| {
            (scene.value, value(&scene.methods[number]))
        };
        series.scenes.iter().map(point).collect::<Vec<_>>()
    };
    let methods = series.scenes.first().map_or(&[] as &[_], |scene| scene.methods.as_slice());
    let mut curves: Vec<_> = methods
        .iter()
        .enumerate()
        .map(|(number, method)| Curve::method(method.method, curve(number, &|m| m.accuracy.rms_px)))
        .collect();
    let bound = series.scenes.iter().map(|scene| (scene.value, scene.bound_px));
    curves.push(Curve::bound("bound of one column", bound.collect()));
    Plot {
        file: series_file(series),
        title: format!("RMS error over {}", series.axis),
        x_label: series.axis,
        y_label: "RMS error [px]",
        is_log: true,
        curves,
    }
}

fn locking_plot(locking: &Locking) -> Plot {
    let curve = |curve: &locking::LockingCurve| {
        let points = locking.phases_px.iter().copied().zip(curve.mean_error_px.iter().copied());
        Curve::method(curve.method, points.collect())
    };
    Plot {
        file: locking_file(locking),
        title: format!("Mean error over the sub-pixel phase, s = {} px", locking.sigma_px),
        x_label: "phase [px]",
        y_label: "mean error [px]",
        is_log: false,
        curves: locking.methods.iter().map(curve).collect(),
    }
}

fn edge_plot(edge: &Edge) -> Plot {
    let curve = |response: &edge::EdgeResponse| {
        let points = edge.columns_px.iter().copied().zip(response.response.iter().copied());
        Curve::method(response.method, points.collect())
    };
    Plot {
        file: edge_file(edge),
        title: format!("Response to a step of {} px, s = {} px", edge.step_px, edge.sigma_px),
        x_label: "columns from the step",
        y_label: "share of the step",
        is_log: false,
        curves: edge.methods.iter().map(curve).collect(),
    }
}
