//! Figures of one pass over a results bag.

use super::status::Status;
use crate::{
    msg::{
        cdr,
        convert::results::UnknownDirection,
        laser_profiler_msgs::{Centerline, StreamStatus},
    },
    report::{
        chart::{Chart, Curve},
        quality::Quality,
        series::{Merge, Series},
    },
    results::{Notes, ResultsRecording},
};

/// Figures of the frames and of the stream.
pub(crate) struct Gathered {
    pub(crate) quality: Quality,
    pub(crate) status: Status,
    /// Stamps of the first and the last frame, nanoseconds.
    pub(crate) stamps_ns: Option<[i64; 2]>,
    /// Method and hash of the last frame; `num_methods` exceeds 1 if parameters changed.
    pub(crate) method: String,
    pub(crate) num_methods: u64,
    /// Columns and rows of the last image.
    pub(crate) size_px: [u32; 2],
    /// Delay from stamp to reception, milliseconds.
    delays: Series<1>,
}

impl Gathered {
    /// Reads centrelines and counters. Calls `on_frame` after each centreline.
    pub(crate) fn read(
        recording: &ResultsRecording,
        notes: &mut Notes,
        mut on_frame: impl FnMut(),
    ) -> Self {
        let mut gathered = Self {
            quality: Quality::default(),
            status: Status::default(),
            stamps_ns: None,
            method: String::new(),
            num_methods: 0,
            size_px: [0, 0],
            delays: Series::new([Merge::Mean]),
        };
        let [lines, states] = ["centerline", "stream_status"].map(|name| recording.topic(name));
        let topics: Vec<_> = lines.iter().chain(&states).collect();
        if topics.is_empty() {
            return gathered;
        }
        recording.for_each_message(&topics, notes, |message| {
            if Some(&message.topic.name) == lines.as_ref() {
                gathered.add(&cdr::decode(&message.data)?)?;
                on_frame();
            } else {
                gathered.status.add(&cdr::decode::<StreamStatus<'_>>(&message.data)?);
            }
            Ok(())
        });
        if states.is_none() {
            notes.add("the recording has no stream_status: drops and latency are unknown");
        }
        if gathered.quality.num_frames == 0 && lines.is_some() {
            notes.add("no centreline could be read");
        }
        if gathered.num_methods > 1 {
            notes.add("the extraction parameters changed during the recording");
        }
        gathered
    }

    fn add(&mut self, line: &Centerline<'_>) -> Result<(), UnknownDirection> {
        self.quality.add(line)?;
        let stamp_ns = line.header.stamp.to_ns();
        self.stamps_ns = Some([self.stamps_ns.map_or(stamp_ns, |[first, _]| first), stamp_ns]);
        if self.method != line.method {
            self.method = line.method.to_string();
            self.num_methods += 1;
        }
        self.size_px = [line.image_width, line.image_height];
        let received_ns = line.trace.receive_stamp.to_ns();
        self.delays.push([received_ns.saturating_sub(stamp_ns) as f64 / 1e6]);
        Ok(())
    }

    /// Returns the charts of delays and of the stream.
    pub(crate) fn charts(&self) -> Vec<Chart> {
        let delays = Chart {
            id: "delay",
            title: "From the image's stamp to its reception",
            x_label: "frame",
            y_label: "delay [ms]",
            x: self.delays.frames(),
            curves: vec![Curve::new("delay", self.delays.figure(0))],
        };
        std::iter::once(delays).chain(self.status.charts()).collect()
    }
}
