//! Compares every method's centrelines with the ground truth in a recording.

use std::collections::BTreeMap;

use anyhow::{Context, ensure};
use serde::Serialize;

use super::{
    document::{Section, Table, number, percent, px},
    progress_bar,
    recording::{Message, Read, Recording, TRUTH_TOPIC, Wanted},
};
use crate::{
    evaluate::{
        statistics::{Accuracy, Tally, WRONG_PX},
        trial::{Point, by_line, deviation},
    },
    msg::{cdr, laser_profiler_msgs},
    scanner::{
        channel::SearchedRegion,
        frame_index::FrameIndex,
        image::Frame,
        params::{ExtractionParams, Method, Params, StripeDirection},
        pipeline::Pipeline,
    },
};

/// Most frames and truths that wait for their counterpart; both for one frame are adjacent in the recording.
const MAX_WAITING: usize = 32;

/// Measurement results.
pub(super) struct Measured {
    pub(super) read: Read,
    /// Number of frames with ground truth.
    pub(super) frames: u64,
    /// Number of frames without ground truth.
    pub(super) unpaired: u64,
    pub(super) methods: Vec<MethodAccuracy>,
}

/// One method's figures.
#[derive(Clone, Debug, Serialize)]
pub(super) struct MethodAccuracy {
    method: &'static str,
    #[serde(flatten)]
    accuracy: Accuracy,
}

/// Measures every frame with every method.
///
/// # Errors
/// A recording without ground truth, or without a frame that could be measured.
pub(super) fn measure(recording: &Recording, methods: &[Method]) -> anyhow::Result<Measured> {
    let has_truth = recording.bag.topics().iter().any(|topic| topic.name == TRUTH_TOPIC);
    ensure!(
        has_truth,
        "the recording has no topic {TRUTH_TOPIC}: `laser_profiler simulate` makes recordings with ground truth"
    );
    let mut judge = Judge::new(&recording.camera.scanner, methods);
    let bar = progress_bar(recording.num_images(), "frames");
    let read = recording.read(Some(TRUTH_TOPIC), |message| {
        match message {
            Message::Frame(frame) => {
                judge.take_frame(frame)?;
                bar.inc(1);
            }
            Message::Other(message) => {
                let truth: laser_profiler_msgs::Centerline<'_> =
                    cdr::decode(&message.data).context(TRUTH_TOPIC)?;
                judge.take_truth(&truth);
            }
        }
        Ok(Wanted::More)
    });
    bar.finish_and_clear();
    ensure!(judge.frames > 0, "no frame of {} has ground truth", recording.topic.name);
    let unpaired = judge.unpaired + judge.measured.len() as u64;
    let named = judge.methods.iter().zip(&judge.tallies);
    let methods = named
        .map(|(method, tally)| MethodAccuracy { method: method.name(), accuracy: tally.accuracy() })
        .collect();
    Ok(Measured { read, frames: judge.frames, unpaired, methods })
}

/// The points of one frame by column, for each method, and the searched region.
struct MeasuredFrame {
    searched: SearchedRegion,
    points: Vec<Vec<Option<Point>>>,
}

/// Matches frames and ground truth by their stamps.
struct Judge {
    params: Params,
    methods: Vec<Method>,
    pipelines: Vec<Pipeline>,
    tallies: Vec<Tally>,
    /// Frames waiting for their ground truth, by stamp.
    measured: BTreeMap<i64, MeasuredFrame>,
    /// Ground truth waiting for its frame, by stamp: column and position.
    truths: BTreeMap<i64, Vec<(usize, f64)>>,
    frames: u64,
    unpaired: u64,
}

impl Judge {
    fn new(params: &Params, methods: &[Method]) -> Self {
        let pipeline = |&method: &Method| {
            let extraction = ExtractionParams { method, ..params.extraction };
            Pipeline::new(Params { extraction, ..*params }, None)
        };
        Self {
            params: *params,
            methods: methods.to_vec(),
            pipelines: methods.iter().map(pipeline).collect(),
            tallies: vec![Tally::default(); methods.len()],
            measured: BTreeMap::new(),
            truths: BTreeMap::new(),
            frames: 0,
            unpaired: 0,
        }
    }

    fn take_frame(&mut self, frame: &Frame<'_>) -> anyhow::Result<()> {
        let (width, height) = (frame.image.width(), frame.image.height());
        let searched = SearchedRegion::new(self.params.roi, width, height)?;
        let direction = self.params.stripe_direction;
        let length = match direction {
            StripeDirection::Horizontal => width,
            StripeDirection::Vertical => height,
        };
        let mut points = Vec::new();
        for pipeline in &mut self.pipelines {
            let output = pipeline.process(frame, FrameIndex::default(), |_| ())?;
            points.push(by_line(output.centerline, direction, length as usize));
        }
        let measured = MeasuredFrame { searched, points };
        if let Some(truth) = self.truths.remove(&frame.stamp_ns) {
            self.compare(&measured, &truth);
            return Ok(());
        }
        self.measured.insert(frame.stamp_ns, measured);
        if self.measured.len() > MAX_WAITING {
            self.measured.pop_first();
            self.unpaired += 1;
        }
        Ok(())
    }

    fn take_truth(&mut self, truth: &laser_profiler_msgs::Centerline<'_>) {
        let (along, across) = match self.params.stripe_direction {
            StripeDirection::Horizontal => (&truth.u, &truth.v),
            StripeDirection::Vertical => (&truth.v, &truth.u),
        };
        let points = along.iter().zip(across.iter()).map(|(&at, &px)| (at as usize, f64::from(px)));
        let points: Vec<_> = points.collect();
        let stamp_ns = truth.header.stamp.to_ns();
        if let Some(measured) = self.measured.remove(&stamp_ns) {
            self.compare(&measured, &points);
            return;
        }
        self.truths.insert(stamp_ns, points);
        // Ground truth of a lost image is useless.
        if self.truths.len() > MAX_WAITING {
            self.truths.pop_first();
        }
    }

    fn compare(&mut self, measured: &MeasuredFrame, truth: &[(usize, f64)]) {
        self.frames += 1;
        let searched = &measured.searched;
        let (along, across) = match self.params.stripe_direction {
            StripeDirection::Horizontal => {
                ((searched.x, searched.width), (searched.y, searched.height))
            }
            StripeDirection::Vertical => {
                ((searched.y, searched.height), (searched.x, searched.width))
            }
        };
        let end = along.0 + along.1;
        let inside = across.0 as f64 - 0.5..(across.0 + across.1) as f64 - 0.5;
        let mut by_line = vec![None; end];
        for &(line, center_px) in truth.iter().filter(|(line, _)| *line < end) {
            by_line[line] = Some(center_px);
        }
        for (tally, points) in self.tallies.iter_mut().zip(&measured.points) {
            for (line, truth_px) in by_line.iter().enumerate().skip(along.0) {
                let point = points.get(line).copied().flatten();
                match *truth_px {
                    Some(center_px) if inside.contains(&center_px) => {
                        tally.add(deviation(point, center_px));
                    }
                    _ if point.is_some() => tally.add_false_point(),
                    _ => {}
                }
            }
        }
    }
}

/// Returns the results as a table.
pub(super) fn section(name: &str, measured: &Measured) -> Section {
    let passed = match (measured.unpaired, measured.read.rejected) {
        (0, 0) => String::new(),
        (unpaired, rejected) => format!(
            " {unpaired} frames without truth and {rejected} frames or damaged places were skipped."
        ),
    };
    let row = |method: &MethodAccuracy| {
        let accuracy = &method.accuracy;
        vec![
            method.method.to_owned(),
            px(accuracy.bias_px),
            px(accuracy.rms_px),
            number(accuracy.median_px, 3),
            number(accuracy.p95_px, 3),
            percent(accuracy.missing),
            percent(accuracy.wrong),
            accuracy.false_points.to_string(),
            percent(accuracy.within_1_sigma),
            percent(accuracy.within_2_sigma),
        ]
    };
    let columns = measured.methods.first().map_or(0, |method| method.accuracy.columns);
    Section {
        title: format!("Against truth: the recording {name}"),
        paragraphs: vec![format!(
            "{} frames with {columns} true centres on {TRUTH_TOPIC}. Median and 95 %: percentiles of the absolute error. Wrong: more than {WRONG_PX} px off. False: points in columns \
             without a true centre.{passed}",
            measured.frames
        )],
        tables: vec![Table {
            caption: String::new(),
            header: [
                "method",
                "bias px",
                "RMS px",
                "median px",
                "95 % px",
                "missing %",
                "wrong %",
                "false",
                "±1σ %",
                "±2σ %",
            ]
            .map(str::to_owned)
            .into(),
            rows: measured.methods.iter().map(row).collect(),
        }],
        plots: Vec::new(),
    }
}
