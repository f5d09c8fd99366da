//! The suggested parameter file.

use std::fmt::Write as _;

use crate::{
    node::sampled::Sampled,
    scanner::{
        params::{Background, ExtractionParams, Params},
        suggestion::Suggestion,
    },
};

/// A parameter that differs from its default.
pub(super) struct Changed {
    /// Its name, with dots.
    pub(super) name: &'static str,
    /// Its value as in a parameter file.
    pub(super) value: String,
    /// The reason.
    why: &'static str,
}

/// Returns the suggested parameters that differ from their defaults, groups together.
pub(super) fn changed(params: &Params) -> Vec<Changed> {
    let mut list = of_picture(params);
    list.extend(of_extraction(&params.extraction));
    list
}

fn of_picture(params: &Params) -> Vec<Changed> {
    let defaults = Params::default();
    let mut list = Vec::new();
    let mut add = |name, is_changed: bool, value: String, why| {
        if is_changed {
            list.push(Changed { name, value, why });
        }
    };
    let word = |text: &str| text.to_owned();
    add(
        "stripe_direction",
        params.stripe_direction != defaults.stripe_direction,
        word(params.stripe_direction.name()),
        "The line runs from top to bottom: one point per row.",
    );
    add(
        "channel",
        params.channel != defaults.channel,
        word(params.channel.name()),
        "Of the channels that show the line, the one that clips it least.",
    );
    let full_scale = params.full_scale.unwrap_or(0);
    add("full_scale", full_scale != 0, full_scale.to_string(), "No sample needs more bits.");
    let roi = params.roi;
    let why =
        "The line stays in this part of the picture. Widen it if parts move the line further.";
    add("roi.x_offset", roi.x_offset != 0, roi.x_offset.to_string(), why);
    add("roi.y_offset", roi.y_offset != 0, roi.y_offset.to_string(), why);
    add("roi.width", roi.width.is_some(), roi.width.unwrap_or(0).to_string(), why);
    add("roi.height", roi.height.is_some(), roi.height.unwrap_or(0).to_string(), why);
    list
}

fn of_extraction(found: &ExtractionParams) -> Vec<Changed> {
    let plain = ExtractionParams::default();
    let mut list = Vec::new();
    let mut add = |name, is_changed: bool, value: String, why| {
        if is_changed {
            list.push(Changed { name, value, why });
        }
    };
    let word = |text: &str| text.to_owned();
    add(
        "extraction.blur_radius",
        found.blur_radius != plain.blur_radius,
        found.blur_radius.to_string(),
        "More blur would merge a narrow line with its surroundings.",
    );
    let is_local = found.background == Background::Local;
    add(
        "extraction.background",
        is_local,
        word(found.background.name()),
        "The surroundings are bright: what is wider than the window is background.",
    );
    add(
        "extraction.background_window",
        is_local && found.background_window_px != plain.background_window_px,
        found.background_window_px.to_string(),
        "Several times the width of the line, pixels.",
    );
    add(
        "extraction.threshold",
        found.threshold != plain.threshold,
        word(found.threshold.name()),
        "Follows the noise of each frame.",
    );
    add(
        "extraction.threshold_sigmas",
        (found.threshold_sigmas - plain.threshold_sigmas).abs() > 1e-9,
        format!("{:.1}", found.threshold_sigmas),
        "Lower for fainter parts of the line, higher against clutter.",
    );
    add(
        "extraction.min_segment_area",
        found.min_segment_area != plain.min_segment_area,
        found.min_segment_area.to_string(),
        "Pixels: keeps short pieces of the line.",
    );
    add(
        "extraction.peak_selection",
        found.peak_selection != plain.peak_selection,
        word(found.peak_selection.name()),
        "Clutter may be brighter than the line, but it forms no line.",
    );
    add(
        "extraction.max_step",
        (found.max_step_px - plain.max_step_px).abs() > 1e-9,
        format!("{:.1}", found.max_step_px),
        "Pixels from one point to the next; more is a break.",
    );
    list
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
