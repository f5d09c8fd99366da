//! The frames of a report that are shown with their centrelines.

use std::collections::BTreeSet;

use super::{ReportArgs, gathered::Gathered, images};
use crate::{
    bag::Filter,
    msg::{cdr, laser_profiler_msgs::Centerline},
    report::overlay::Overlay,
    results::{Notes, ResultsRecording, ScanSelection},
};

/// How many frames are shown when nobody chose.
const DEFAULT: u64 = 4;

/// The chosen frames, with their images where there are any.
pub(super) fn overlays(
    args: &ReportArgs,
    source: &ResultsRecording,
    gathered: &Gathered,
    notes: &mut Notes,
) -> Vec<Overlay> {
    let num = gathered.quality.num_frames;
    let (Some(topic), 1..) = (source.topic("centerline"), num) else { return Vec::new() };
    let mut wanted: BTreeSet<u64> = args.frames.iter().copied().collect();
    for beyond in wanted.split_off(&num) {
        notes
            .add(format!("frame {beyond} is not there: the recording has {num}, 0 to {}", num - 1));
    }
    if args.frames.is_empty() {
        // In the middle of equal parts: the first and the last frame often show nothing.
        wanted.extend((0..DEFAULT).map(|part| (2 * part + 1) * num / (2 * DEFAULT)));
    }
    let mut overlays = centerlines(source, &topic, &wanted);
    if let Err(error) = add_images(args, source, &mut overlays, notes) {
        notes.add(format!("without images: {error:#}"));
    }
    overlays
}

/// The centrelines of frames by their number among those that can be read.
fn centerlines(source: &ResultsRecording, topic: &str, wanted: &BTreeSet<u64>) -> Vec<Overlay> {
    let messages = source.bag().messages(&Filter::topics([topic]));
    // What cannot be read was told when it was read first.
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

/// Puts images under the centrelines, by their stamps.
fn add_images(
    args: &ReportArgs,
    source: &ResultsRecording,
    overlays: &mut [Overlay],
    notes: &mut Notes,
) -> anyhow::Result<()> {
    if overlays.is_empty() {
        return Ok(());
    }
    let input = source.provenance().record.get("input_topic").map(String::as_str);
    match &args.images {
        None => images::add(source, input, overlays, notes),
        Some(path) => {
            let selection = ScanSelection { bag: path.clone(), ..ScanSelection::default() };
            // What is missing beside the images is of no interest here.
            let recording = ResultsRecording::open(&selection, &mut Notes::default())?;
            images::add(&recording, input, overlays, notes)
        }
    }
}
