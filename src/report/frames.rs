//! Frames of a report with their centrelines.

use std::{collections::BTreeSet, path::PathBuf};

use super::{gathered::Gathered, images};
use crate::{
    bag::Filter,
    msg::{cdr, laser_profiler_msgs::Centerline},
    report::overlay::Overlay,
    results::{Notes, ResultsRecording, ScanSelection},
};

/// Number of frames without a selection.
const DEFAULT: u64 = 4;

/// Frames that are shown with their centrelines.
#[derive(Clone, Debug, Default)]
pub(crate) struct FrameSelection {
    /// Numbers of the frames, from 0; a few, evenly spaced, if empty.
    pub(crate) numbers: Vec<u64>,
    /// Recording with the images; `None`: the results bag.
    pub(crate) images: Option<PathBuf>,
}

/// Returns the selected frames with their images, if available.
pub(crate) fn overlays(
    selection: &FrameSelection,
    recording: &ResultsRecording,
    gathered: &Gathered,
    notes: &mut Notes,
) -> Vec<Overlay> {
    let num = gathered.quality.num_frames;
    let (Some(topic), 1..) = (recording.topic("centerline"), num) else { return Vec::new() };
    let mut wanted: BTreeSet<u64> = selection.numbers.iter().copied().collect();
    for beyond in wanted.split_off(&num) {
        notes.add(format!(
            "frame {beyond} does not exist: the recording has {num}, 0 to {}",
            num - 1
        ));
    }
    if selection.numbers.is_empty() {
        // Centres of equal parts: the first and the last frame often show nothing.
        wanted.extend((0..DEFAULT).map(|part| (2 * part + 1) * num / (2 * DEFAULT)));
    }
    let mut overlays = centerlines(recording, &topic, &wanted);
    if let Err(error) = add_images(selection.images.as_ref(), recording, &mut overlays, notes) {
        notes.add(format!("without images: {error:#}"));
    }
    overlays
}

/// Returns the centrelines of frames by their number among the readable ones.
fn centerlines(recording: &ResultsRecording, topic: &str, wanted: &BTreeSet<u64>) -> Vec<Overlay> {
    let messages = recording.bag().messages(&Filter::topics([topic]));
    // Errors were noted in the first pass.
    let good =
        messages.flatten().filter(|message| cdr::decode::<Centerline<'_>>(&message.data).is_ok());
    let last = wanted.last().map_or(0, |last| *last as usize + 1);
    let chosen = (0..).zip(good.take(last)).filter(|(number, _)| wanted.contains(number));
    chosen
        .filter_map(|(number, message)| {
            Some(Overlay::new(number, &cdr::decode(&message.data).ok()?))
        })
        .collect()
}

/// Adds images to the centrelines by their stamps.
fn add_images(
    images: Option<&PathBuf>,
    recording: &ResultsRecording,
    overlays: &mut [Overlay],
    notes: &mut Notes,
) -> anyhow::Result<()> {
    if overlays.is_empty() {
        return Ok(());
    }
    let input = recording.provenance().record.get("input_topic").map(String::as_str);
    match images {
        None => images::add(recording, input, overlays, notes),
        Some(path) => {
            let selection = ScanSelection { bag: path.clone(), ..ScanSelection::default() };
            // Only the images matter here: ignore other notes.
            let recording = ResultsRecording::open(&selection, &mut Notes::default())?;
            images::add(&recording, input, overlays, notes)
        }
    }
}
