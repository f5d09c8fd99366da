//! The page of a comparison.

use super::{
    chart::{Chart, Curve},
    color,
    comparison::Comparison,
    described,
    difference::{Differences, FrameSeries, SectionDifference, SectionFigures},
    grid::Place,
    map::{Mapped, mapped, thinned},
    page::{Axis, Document, Fact, Map, Page, Table},
    quality::FLAGS,
};
use crate::results::{Notes, Reason, for_each_pair};

const AXES: [Axis; 3] = [
    Axis { label: "section", unit: "px", factor: 1.0, digits: 0 },
    Axis { label: "frame", unit: "", factor: 1.0, digits: 0 },
    Axis { label: "B − A", unit: "px", factor: 1.0, digits: 4 },
];

/// The page of a comparison.
///
/// # Errors
/// Those of joining the frames once more.
pub(super) fn page(comparison: &Comparison<'_>, notes: &mut Notes) -> anyhow::Result<Page> {
    let [a, b] = [0, 1].map(|which| described::title(comparison.recordings[which]));
    let map = map(comparison, notes)?;
    Ok(Page {
        title: format!("{a} and {b}"),
        subtitle: format!(
            "A: {a}, version {}, {} · B: {b}, version {}, {}",
            comparison.recorded(0, "version"),
            comparison.methods[0],
            comparison.recorded(1, "version"),
            comparison.methods[1]
        ),
        facts: facts(comparison),
        notes: notes.texts().to_vec(),
        map,
        overlays: Vec::new(),
        charts: charts(&comparison.differences),
        tables: tables(comparison),
        documents: documents(comparison),
        program: super::PROGRAM.to_owned(),
    })
}

fn facts(comparison: &Comparison<'_>) -> Vec<Fact> {
    let differences = &comparison.differences;
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

/// Returns the map of the differences: frames along y, cross-sections along x.
fn map(comparison: &Comparison<'_>, notes: &mut Notes) -> anyhow::Result<Option<Map>> {
    let width = comparison.differences.sections.len();
    let mut joined = Ok([0, 0]);
    let mut rows = |take: &mut dyn FnMut(&[Place])| {
        let mut again = Differences::default();
        let mut row = Vec::new();
        joined = for_each_pair(comparison.recordings, notes, |pair| {
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
    let found = mapped(&mut rows);
    joined?;
    Ok(found.map(|Mapped { extent, grid, .. }| {
        let caption = format!(
            "B minus A across the stripe: {} frames, {} common points.{} Grey: not in both.",
            extent.rows,
            extent.num_measured,
            thinned(&grid)
        );
        let (about, packed) = grid.finish();
        Map {
            title: "Map of the differences",
            caption,
            sections: ["One frame", "One cross-section over the frames"],
            axes: AXES,
            is_metric: false,
            colors: color::scale(),
            about: about.about_zero(),
            packed,
        }
    }))
}

fn charts(differences: &Differences) -> Vec<Chart> {
    let FrameSeries { frames, bias_px, rms_px, only: [only_a, only_b] } = differences.series();
    let over_frames = |id, title, y_label, curves| Chart {
        id,
        title,
        x_label: "frame",
        y_label,
        x: frames.clone(),
        curves,
    };
    let figures: Vec<_> = differences.sections.iter().map(SectionDifference::figures).collect();
    let column = |of: fn(&SectionFigures) -> f64| figures.iter().map(of).collect();
    let sections = Chart {
        id: "sections",
        title: "By cross-section",
        x_label: "section [px]",
        y_label: "B − A [px]",
        x: (0..figures.len()).map(|at| at as f64).collect(),
        curves: vec![
            Curve::new("bias", column(|figures| figures.bias_px)),
            Curve::new("RMS", column(|figures| figures.rms_px)),
        ],
    };
    let mut charts = vec![
        over_frames(
            "frames",
            "By frame",
            "B − A [px]",
            vec![Curve::new("bias", bias_px), Curve::new("RMS", rms_px)],
        ),
        sections,
        over_frames(
            "only",
            "Points in only one of them",
            "points",
            vec![Curve::new("only in A", only_a), Curve::new("only in B", only_b)],
        ),
    ];
    charts.retain(|chart| chart.curves.iter().any(Curve::is_something));
    charts
}

fn tables(comparison: &Comparison<'_>) -> Vec<Table> {
    let table = |title: &str, heads: &[&str], rows: Vec<Vec<String>>| Table {
        title: title.to_owned(),
        heads: heads.iter().map(|head| (*head).to_owned()).collect(),
        rows,
    };
    let px = |value: f64| format!("{value:.4}");
    let why = comparison
        .reasons
        .iter()
        .map(|Reason { name, values: [a, b] }| vec![name.clone(), a.clone(), b.clone()]);
    let worst = comparison.differences.worst.iter().map(|frame| {
        vec![
            frame.frame.to_string(),
            px(frame.rms_px),
            px(frame.bias_px),
            px(frame.largest_px),
            frame.worst_section.to_string(),
        ]
    });
    let sections = comparison.differences.worst_sections().into_iter().map(|section| {
        let SectionFigures { num, bias_px, rms_px } =
            comparison.differences.sections[section].figures();
        vec![section.to_string(), px(rms_px), px(bias_px), num.to_string()]
    });
    let flags = FLAGS.iter().zip(comparison.differences.num_flagged);
    let flags = flags.filter(|(_, [a, b])| a + b > 0);
    let flags =
        flags.map(|((_, name), [a, b])| vec![(*name).to_owned(), a.to_string(), b.to_string()]);
    let tables = [
        table("Differing settings", &["", "A", "B"], why.collect()),
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
        table("Flags of common points", &["Flag", "only in A", "only in B"], flags.collect()),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

fn documents(comparison: &Comparison<'_>) -> Vec<Document> {
    let of = |(recording, letter)| {
        described::documents(recording).into_iter().map(move |document| Document {
            title: format!("{letter}: {}", document.title),
            ..document
        })
    };
    comparison.recordings.into_iter().zip(["A", "B"]).flat_map(of).collect()
}
