//! Connects the recorder of a camera to parameters and diagnostics.

use crate::{
    bag::{self, Topic},
    msg::diagnostic_msgs::DiagnosticStatus,
    node::{
        live_recording::{
            BagStatus, LiveRecorder, RecordedTopics, RecordingControl, RecordingParams,
            RecordingStatus,
        },
        recording::Description,
        sink::{Outlet, Purpose, Way},
        statistics::Summary,
        status::Note,
        watch::Watch,
    },
    ros::node_params::{self, Compression},
};

/// The topics of a camera's results, and of its images and positions.
pub(super) fn topics(results: Vec<Topic>, inputs: Vec<Topic>) -> RecordedTopics {
    let num_results = results.len();
    RecordedTopics {
        results: results.into_iter().enumerate().collect(),
        images: (num_results..).zip(inputs).collect(),
    }
}

/// A recorder of a camera.
pub(super) fn recorder(
    camera: &str,
    params: &node_params::RecordingParams,
    description: Description,
    topics: RecordedTopics,
    watch: &Watch,
) -> (Outlet, RecordingControl) {
    let (sink, control) = LiveRecorder::new(camera, topics, chosen(params), description);
    let sink = sink.watched_by(watch);
    let outlet = Outlet {
        sink: Box::new(sink),
        takes_images: true,
        purpose: Purpose::Record,
        // It never blocks, and messages sent before a stop command are in the bag.
        way: Way::Direct,
        is_essential: false,
    };
    (outlet, control)
}

/// Converts the parameters for the recorder.
pub(super) fn chosen(params: &node_params::RecordingParams) -> RecordingParams {
    let seconds = |seconds| u32::try_from(seconds).unwrap_or(u32::MAX);
    RecordingParams {
        directory: params.directory.clone(),
        images: params.images,
        compression: match params.compression {
            Compression::Zstd => bag::Compression::Zstd,
            Compression::Lz4 => bag::Compression::Lz4,
            Compression::None => bag::Compression::None,
        },
        // Disks write images faster than processors compress them.
        image_compression: bag::Compression::None,
        split_bytes: params.split_bytes,
        split_seconds: params.split_seconds.map(seconds),
        min_free_bytes: params.min_free_bytes,
        queue_bytes: usize::try_from(params.queue_bytes).unwrap_or(usize::MAX),
        snapshot_seconds: params.snapshot_seconds.map(seconds),
        snapshot_bytes: usize::try_from(params.snapshot_bytes).unwrap_or(usize::MAX),
    }
}

/// Returns the number of messages that did not reach a bag.
pub(super) const fn num_dropped(status: &RecordingStatus) -> u64 {
    status.results.dropped + status.images.dropped + status.snapshot.dropped
}

/// Returns the number of bytes in the bags.
pub(super) const fn num_bytes(status: &RecordingStatus) -> u64 {
    status.results.bytes + status.images.bytes
}

/// Returns the summary of a camera with what its recordings have lost in the end.
pub(super) fn concluded(mut summary: Summary, status: &RecordingStatus) -> Summary {
    summary.counts.recorder_dropped = num_dropped(status);
    summary.counts.recorder_bytes = num_bytes(status);
    summary.recordings_failed.add(&status.failures);
    summary
}

/// Returns notes on the state of recordings and their errors.
pub(super) fn notes(status: &RecordingStatus) -> Vec<Note> {
    let bags = [
        ("recording", &status.results),
        ("recording of images", &status.images),
        ("snapshot", &status.snapshot),
    ];
    bags.into_iter().filter_map(|(key, bag)| note(key, bag)).collect()
}

fn note(key: &'static str, bag: &BagStatus) -> Option<Note> {
    if let Some(error) = &bag.last_error {
        return Some(Note { level: DiagnosticStatus::ERROR, key, text: error.clone() });
    }
    let directory = bag.directory.as_ref().filter(|_| bag.is_recording)?;
    let text = format!("{} ({} bytes)", directory.display(), bag.bytes);
    Some(Note { level: DiagnosticStatus::OK, key, text })
}
