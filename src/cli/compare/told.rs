//! What a comparison says, as text and as JSON.

use std::fmt::{self, Write as _};

use serde_json::{Value as Json, json};

use crate::{
    report::{
        difference::{Differences, FrameDifference},
        quality::FLAGS,
        spread::Figures,
    },
    results::{Notes, Reason, ResultsRecording},
};

/// Everything that was found.
pub(super) struct Answer<'a> {
    pub(super) recordings: [&'a ResultsRecording; 2],
    pub(super) methods: [String; 2],
    pub(super) differences: &'a Differences,
    pub(super) reasons: Vec<Reason>,
}

impl Answer<'_> {
    /// A recorded text of A or B, a dash without.
    pub(super) fn recorded(&self, which: usize, key: &str) -> &str {
        self.recordings[which].provenance().recorded(key).unwrap_or("–")
    }

    /// The figures that there are, with their units.
    pub(super) fn figures(&self) -> Vec<(&'static str, usize, Figures)> {
        let found = [
            ("across the stripe [px]", 4, self.differences.pixels.figures()),
            ("height [µm]", 2, self.differences.heights.figures()),
        ];
        found.into_iter().filter(|(_, _, figures)| figures.num > 0).collect()
    }

    /// Tables for a terminal.
    ///
    /// # Errors
    /// None: writing to a string does not fail.
    pub(super) fn text(&self) -> Result<String, fmt::Error> {
        let differences = self.differences;
        let mut text = String::new();
        for (which, letter) in ["A", "B"].iter().enumerate() {
            writeln!(
                text,
                "{letter}  {}  version {}  {}",
                self.recordings[which].path().display(),
                self.recorded(which, "version"),
                self.methods[which]
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
        for (name, digits, figures) in self.figures() {
            let Figures { bias, median, rms, robust, p95, largest, .. } = figures;
            write!(text, "{name:<24}")?;
            for value in [bias, median, rms, robust, p95, largest] {
                write!(text, "{value:>12.digits$}")?;
            }
            writeln!(text)?;
        }
        self.tell_places(&mut text)?;
        self.tell_reasons(&mut text)?;
        Ok(text)
    }

    fn tell_places(&self, text: &mut String) -> fmt::Result {
        let differences = self.differences;
        for ((_, name), [a, b]) in FLAGS.iter().zip(differences.num_flagged) {
            if a + b > 0 {
                writeln!(text, "flag: {name:<20}{a} only in A, {b} only in B")?;
            }
        }
        if differences.worst.is_empty() {
            writeln!(text, "\nWhere both have a point it is the same.")?;
            return Ok(());
        }
        writeln!(
            text,
            "\nFrames that differ most   RMS [px]   bias [px]   largest [px]  in section"
        )?;
        for frame in differences.worst.iter().take(5) {
            let FrameDifference { frame, rms_px, bias_px, largest_px, worst_section, .. } = frame;
            writeln!(
                text,
                "  {frame:<22}{rms_px:>10.4}{bias_px:>12.4}{largest_px:>15.4}  {worst_section}"
            )?;
        }
        writeln!(text, "\nSections that differ most RMS [px]   bias [px]   points")?;
        for section in differences.worst_sections().into_iter().take(5) {
            let (num, bias, rms) = differences.sections[section].figures();
            writeln!(text, "  {section:<22}{rms:>10.4}{bias:>12.4}   {num}")?;
        }
        Ok(())
    }

    fn tell_reasons(&self, text: &mut String) -> fmt::Result {
        let told = if self.reasons.is_empty() {
            "\nVersion, parameters and calibration are the same."
        } else {
            "\nWhat is not the same:"
        };
        writeln!(text, "{told}")?;
        for Reason { name, values } in &self.reasons {
            let [a, b] = values.each_ref().map(|value| if value.is_empty() { "–" } else { value });
            writeln!(text, "  {name}: {a} → {b}")?;
        }
        Ok(())
    }

    /// The keys that `--help` names.
    pub(super) fn json(&self, notes: &Notes) -> String {
        let differences = self.differences;
        let one = |which: usize| {
            json!({
                "path": self.recordings[which].path(),
                "version": self.recordings[which].provenance().record.get("version"),
                "method": self.methods[which],
                "input": self.recordings[which].provenance().record.get("input"),
                "frames_only": differences.num_frames[1 + which],
                "points_only": differences.num_points[1 + which],
            })
        };
        let some = |figures: Figures| {
            if figures.num == 0 { Json::Null } else { json!(figures) }
        };
        let flags = FLAGS.iter().zip(differences.num_flagged);
        let flags: serde_json::Map<String, Json> =
            flags.map(|((_, name), num)| ((*name).to_owned(), json!(num))).collect();
        let frames: Vec<Json> = differences.worst.iter().map(frame_json).collect();
        let sections = differences.worst_sections().into_iter().map(|section| {
            let (num, bias_px, rms_px) = differences.sections[section].figures();
            let only = differences.sections[section].only;
            json!({"section": section, "points": num, "bias_px": bias_px, "rms_px": rms_px, "points_only": only})
        });
        let reasons = self
            .reasons
            .iter()
            .map(|Reason { name, values: [a, b] }| json!({"what": name, "a": a, "b": b}));
        let object = json!({
            "a": one(0),
            "b": one(1),
            "frames": differences.num_frames[0],
            "points": differences.num_points[0],
            "px": some(differences.pixels.figures()),
            "um": some(differences.heights.figures()),
            "flags": flags,
            "frames_worst": frames,
            "sections_worst": sections.collect::<Vec<_>>(),
            "reasons": reasons.collect::<Vec<_>>(),
            "notes": notes.texts(),
            "lost": notes.num_lost(),
        });
        format!("{object}\n")
    }
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
