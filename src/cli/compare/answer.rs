//! A comparison as text and as JSON.

use std::fmt::{self, Write as _};

use serde_json::{Value as Json, json};

use crate::{
    report::{
        comparison::Comparison,
        difference::{FrameDifference, SectionFigures},
        quality::FLAGS,
        spread::Figures,
    },
    results::{Notes, Reason},
};

/// Formats tables for a terminal.
///
/// # Errors
/// None: writing to a string does not fail.
pub(super) fn text(comparison: &Comparison<'_>) -> Result<String, fmt::Error> {
    let differences = &comparison.differences;
    let mut text = String::new();
    for (which, letter) in ["A", "B"].iter().enumerate() {
        writeln!(
            text,
            "{letter}  {}  version {}  {}",
            comparison.recordings[which].path().display(),
            comparison.recorded(which, "version"),
            comparison.methods[which]
        )?;
    }
    for (what, [both, a, b]) in
        [("Frames", differences.num_frames), ("Points", differences.num_points)]
    {
        writeln!(text, "{what}  {both} in both, {a} only in A, {b} only in B")?;
    }
    writeln!(
        text,
        "\n{:<24}{:>12}{:>12}{:>12}{:>12}{:>12}{:>12}",
        "B minus A", "bias", "median", "RMS", "robust", "95 %", "largest"
    )?;
    let figures = [
        ("across the stripe [px]", 4, comparison.figures_px()),
        ("height [µm]", 2, comparison.figures_um()),
    ];
    for (name, digits, figures) in figures {
        let Some(figures) = figures else { continue };
        let Figures { bias, median, rms, robust, p95, largest, .. } = figures;
        write!(text, "{name:<24}")?;
        for value in [bias, median, rms, robust, p95, largest] {
            write!(text, "{value:>12.digits$}")?;
        }
        writeln!(text)?;
    }
    write_places(comparison, &mut text)?;
    write_reasons(comparison, &mut text)?;
    Ok(text)
}

fn write_places(comparison: &Comparison<'_>, text: &mut String) -> fmt::Result {
    let differences = &comparison.differences;
    for ((_, name), [a, b]) in FLAGS.iter().zip(differences.num_flagged) {
        if a + b > 0 {
            writeln!(text, "flag: {name:<20}{a} only in A, {b} only in B")?;
        }
    }
    if differences.worst.is_empty() {
        writeln!(text, "\nAll common points are identical.")?;
        return Ok(());
    }
    writeln!(text, "\nFrames that differ most   RMS [px]   bias [px]   largest [px]  in section")?;
    for frame in differences.worst.iter().take(5) {
        let FrameDifference { frame, rms_px, bias_px, largest_px, worst_section, .. } = frame;
        writeln!(
            text,
            "  {frame:<22}{rms_px:>10.4}{bias_px:>12.4}{largest_px:>15.4}  {worst_section}"
        )?;
    }
    writeln!(text, "\nSections that differ most RMS [px]   bias [px]   points")?;
    for section in differences.worst_sections().into_iter().take(5) {
        let SectionFigures { num, bias_px, rms_px } = differences.sections[section].figures();
        writeln!(text, "  {section:<22}{rms_px:>10.4}{bias_px:>12.4}   {num}")?;
    }
    Ok(())
}

fn write_reasons(comparison: &Comparison<'_>, text: &mut String) -> fmt::Result {
    let heading = if comparison.reasons.is_empty() {
        "\nVersion, parameters and calibration are identical."
    } else {
        "\nDiffering settings:"
    };
    writeln!(text, "{heading}")?;
    for Reason { name, values } in &comparison.reasons {
        let [a, b] = values.each_ref().map(|value| if value.is_empty() { "–" } else { value });
        writeln!(text, "  {name}: {a} → {b}")?;
    }
    Ok(())
}

/// Returns the JSON object that `--help` describes.
pub(super) fn json(comparison: &Comparison<'_>, notes: &Notes) -> String {
    let differences = &comparison.differences;
    let one = |which: usize| {
        json!({
            "path": comparison.recordings[which].path(),
            "version": comparison.recordings[which].provenance().record.get("version"),
            "method": comparison.methods[which],
            "input": comparison.recordings[which].provenance().record.get("input"),
            "frames_only": differences.num_frames[1 + which],
            "points_only": differences.num_points[1 + which],
        })
    };
    let flags = FLAGS.iter().zip(differences.num_flagged);
    let flags: serde_json::Map<String, Json> =
        flags.map(|((_, name), num)| ((*name).to_owned(), json!(num))).collect();
    let frames: Vec<Json> = differences.worst.iter().map(frame_json).collect();
    let sections = differences.worst_sections().into_iter().map(|section| {
        let SectionFigures { num, bias_px, rms_px } = differences.sections[section].figures();
        let only = differences.sections[section].only;
        json!({"section": section, "points": num, "bias_px": bias_px, "rms_px": rms_px, "points_only": only})
    });
    let reasons = comparison
        .reasons
        .iter()
        .map(|Reason { name, values: [a, b] }| json!({"what": name, "a": a, "b": b}));
    let object = json!({
        "a": one(0),
        "b": one(1),
        "frames": differences.num_frames[0],
        "points": differences.num_points[0],
        "px": comparison.figures_px(),
        "um": comparison.figures_um(),
        "flags": flags,
        "frames_worst": frames,
        "sections_worst": sections.collect::<Vec<_>>(),
        "reasons": reasons.collect::<Vec<_>>(),
        "notes": notes.texts(),
        "lost": notes.num_lost(),
    });
    format!("{object}\n")
}

fn frame_json(frame: &FrameDifference) -> Json {
    json!({
        "frame": frame.frame,
        "stamp_ns": frame.stamp_ns,
        "points": frame.num,
        "points_only": frame.only,
        "bias_px": frame.bias_px,
        "rms_px": frame.rms_px,
        "largest_px": frame.largest_px,
        "worst_section": frame.worst_section,
    })
}
