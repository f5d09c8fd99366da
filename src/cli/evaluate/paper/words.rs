//! Results of the protocol as text and tables.

use super::{
    super::document::{Section, Table, number, percent, px},
    NoiseStep, NoisyFigures, figures,
    measure::Measured,
};
use crate::evaluate::{
    paper::{Deviations, METHODS, Protocol},
    table3,
};

/// Returns the section about the paper's own numbers.
pub(in super::super) fn table_3_section() -> Section {
    let protocol = Protocol::of(&table3::ROWS_PX);
    let figures = figures(&protocol);
    let row = |label: &str, value: &dyn Fn(&Deviations) -> String| {
        let cells = figures.iter().map(|figure| value(&figure.deviations));
        std::iter::once(label.to_owned()).chain(cells).collect::<Vec<_>>()
    };
    let printed = table3::PRINTED_STANDARD_ERROR_PX.map(|value| format!("{value:.4}"));
    let mut header = vec!["from the 63 numbers of Table 3".to_owned()];
    header.extend(METHODS.map(|method| method.name().to_owned()));
    let mut rows = vec![
        row("mean absolute deviation [px]", &|d| number(d.mean_absolute_px, 3)),
        row("standard error √(Σv²/(n−1)) [px]", &|d| number(d.standard_error_px, 3)),
        row("Σv²/√(n−1), without the root [px²]", &|d| number(d.without_root, 4)),
    ];
    rows.push(
        std::iter::once("Table 4 as printed, \"standard error\"".to_owned())
            .chain(printed)
            .collect(),
    );
    Section {
        title: "The paper's protocol on the paper's numbers".to_owned(),
        paragraphs: vec![
            format!(
                "Yao et al., Appl. Sci. 2023, 13(17), 9831 (doi 10.3390/app13179831), compare three methods on {} \
                 columns, u = {} to {}: the mean of the three is the reference, v is a method's deviation from it.",
                protocol.points(),
                table3::FIRST_COLUMN,
                u64::from(table3::FIRST_COLUMN) + protocol.points() - 1
            ),
            "The printed mean absolute deviations follow from Table 3. The printed standard errors do not: the formula \
             √(Σv²/(n−1)) that the paper states gives 0.078, 0.063 and 0.034 px; Table 4 shows Σv²/√(n−1). A square root \
             was forgotten: the often quoted 0.005 px is 0.034 px, and not a measure of accuracy, because the three methods share \
             their errors with the mean that they are compared to."
                .to_owned(),
        ],
        tables: vec![Table { caption: String::new(), header, rows }],
        plots: Vec::new(),
    }
}

/// Returns the section about a recording.
pub(super) fn recording_sections(name: &str, topic: &str, measured: &Measured) -> Vec<Section> {
    let Measured { read, columns: [first, last], steps } = measured;
    let plain = &steps[0];
    let rejected = match read.rejected {
        0 => String::new(),
        count => format!(" {count} frames or damaged places were skipped."),
    };
    let protocol = Section {
        title: format!("The paper's protocol on {name}"),
        paragraphs: vec![format!(
            "{} frames of {topic}, columns {first} to {last}; all three methods found {} points. The mean of the three is \
             the reference: the deviations measure agreement, not accuracy.{rejected}",
            read.frames, plain.points
        )],
        tables: vec![Table {
            caption: String::new(),
            header: ["method", "mean absolute [px]", "standard error [px]", "found [%]"]
                .map(str::to_owned)
                .into(),
            rows: plain.methods.iter().map(plain_row).collect(),
        }],
        plots: Vec::new(),
    };
    let noise = Section {
        title: "The noise test".to_owned(),
        paragraphs: vec![
            "Gaussian noise of standard deviation γ (grey levels of an 8-bit scale) is added to the image, rounded and \
             clipped. \"From own\": root mean square distance from what the same method found without that noise."
                .to_owned(),
        ],
        tables: vec![
            noise_table("standard error from the mean of three [px]", steps, |figures| {
                px(figures.deviations.standard_error_px)
            }),
            noise_table("from own [px]", steps, |figures| px(figures.from_own_rms_px)),
            noise_table("found [%]", steps, |figures| percent(figures.found)),
        ],
        plots: vec![("paper_noise.svg".to_owned(), "Standard error over the added noise".to_owned())],
    };
    vec![protocol, noise]
}

fn plain_row(figures: &NoisyFigures) -> Vec<String> {
    vec![
        figures.method.to_owned(),
        px(figures.deviations.mean_absolute_px),
        px(figures.deviations.standard_error_px),
        percent(figures.found),
    ]
}

fn noise_table(
    caption: &str,
    steps: &[NoiseStep],
    cell: impl Fn(&NoisyFigures) -> String,
) -> Table {
    let header =
        std::iter::once("γ".to_owned()).chain(METHODS.map(|method| method.name().to_owned()));
    let row = |step: &NoiseStep| {
        std::iter::once(number(step.gamma, 0)).chain(step.methods.iter().map(&cell)).collect()
    };
    Table {
        caption: caption.to_owned(),
        header: header.collect(),
        rows: steps.iter().map(row).collect(),
    }
}
