//! What a comparison says, as a page.

use super::told::Answer;
use crate::{
    cli::report::{
        described,
        map::{colors, laid_out, thinned},
    },
    report::{
        chart::{Chart, Curve},
        difference::{Differences, SectionDifference},
        grid::Place,
        page::{Axis, Document, Fact, Map, Page, Table},
        quality::FLAGS,
    },
    results::{Notes, Reason, for_each_pair},
};

const AXES: [Axis; 3] = [
    Axis { label: "section", unit: "px", factor: 1.0, digits: 0 },
    Axis { label: "frame", unit: "", factor: 1.0, digits: 0 },
    Axis { label: "B − A", unit: "px", factor: 1.0, digits: 4 },
];

/// The page of a comparison.
///
/// # Errors
/// Those of joining the frames once more.
pub(super) fn page(answer: &Answer<'_>, notes: &mut Notes) -> anyhow::Result<Page> {
    let [a, b] = [0, 1].map(|which| described::title(answer.recordings[which]));
    let map = map(answer, notes)?;
    Ok(Page {
        title: format!("{a} and {b}"),
        subtitle: format!(
            "A: {a}, version {}, {} · B: {b}, version {}, {}",
            answer.recorded(0, "version"),
            answer.methods[0],
            answer.recorded(1, "version"),
            answer.methods[1]
        ),
        facts: facts(answer),
        notes: notes.texts().to_vec(),
        map,
        overlays: Vec::new(),
        charts: charts(answer.differences),
        tables: tables(answer),
        documents: documents(answer),
        program: concat!("laser_profiler ", env!("CARGO_PKG_VERSION")).to_owned(),
    })
}

fn facts(answer: &Answer<'_>) -> Vec<Fact> {
    let differences = answer.differences;
    let only = |[both, a, b]: [u64; 3]| format!("{both} in both, {a} only in A, {b} only in B");
    let figures = differences.pixels.figures();
    let mut facts = vec![
        Fact::new("Frames", only(differences.num_frames)),
        Fact::new("Points", only(differences.num_points)),
    ];
    if figures.num > 0 {
        facts.push(Fact::new("Bias, B − A", format!("{:.4} px", figures.bias)));
        facts.push(Fact::new("RMS", format!("{:.4} px", figures.rms)));
        facts.push(Fact::new("95 % below", format!("{:.4} px", figures.p95)));
        facts.push(Fact::new("Largest", format!("{:.4} px", figures.largest)));
    }
    let heights = differences.heights.figures();
    if heights.num > 0 {
        facts.push(Fact::new("Bias of heights", format!("{:.2} µm", heights.bias)));
        facts.push(Fact::new("RMS of heights", format!("{:.2} µm", heights.rms)));
    }
    facts
}

/// Where the differences are: frames up, cross-sections across.
fn map(answer: &Answer<'_>, notes: &mut Notes) -> anyhow::Result<Option<Map>> {
    let width = answer.differences.sections.len();
    let mut joined = Ok([0, 0]);
    let mut rows = |take: &mut dyn FnMut(&[Place])| {
        let mut again = Differences::default();
        let mut row = Vec::new();
        joined = for_each_pair(answer.recordings, notes, |pair| {
            row.clear();
            row.resize(width, [f32::NAN; 3]);
            for point in again.add(pair) {
                if let Some(place) = row.get_mut(point.section) {
                    let difference_px = point.difference_px as f32;
                    *place = [point.section as f32, pair.frame as f32, difference_px];
                }
            }
            take(&row);
        });
    };
    let found = laid_out(&mut rows);
    joined?;
    Ok(found.map(|(size, grid, _)| {
        let caption = format!(
            "B minus A across the stripe: {} frames, {} points that both have.{} Grey: not in both.",
            size.rows,
            size.num_measured,
            thinned(&grid)
        );
        let (about, packed) = grid.finish();
        Map {
            title: "Where they differ",
            caption,
            sections: ["One frame", "One cross-section over the frames"],
            axes: AXES,
            is_metric: false,
            colors: colors(),
            about: about.about_zero(),
            packed,
        }
    }))
}

fn charts(differences: &Differences) -> Vec<Chart> {
    let (frames, [bias, rms, only_a, only_b]) = differences.series();
    let over_frames = |id, title, y_label, curves| Chart {
        id,
        title,
        x_label: "frame",
        y_label,
        x: frames.clone(),
        curves,
    };
    let figures: Vec<_> = differences.sections.iter().map(SectionDifference::figures).collect();
    let column = |of: fn(&(u64, f64, f64)) -> f64| figures.iter().map(of).collect();
    let sections = Chart {
        id: "sections",
        title: "By cross-section",
        x_label: "section [px]",
        y_label: "B − A [px]",
        x: (0..figures.len()).map(|at| at as f64).collect(),
        curves: vec![
            Curve::new("bias", column(|figures| figures.1)),
            Curve::new("RMS", column(|figures| figures.2)),
        ],
    };
    let mut charts = vec![
        over_frames(
            "frames",
            "By frame",
            "B − A [px]",
            vec![Curve::new("bias", bias), Curve::new("RMS", rms)],
        ),
        sections,
        over_frames(
            "only",
            "Points that only one has",
            "points",
            vec![Curve::new("only in A", only_a), Curve::new("only in B", only_b)],
        ),
    ];
    charts.retain(|chart| chart.curves.iter().any(Curve::is_something));
    charts
}

fn tables(answer: &Answer<'_>) -> Vec<Table> {
    let table = |title: &str, heads: &[&str], rows: Vec<Vec<String>>| Table {
        title: title.to_owned(),
        heads: heads.iter().map(|head| (*head).to_owned()).collect(),
        rows,
    };
    let px = |value: f64| format!("{value:.4}");
    let why = answer
        .reasons
        .iter()
        .map(|Reason { name, values: [a, b] }| vec![name.clone(), a.clone(), b.clone()]);
    let worst = answer.differences.worst.iter().map(|frame| {
        vec![
            frame.frame.to_string(),
            px(frame.rms_px),
            px(frame.bias_px),
            px(frame.largest_px),
            frame.worst_section.to_string(),
        ]
    });
    let sections = answer.differences.worst_sections().into_iter().map(|section| {
        let (num, bias, rms) = answer.differences.sections[section].figures();
        vec![section.to_string(), px(rms), px(bias), num.to_string()]
    });
    let flags = FLAGS.iter().zip(answer.differences.num_flagged);
    let flags = flags.filter(|(_, [a, b])| a + b > 0);
    let flags =
        flags.map(|((_, name), [a, b])| vec![(*name).to_owned(), a.to_string(), b.to_string()]);
    let tables = [
        table("What is not the same", &["", "A", "B"], why.collect()),
        table(
            "Frames that differ most",
            &["Frame", "RMS [px]", "Bias [px]", "Largest [px]", "in section"],
            worst.collect(),
        ),
        table(
            "Cross-sections that differ most",
            &["Section", "RMS [px]", "Bias [px]", "Points"],
            sections.collect(),
        ),
        table(
            "Flags of points that both have",
            &["Flag", "only in A", "only in B"],
            flags.collect(),
        ),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

fn documents(answer: &Answer<'_>) -> Vec<Document> {
    let of = |(recording, letter)| {
        described::documents(recording).into_iter().map(move |document| Document {
            title: format!("{letter}: {}", document.title),
            ..document
        })
    };
    answer.recordings.into_iter().zip(["A", "B"]).flat_map(of).collect()
}
