//! Results on rendered scenes as text and tables.

use super::{
    document::{Section, Table, number, percent, px},
    rendered::{Study, edge_file, locking_file, series_file},
};
use crate::evaluate::{
    edge::{Edge, SPOILT_PX},
    experiment::{Experiment, MethodResult, SceneResult, Series},
    locking::Locking,
    smoothing,
    statistics::WRONG_PX,
    trial::BORDER_COLUMNS,
};

/// Number of averaged columns below which a method counts as using one column.
const ONE_COLUMN: f64 = 1.5;
/// Share of missing and wrong points above which a figure is marked.
const MARKED_SHARE: f64 = 0.01;

/// Returns all sections of a study.
pub(super) fn sections(study: &Study) -> Vec<Section> {
    let mut sections = vec![preface(study)];
    for series in &study.series {
        sections.push(if series.axis.is_empty() { reference(series) } else { varied(series) });
    }
    if !study.locking.is_empty() {
        sections.push(locking_section(&study.locking));
    }
    if !study.edge.is_empty() {
        sections.push(edge_section(&study.edge));
    }
    if !study.smoothing.is_empty() {
        sections.push(smoothing_section(study));
    }
    sections
}

fn preface(study: &Study) -> Section {
    let set = study
        .extraction
        .iter()
        .filter(|(name, _)| !["read_noise", "shot_gain"].contains(&name.as_str()));
    let set: Vec<_> = set.map(|(name, value)| format!("{name} {value}")).collect();
    Section {
        title: "Against truth: rendered stripes".to_owned(),
        paragraphs: vec![
            format!(
                "Stripes are rendered about centres that are known exactly: a Gaussian of amplitude A (grey levels) and standard \
                 deviation s (pixels), integrated over each pixel, with Gaussian noise, rounded to 8 bits and clipped to 0 … 255, \
                 over a black background. {} frames of each scene, seed {}; {BORDER_COLUMNS} columns at either border do not count. The \
                 methods know the camera's noise.",
                study.frames, study.seed
            ),
            "RMS counts every point found, wrong ones too. The bound is the Cramér-Rao bound of one column for the samples as \
             they are: A, centre, s and background unknown, clipped samples censored. The simple bound takes rounding as \
             noise of variance 1/12, leaves saturated samples out and ignores clipping at 0."
                .to_owned(),
            "\"Averages\" is the number of columns whose uniform mean would have the same noise, measured from the correlation of the \
             noise along the stripe. A method that averages columns may lie below the bound of one column, at the cost of lateral \
             resolution: see the step below."
                .to_owned(),
            format!("Parameters of the extraction: {}.", set.join(", ")),
        ],
        ..Section::default()
    }
}

fn texts<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).into()
}

fn reference(series: &Series) -> Section {
    let table = |scene: &SceneResult| Table {
        caption: format!(
            "{}: A {}, s {} px, noise {}; bound {} px, simple bound {} px",
            scene.scene,
            scene.amplitude,
            scene.sigma_px,
            scene.read_noise,
            px(scene.bound_px),
            px(scene.simple_bound_px)
        ),
        header: texts([
            "method",
            "averages",
            "bias px",
            "RMS px",
            "÷ bound",
            "÷ simple",
            "missing %",
            "wrong %",
            "±1σ %",
            "±2σ %",
        ]),
        rows: scene.methods.iter().map(reference_row).collect(),
    };
    Section {
        title: "Six scenes".to_owned(),
        paragraphs: vec![
            format!(
                "Wrong: more than {WRONG_PX} px off. ±1σ and ±2σ: share of the points whose error, bias included, is within one and \
                 two of the standard deviations that the method states; 68.3 and 95.4 if those are right."
            ),
            series.scenes.iter().map(best).collect::<Vec<_>>().join(" "),
        ],
        tables: series.scenes.iter().map(table).collect(),
        plots: Vec::new(),
    }
}

fn reference_row(result: &MethodResult) -> Vec<String> {
    let accuracy = &result.accuracy;
    vec![
        result.method.to_owned(),
        number(result.columns_averaged, 1),
        px(accuracy.bias_px),
        px(accuracy.rms_px),
        number(result.over_bound, 2),
        number(result.over_simple_bound, 2),
        percent(accuracy.missing),
        percent(accuracy.wrong),
        percent(accuracy.within_1_sigma),
        percent(accuracy.within_2_sigma),
    ]
}

/// Names the method with the smallest RMS, over all methods and among those that use one column. Methods that miss
/// columns do not count.
fn best(scene: &SceneResult) -> String {
    let smallest = |is_candidate: &dyn Fn(&MethodResult) -> bool| {
        let complete =
            scene.methods.iter().filter(|m| !is_marked(m) && m.accuracy.rms_px.is_finite());
        complete
            .filter(|method| is_candidate(method))
            .min_by(|a, b| a.accuracy.rms_px.total_cmp(&b.accuracy.rms_px))
    };
    let named = |m: &MethodResult| format!("{} {}", m.method, px(m.accuracy.rms_px));
    let Some(first) = smallest(&|_| true) else {
        return format!("{}: no method finds all columns.", scene.scene);
    };
    match smallest(&|method| method.columns_averaged < ONE_COLUMN) {
        Some(alone) if alone.method != first.method => format!(
            "{}: {} px leads by averaging {} columns; {} px leads among those that use one column.",
            scene.scene,
            named(first),
            number(first.columns_averaged, 1),
            named(alone)
        ),
        _ => format!("{}: {} px leads.", scene.scene, named(first)),
    }
}

fn is_marked(result: &MethodResult) -> bool {
    result.accuracy.missing + result.accuracy.wrong > MARKED_SHARE || result.accuracy.points == 0
}

fn varied(series: &Series) -> Section {
    let values: Vec<_> = series.scenes.iter().map(|scene| scene.scene.clone()).collect();
    let header = |first: &str, second: &str| {
        [first, second]
            .into_iter()
            .map(str::to_owned)
            .chain(values.iter().cloned())
            .collect::<Vec<_>>()
    };
    let line = |name: &str, value: &dyn Fn(&SceneResult) -> f64| {
        let cells = series.scenes.iter().map(|scene| px(value(scene)));
        [name.to_owned(), "1".to_owned()].into_iter().chain(cells).collect::<Vec<_>>()
    };
    let mut rms_rows = vec![line("bound", &|scene| scene.bound_px)];
    let is_speckle = series.scenes.iter().any(|scene| scene.speckle_centroid_px.is_finite());
    if is_speckle {
        rms_rows.push(line("centroid, by speckle alone", &|scene| scene.speckle_centroid_px));
    }
    let rows = |cell: &dyn Fn(&MethodResult) -> String| -> Vec<Vec<String>> {
        let num_methods = series.scenes.first().map_or(0, |scene| scene.methods.len());
        let row = |place: usize| {
            let results = || series.scenes.iter().map(|scene| &scene.methods[place]);
            let name = series.scenes[0].methods[place].method.to_owned();
            let averages = range_text(results().map(|result| result.columns_averaged));
            let cells =
                results().map(|r| format!("{}{}", cell(r), if is_marked(r) { "*" } else { "" }));
            [name, averages].into_iter().chain(cells).collect()
        };
        (0..num_methods).map(row).collect()
    };
    rms_rows.extend(rows(&|result| px(result.accuracy.rms_px)));
    let table = |caption: &str, rows| Table {
        caption: caption.to_owned(),
        header: header("method", "averages"),
        rows,
    };
    let mut tables = vec![table("RMS px", rms_rows)];
    // Speckle is not camera noise: the bound does not apply to it.
    if !is_speckle {
        let ratios = rows(&|result| number(result.over_bound, 2));
        tables.push(table("RMS ÷ bound of one column", ratios));
    }
    Section {
        title: format!("Over {}", series.axis),
        paragraphs: vec![about(series.experiment).to_owned()],
        tables,
        plots: vec![(series_file(series), format!("RMS error over {}", series.axis))],
    }
}

/// Returns the fixed quantities of an experiment.
fn about(experiment: &str) -> &'static str {
    match Experiment::from_name(experiment) {
        Some(Experiment::Noise) => {
            "A 199, s 2.3 px. *: more than 1 % of the columns missing or wrong."
        }
        Some(Experiment::Width) => {
            "A 183, noise 2. *: more than 1 % of the columns missing or wrong."
        }
        Some(Experiment::Saturation) => {
            "A is the given multiple of 230, s 2.3 px, noise 2: at 1 nothing is clipped. *: more than 1 % of the columns missing or wrong."
        }
        Some(Experiment::Slope) => {
            "A 183, s 2.3 px at right angles to the stripe, noise 2; light is integrated over the pixels in both directions. Errors are \
             along the column, as published; across the stripe they are smaller by the cosine. *: more than 1 % of the columns \
             missing or wrong."
        }
        Some(Experiment::Speckle) => {
            "A 120, s 2.3 px, noise 2, and fully developed speckle with grains of 1 px, at the given contrast. The bound \
             ignores speckle; \"by speckle alone\" is the error that it causes in a centroid over the whole column, to first \
             order. Speckle, not noise, limits every method on a rough surface. *: more than 1 % of the columns missing or wrong."
        }
        _ => "",
    }
}

/// Formats the range of some numbers.
fn range_text(values: impl Iterator<Item = f64>) -> String {
    let ends = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let (low, high) =
        values.filter(|value| value.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    let (low, high) = (number(low, 1), number(high, 1));
    if low == high { low } else { format!("{low}…{high}") }
}

fn locking_section(all: &[Locking]) -> Section {
    let mut header = texts(["method"]);
    header.extend(all.iter().map(|locking| format!("s {} px", locking.sigma_px)));
    let rows = all.first().map_or(&[] as &[_], |first| first.methods.as_slice());
    let row = |(place, curve): (usize, &crate::evaluate::locking::LockingCurve)| {
        let cells = all.iter().map(|locking| px(locking.methods[place].half_amplitude_px));
        std::iter::once(curve.method.to_owned()).chain(cells).collect()
    };
    let plot = |locking: &Locking| {
        let text = format!("Mean error over the sub-pixel phase, s = {} px", locking.sigma_px);
        (locking_file(locking), text)
    };
    Section {
        title: "Pixel locking".to_owned(),
        paragraphs: vec![
            "Mean error of a level stripe as a function of its position between two pixels (A 183, noise 2, 1024 columns for each of 40 \
             phases): half the range, in pixels. An estimator without locking shows only the remaining noise."
                .to_owned(),
        ],
        tables: vec![Table { caption: String::new(), header, rows: rows.iter().enumerate().map(row).collect() }],
        plots: all.iter().map(plot).collect(),
    }
}

fn edge_section(all: &[Edge]) -> Section {
    let mut header = texts(["method"]);
    for edge in all {
        header.push(format!("s {}, step {}: off", edge.sigma_px, edge.step_px));
        header.push("missing".to_owned());
    }
    let rows = all.first().map_or(&[] as &[_], |first| first.methods.as_slice());
    let row = |(place, response): (usize, &crate::evaluate::edge::EdgeResponse)| {
        let cells = all.iter().flat_map(|edge| {
            let response = &edge.methods[place];
            [response.spoilt_columns, response.missing_columns].map(|columns| number(columns, 1))
        });
        std::iter::once(response.method.to_owned()).chain(cells).collect()
    };
    let plot = |edge: &Edge| {
        let text = format!("Response to a step of {} px, s = {} px", edge.step_px, edge.sigma_px);
        (edge_file(edge), text)
    };
    Section {
        title: "A step along the stripe".to_owned(),
        paragraphs: vec![format!(
            "The stripe jumps between two columns (A 183, noise 2; s and step in pixels). Columns more than {SPOILT_PX} px off and columns without a \
             point, means over 16 sub-pixel phases: the lateral resolution that goes with the figures above."
        )],
        tables: vec![Table {
            caption: String::new(),
            header,
            rows: rows.iter().enumerate().map(row).collect(),
        }],
        plots: all.iter().map(plot).collect(),
    }
}

fn smoothing_section(study: &Study) -> Section {
    let mut header = texts(["method"]);
    header.extend(study.smoothing.iter().map(|smoothing| smoothing.smoothing_columns.to_string()));
    let table = |caption: &str, cell: &dyn Fn(&smoothing::SmoothedMethod) -> String| {
        let row = |(place, &name): (usize, &&'static str)| {
            let cells = study.smoothing.iter().map(|smoothing| cell(&smoothing.methods[place]));
            std::iter::once(name.to_owned()).chain(cells).collect()
        };
        Table {
            caption: caption.to_owned(),
            header: header.clone(),
            rows: study.methods.iter().enumerate().map(row).collect(),
        }
    };
    Section {
        title: "Smoothing along the stripe".to_owned(),
        paragraphs: vec![format!(
            "The parameter extraction.smoothing_columns from 1 (none, as in all figures above unless stated otherwise) to 17: RMS \
             on the scene \"{}\", columns averaged there, and columns beside a step of {} px that are more than {SPOILT_PX} px \
             off (s {} px).",
            smoothing::SCENE,
            smoothing::EDGE.height_px,
            smoothing::EDGE.sigma_px
        )],
        tables: vec![
            table("RMS px", &|method| px(method.rms_px)),
            table("columns averaged", &|method| number(method.columns_averaged, 1)),
            table("columns off beside the step", &|method| number(method.spoilt_columns, 1)),
        ],
        plots: Vec::new(),
    }
}
