//! The suggested parameter file.

use std::fmt::Write as _;

use crate::{
    node::sampled::Sampled,
    ros::value::Value,
    scanner::{params::Params, suggestion::Suggestion},
};

const REGION: &str =
    "The line stays in this part of the picture. Widen it if parts move the line further.";

/// A parameter of the file: name, value, and the reason as a comment.
type Row = (&'static str, fn(&Params) -> Value, &'static str);

/// Every parameter that may be suggested, groups together.
const ROWS: [Row; 16] = [
    (
        "stripe_direction",
        |params| word(params.stripe_direction.name()),
        "The line runs from top to bottom: one point per row.",
    ),
    (
        "channel",
        |params| word(params.channel.name()),
        "Of the channels that show the line unclipped, the one that shows it best.",
    ),
    ("full_scale", |params| number(params.full_scale), "No sample needs more bits."),
    ("roi.x_offset", |params| number(params.roi.x_offset), REGION),
    ("roi.y_offset", |params| number(params.roi.y_offset), REGION),
    ("roi.width", |params| number(params.roi.width), REGION),
    ("roi.height", |params| number(params.roi.height), REGION),
    (
        "extraction.blur_radius",
        |params| number(params.extraction.blur_radius),
        "More blur would merge a narrow line with its surroundings.",
    ),
    (
        "extraction.background",
        |params| word(params.extraction.background.name()),
        "The surroundings are bright: what is wider than the window is background.",
    ),
    (
        "extraction.background_window",
        |params| number(params.extraction.background_window_px),
        "Several times the width of the line, pixels.",
    ),
    (
        "extraction.threshold",
        |params| word(params.extraction.threshold.name()),
        "Follows the noise of each frame.",
    ),
    (
        "extraction.threshold_sigmas",
        |params| Value::Float(params.extraction.threshold_sigmas),
        "Lower for fainter parts of the line, higher against clutter.",
    ),
    (
        "extraction.min_segment_area",
        |params| number(params.extraction.min_segment_area),
        "Pixels: keeps short pieces of the line.",
    ),
    (
        "extraction.max_width",
        |params| number(params.extraction.max_width_px),
        "Pixels: twice the width of the line after the blur; clutter is wider. Raise it if parts widen the line further.",
    ),
    (
        "extraction.peak_selection",
        |params| word(params.extraction.peak_selection.name()),
        "Clutter may be brighter than the line, but it forms no line.",
    ),
    (
        "extraction.max_step",
        |params| Value::Float(params.extraction.max_step_px),
        "Pixels from one point to the next; more is a break.",
    ),
];

fn word(name: &str) -> Value {
    Value::Text(name.to_owned())
}

/// A whole number; 0 for none.
fn number(value: impl Into<Option<u32>>) -> Value {
    Value::Integer(value.into().unwrap_or(0).into())
}

/// A parameter that differs from its default.
pub(super) struct Changed {
    /// Its name, with dots.
    pub(super) name: &'static str,
    /// Its value.
    pub(super) value: Value,
    /// The reason.
    why: &'static str,
}

/// Returns the suggested parameters that differ from their defaults, groups together.
pub(super) fn changed(params: &Params) -> Vec<Changed> {
    let defaults = Params::default();
    let rows = ROWS.iter().filter(|(_, value, _)| value(params) != value(&defaults));
    rows.map(|&(name, value, why)| Changed { name, value: value(params), why }).collect()
}

/// Returns the parameter file.
pub(super) fn text(suggestion: &Suggestion, sampled: &Sampled) -> String {
    let mut out = String::new();
    let Suggestion { share, share_of_defaults, width_px, .. } = suggestion;
    // Writing to a string cannot fail.
    _ = writeln!(
        out,
        "# Suggested by `laser_profiler suggest` from {} of {} frames on {}.\n\
         # The line is found in {:.0} % of the cross-sections, with the default parameters in {:.0} %; it is about {width_px:.1} px wide.\n\
         # Parameters that are not listed keep their defaults: `laser_profiler parameters`.\n\
         /**:\n  ros__parameters:",
        sampled.pictures.len(),
        sampled.num_frames,
        sampled.topic,
        100.0 * share,
        100.0 * share_of_defaults
    );
    let (mut open_group, mut last_why) = ("", "");
    let list = changed(&suggestion.params);
    if list.is_empty() {
        out.push_str("    # The defaults suit this recording.\n    stripe_direction: horizontal\n");
    }
    for Changed { name, value, why } in &list {
        let (group, key) = name.rsplit_once('.').unwrap_or(("", name));
        if group != open_group && !group.is_empty() {
            _ = writeln!(out, "    {group}:");
        }
        open_group = group;
        let indent = if group.is_empty() { "    " } else { "      " };
        if *why != last_why {
            _ = writeln!(out, "{indent}# {why}");
        }
        last_why = why;
        _ = writeln!(out, "{indent}{key}: {value}");
    }
    out
}
