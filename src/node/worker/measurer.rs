//! The instrument of a worker: it locates, measures and publishes one frame at a time, and ends scans.

use std::time::Instant;

use super::{
    frame::NotMeasured,
    ledger::{Gap, Rejection},
    missing_stripe::{Explainer, NoStripe},
};
use crate::{
    msg::std_msgs::Header,
    node::{
        order::Place,
        positions::Positions,
        publisher::{PublishError, Publisher},
        results::{Measured, Results},
        statistics::StageTimes,
    },
    scanner::{
        auto_channel::ChannelChoice,
        axis::AxisTravel,
        exposure_pair::ExposurePairing,
        frame_index::FrameIndex,
        image,
        motion::Position,
        params::MotionParams,
        pipeline::{Pipeline, Stage},
        profile::Profile,
        stripe::{SigmaParts, flag},
    },
};

/// A decoded frame with its place in the stream.
pub(super) struct Job<'a> {
    /// Start of its decoding.
    pub(super) started: Instant,
    pub(super) header: &'a Header<'a>,
    pub(super) image: image::Image<'a>,
    pub(super) place: Place,
    pub(super) index: FrameIndex,
    /// Log time, nanoseconds since the epoch.
    pub(super) time_ns: i64,
}

/// The figures of a measured frame that are counted.
pub(super) struct Outcome {
    pub(super) stamp_ns: i64,
    pub(super) num_points: u64,
    /// Points with a sample at full scale.
    pub(super) num_saturated: u64,
    /// The channel that `channel: auto` stands for.
    pub(super) channel_choice: Option<ChannelChoice>,
    /// `Some` if the frame has no stripe.
    pub(super) no_stripe: Option<NoStripe>,
    /// Shares of noise and texture in the uncertainty; `None` without points.
    pub(super) sigma_parts: Option<SigmaParts>,
    pub(super) has_slice: bool,
    pub(super) pairing: Option<ExposurePairing>,
    pub(super) share_above_threshold: Option<f64>,
    pub(super) position: Option<Position>,
    /// True if the profile lies where the one before it in the scan lies.
    pub(super) stands: bool,
    /// True if positions are measured rather than assumed.
    pub(super) measures_positions: bool,
    /// Points of the profile outside the calibrated volume.
    pub(super) num_outside_calibration: u64,
}

/// Pipeline, positions, results and their buffers.
pub(super) struct Measurer {
    pub(super) pipeline: Pipeline,
    pub(super) results: Results,
    /// Positions of frames; `None` if they are not measured.
    pub(super) positions: Option<Positions>,
    /// Buffer for the pixels of a decoded compressed image.
    pub(super) pixels: Vec<u8>,
    /// Distance of the last measured frame from the first of its scan.
    pub(super) travelled: Option<AxisTravel>,
    pub(super) explainer: Explainer,
    stages: StageTimes,
}

impl Measurer {
    pub(super) fn new(pipeline: Pipeline, results: Results) -> Self {
        Self {
            pipeline,
            results,
            positions: None,
            pixels: Vec::new(),
            travelled: None,
            explainer: Explainer::default(),
            stages: StageTimes::default(),
        }
    }

    /// Durations of all stages so far.
    pub(super) fn into_stages(self) -> StageTimes {
        self.stages
    }

    /// Measures a frame and publishes its results.
    ///
    /// # Errors
    /// The frame contradicts the parameters, or nothing more can be published.
    pub(super) fn measure(
        &mut self,
        job: &Job<'_>,
        out: &mut Publisher<'_>,
    ) -> Result<Outcome, NotMeasured> {
        let &Job { started, header, image, place, index, time_ns } = job;
        let stamp_ns = header.stamp.to_ns();
        let position = match &mut self.positions {
            None => self.pipeline.expected_position(place.frame_number, stamp_ns),
            Some(positions) => positions.at(stamp_ns, time_ns),
        };
        let mut clock = StageClock { last: started, stages: &mut self.stages };
        let frame = image::Frame { stamp_ns, image };
        let output = self
            .pipeline
            .process_at(&frame, index, position, |stage| clock.tick(stage))
            .map_err(Rejection::from)?;
        self.travelled = output.travelled;
        let stripe_share = output.stripe_share;
        let mut outcome = Outcome {
            stamp_ns,
            num_points: output.centerline.len() as u64,
            num_saturated: output.centerline.num_flagged(flag::SATURATED) as u64,
            channel_choice: output.channel_choice,
            no_stripe: None,
            sigma_parts: output.sigma_parts,
            has_slice: output.slice.is_some(),
            pairing: output.pairing,
            share_above_threshold: output.share_above_threshold,
            position: output.position,
            stands: output.stands,
            measures_positions: self.positions.is_some(),
            num_outside_calibration: output.profile.map_or(0, Profile::num_outside_calibration),
        };
        let measured = Measured { header, image, place, index, output, time_ns };
        self.results.publish_frame(&measured, out)?;
        self.stages.encode.record(out.take_encoding_time());
        outcome.no_stripe = self.explainer.note_frame(stripe_share, &self.pipeline, &image);
        Ok(outcome)
    }

    /// Replaces the motion parameters. Call only after the frames that wait under the old ones are released.
    pub(super) fn reconfigure_positions(&mut self, params: &MotionParams) {
        if let Some(positions) = &mut self.positions {
            positions.reconfigure(params);
        }
    }

    /// Ends the open scan, and publishes its last slice and its height map. Returns true if there was such a slice.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub(super) fn end_scan(
        &mut self,
        gap: Gap,
        time_ns: i64,
        out: &mut Publisher<'_>,
    ) -> Result<bool, PublishError> {
        let completed = self.pipeline.finish(gap.missing, gap.rejected);
        let has_slice = completed.slice.is_some();
        self.results.publish_completed(completed, time_ns, out)?;
        Ok(has_slice)
    }
}

/// Records the duration of each stage.
struct StageClock<'a> {
    last: Instant,
    stages: &'a mut StageTimes,
}

impl StageClock<'_> {
    fn tick(&mut self, stage: Stage) {
        let now = Instant::now();
        let histogram = match stage {
            Stage::Decode => &mut self.stages.decode,
            Stage::Extract => &mut self.stages.extract,
            Stage::Triangulate => &mut self.stages.triangulate,
        };
        histogram.record(now - self.last);
        self.last = now;
    }
}
