//! Replay with a progress bar.

use anyhow::anyhow;

use super::{Usage, progress::progress_bar};
use crate::{
    node::{
        replay::{Replay, ReplayError, ReplayRequest},
        statistics::Summary,
        stop::Stop,
    },
    ros::node_params::ImageTransport,
};

/// Replays with a progress bar when standard error is a terminal.
///
/// # Errors
/// [`Usage`] for wrong usage; otherwise a file that cannot be read or written, or no readable frame.
pub fn replay(request: ReplayRequest, stop: &Stop) -> anyhow::Result<Summary> {
    let classified = |error: ReplayError| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    };
    let replay = Replay::prepare(request).map_err(classified)?;
    for topic in replay.image_topics() {
        let lossy = match topic.transport {
            ImageTransport::Raw => "",
            ImageTransport::Compressed => {
                " (compressed: JPEG shifts centrelines by some hundredths of a pixel, PNG does not)"
            }
        };
        tracing::info!("taking images from {}{lossy}", topic.name);
    }
    for topic in replay.position_topics() {
        tracing::info!("taking positions from {topic}");
    }
    let topics: Vec<_> = replay.image_topics().map(|topic| topic.name.clone()).collect();
    let bar = progress_bar(replay.num_messages(), "frames");
    let summary = replay.run(stop, &mut |num_messages| bar.set_position(num_messages));
    bar.finish_and_clear();
    let summary = summary.map_err(classified)?;
    if summary.counts.received == 0 && !summary.was_interrupted {
        return Err(anyhow!("no frame could be read from {}", topics.join(", ")));
    }
    Ok(summary)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bag::{RecordOptions, Recorder, Topic},
        msg::{qos::QosProfile, schema::Message, sensor_msgs::Image},
    };

    #[test]
    fn a_recording_without_frames_is_an_error() {
        let place = tempfile::tempdir().unwrap();
        let bag = place.path().join("empty");
        let mut recorder = Recorder::create(&bag, RecordOptions::default()).unwrap();
        let topic = Topic::new("/image_raw", Image::TYPE, QosProfile::reliable(10));
        recorder.add_topic(&topic).unwrap();
        recorder.finish().unwrap();
        let output = place.path().join("out");
        let request = ReplayRequest { bags: vec![bag], output, ..ReplayRequest::default() };
        let error = replay(request, &Stop::default()).unwrap_err();
        assert_eq!(error.to_string(), "no frame could be read from /image_raw");
    }
}
