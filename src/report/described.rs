//! Facts, tables and texts of a report.

use super::{date::date, gathered::Gathered};
use crate::{
    report::{
        grid::Extent,
        page::{Document, Fact, Table},
        quality::FLAGS,
    },
    results::ResultsRecording,
};

/// Returns the name of the recording.
pub(crate) fn title(recording: &ResultsRecording) -> String {
    let name = recording.path().file_name().map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| recording.path().display().to_string())
}

/// Returns date, duration, input and method.
pub(crate) fn subtitle(recording: &ResultsRecording, gathered: &Gathered) -> String {
    let mut parts = Vec::new();
    if let Some([first_ns, last_ns]) = gathered.stamps_ns {
        parts.push(date(first_ns));
        parts.push(format!("{:.3} s", last_ns.saturating_sub(first_ns) as f64 / 1e9));
    }
    let recorded = |key: &str| recording.provenance().recorded(key);
    if let Some(input) = recorded("input") {
        parts.push(format!("from {}", input.replace('\n', ", ")));
    }
    if let Some(topic) = recorded("input_topic") {
        parts.push(topic.to_owned());
    }
    if !gathered.method.is_empty() {
        parts.push(gathered.method.clone());
    }
    parts.join(" · ")
}

/// Returns the key figures.
pub(crate) fn facts(gathered: &Gathered, size: Option<&Extent>) -> Vec<Fact> {
    let quality = &gathered.quality;
    let mut facts = Vec::new();
    if quality.num_frames > 0 {
        let [width, height] = gathered.size_px;
        facts.push(Fact::new("Frames", quality.num_frames.to_string()));
        facts.push(Fact::new("Frames lost between them", quality.num_lost.to_string()));
        facts.push(Fact::new("Image", format!("{width} × {height} px")));
        facts.push(Fact::new("Points", quality.num_points.to_string()));
        facts.push(Fact::new(
            "Cross-sections without a stripe",
            percent(quality.num_sections - quality.num_found, quality.num_sections),
        ));
        facts.push(Fact::new("Uncertainty σ, median", pixels(quality.sigma_px(), 4)));
        facts.push(Fact::new("Stripe width, median", pixels(quality.width_px(), 2)));
        let saturated = percent(quality.num_flagged[0], quality.num_points);
        facts.push(Fact::new("Points saturated", saturated));
    }
    if let Some(lost) = gathered.status.num_lost() {
        facts.push(Fact::new("Frames dropped, lost or rejected", lost.to_string()));
    }
    if let (Some(size), true) = (size, gathered.quality.num_frames == 0) {
        facts.push(Fact::new("Profiles", size.rows.to_string()));
        facts.push(Fact::new("Points", size.num_measured.to_string()));
    }
    facts
}

/// Returns the tables of counters, flags and topics.
pub(crate) fn tables(recording: &ResultsRecording, gathered: &Gathered) -> Vec<Table> {
    let quality = &gathered.quality;
    let flags = FLAGS.iter().zip(quality.num_flagged).map(|((_, name), num)| {
        vec![(*name).to_owned(), num.to_string(), percent(num, quality.num_points)]
    });
    let flags = (quality.num_points > 0).then(|| Table {
        title: "Points with flags".to_owned(),
        heads: ["Flag", "Points", "Share"].map(str::to_owned).into(),
        rows: flags.collect(),
    });
    let counts = recording.bag().message_counts().unwrap_or_default();
    let row = |topic: &std::sync::Arc<crate::bag::Topic>| {
        let count = counts.get(topic.name.as_str()).map_or("–".to_owned(), u64::to_string);
        vec![topic.name.clone(), topic.type_name.clone(), count]
    };
    let topics = Table {
        title: "Topics of the recording".to_owned(),
        heads: ["Topic", "Type", "Messages"].map(str::to_owned).into(),
        rows: recording.bag().topics().iter().map(row).collect(),
    };
    gathered.status.table().into_iter().chain(flags).chain([topics]).collect()
}

/// Returns the recorded calibration and parameters.
pub(crate) fn documents(recording: &ResultsRecording) -> Vec<Document> {
    let mut documents = Vec::new();
    let mut add = |title: &str, text: Option<&String>| {
        if let Some(text) = text.filter(|text| !text.is_empty()) {
            documents.push(Document { title: title.to_owned(), text: text.clone() });
        }
    };
    add("Calibration (calibration.yaml)", recording.provenance().calibration.as_ref());
    add("Parameters", recording.provenance().record.get("parameters"));
    let rest = recording.provenance().record.iter().filter(|(key, _)| *key != "parameters");
    let rest: Vec<_> =
        rest.map(|(key, text)| format!("{key}: {}", text.replace('\n', ", "))).collect();
    add("Version and origin", Some(&rest.join("\n")));
    documents
}

fn percent(part: u64, whole: u64) -> String {
    if whole == 0 {
        return "–".to_owned();
    }
    format!("{:.2} %", 100.0 * part as f64 / whole as f64)
}

fn pixels(value: f64, digits: usize) -> String {
    if value.is_finite() { format!("{value:.digits$} px") } else { "not stated".to_owned() }
}
