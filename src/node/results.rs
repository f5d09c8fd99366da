//! Converts the output of the pipeline to messages and publishes them.

use crate::{
    msg::{
        builtin_interfaces::Time,
        convert::{annotations, cloud, results},
        foxglove_msgs::ImageAnnotations,
        laser_profiler_msgs::FrameTrace,
        std_msgs::Header,
    },
    scanner::{
        calibration::Calibration,
        frame_index::FrameIndex,
        image::Image,
        motion::{Position, doubt},
        params::{MotionSource, Params, RegionOfInterest, StripeDirection},
        pipeline::Output as Measurement,
        scan::{Completed, Point},
    },
};

use super::{
    order::{NumberSource, Place},
    publisher::{PublishError, Publisher},
    static_tf::RecordedTf,
    topics::Output,
};

/// A measured frame with its origin.
pub(super) struct Measured<'a> {
    pub(super) header: &'a Header<'a>,
    pub(super) image: Image<'a>,
    pub(super) place: Place,
    pub(super) index: FrameIndex,
    pub(super) output: Measurement<'a>,
    /// Log time of the input and of its results, nanoseconds since the epoch.
    pub(super) time_ns: i64,
}

/// Values repeated in every result, and buffers.
pub(crate) struct Results {
    roi: RegionOfInterest,
    stripe_direction: StripeDirection,
    method: String,
    motion_source: MotionSource,
    /// Frame of the profiles.
    frame_id: String,
    /// Frame of the scan.
    part_frame: String,
    calibration_id: String,
    part_id: String,
    /// Pose of the laser plane, in a replay.
    static_tf: Option<RecordedTf>,
    dense: Vec<Point>,
    annotations: ImageAnnotations<'static>,
}

impl Results {
    /// Creates a converter for these values; `parameters_sha256` is the hash of the camera's parameters.
    pub(crate) fn new(
        params: &Params,
        calibration: Option<&Calibration>,
        parameters_sha256: &str,
    ) -> Self {
        let mut results = Self {
            roi: params.roi,
            stripe_direction: params.stripe_direction,
            method: String::new(),
            motion_source: params.motion.source,
            frame_id: calibration.map(|c| c.frame_id().to_owned()).unwrap_or_default(),
            part_frame: calibration.map(|c| c.frame_id().to_owned()).unwrap_or_default(),
            calibration_id: calibration.map(Calibration::id).unwrap_or_default(),
            part_id: String::new(),
            static_tf: None,
            dense: Vec::new(),
            annotations: ImageAnnotations::default(),
        };
        results.reconfigure(params, parameters_sha256);
        results
    }

    /// Replaces the values for subsequent results.
    pub(crate) fn reconfigure(&mut self, params: &Params, parameters_sha256: &str) {
        let hash = parameters_sha256.get(..8).unwrap_or(parameters_sha256);
        self.roi = params.roi;
        self.stripe_direction = params.stripe_direction;
        self.method = format!("{}/{hash}", params.extraction.method.name());
        self.motion_source = params.motion.source;
    }

    /// Sets the frame of slices and height maps.
    #[must_use]
    pub(crate) fn with_part_frame(self, part_frame: String) -> Self {
        Self { part_frame, ..self }
    }

    /// Writes the pose of the laser plane with the results.
    pub(crate) fn set_static_tf(&mut self, static_tf: Option<RecordedTf>) {
        self.static_tf = static_tf;
    }

    /// Sets the part identity of subsequent slices.
    pub(crate) fn set_part_id(&mut self, part_id: String) {
        self.part_id = part_id;
    }

    /// Publishes the results of one frame, after the older slice that it completed.
    pub(super) fn publish_frame(
        &mut self,
        measured: &Measured<'_>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let &Measured { header, image, output, time_ns, .. } = measured;
        let static_tf = self.static_tf.as_mut();
        if let Some(pose) = static_tf.and_then(|tf| tf.due(&header.frame_id, time_ns)) {
            out.publish(Output::StaticTf, time_ns, &pose)?;
        }
        let completed = Completed { slice: output.slice, height_map: output.height_map };
        self.publish_completed(completed, time_ns, out)?;
        let source = results::FrameSource {
            header: header.borrowed(),
            trace: self.trace(measured),
            image_width: image.width(),
            image_height: image.height(),
            roi: self.roi,
            stripe_direction: self.stripe_direction,
        };
        let centerline = results::centerline(&source, &self.method, output.centerline);
        out.publish(Output::Centerline, time_ns, &centerline)?;
        annotations::draw(header.stamp, output.centerline, &mut self.annotations);
        out.publish(Output::Annotations, time_ns, &self.annotations)?;
        if let Some(profile) = output.profile {
            let profile = results::profile(&source, &self.frame_id, &self.calibration_id, profile);
            out.publish(Output::Profile, time_ns, &profile)?;
        }
        Ok(())
    }

    /// Publishes a slice with its companions, and a height map.
    pub(super) fn publish_completed(
        &mut self,
        completed: Completed<'_>,
        time_ns: i64,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let Completed { slice, height_map } = completed;
        if let Some(slice) = slice {
            out.publish(Output::Points, time_ns, &cloud::organised(&self.part_frame, slice))?;
            let dense = cloud::dense(&self.part_frame, slice, &mut self.dense);
            out.publish(Output::PointsDense, time_ns, &dense)?;
            let info = results::slice_info(&self.part_frame, &self.part_id, slice);
            out.publish(Output::SliceInfo, time_ns, &info)?;
        }
        if let Some(map) = height_map {
            out.publish(Output::HeightMap, time_ns, &cloud::height_map(&self.part_frame, map))?;
        }
        Ok(())
    }

    fn position_source(&self, position: Option<Position>) -> u8 {
        match (self.motion_source, position) {
            (MotionSource::None, _) | (_, None) => FrameTrace::SOURCE_NONE,
            (_, Some(position)) if position.is_exact => FrameTrace::SOURCE_DEVICE,
            (_, Some(_)) => FrameTrace::SOURCE_HOST,
        }
    }

    fn trace(&self, measured: &Measured<'_>) -> FrameTrace {
        let Measured { place, index, output, time_ns, .. } = measured;
        FrameTrace {
            frame_number: index.frame_number,
            frame_number_source: match place.source {
                NumberSource::Transport => FrameTrace::SOURCE_TRANSPORT,
                NumberSource::Host => FrameTrace::SOURCE_HOST,
            },
            frames_missing: index.frames_missing,
            frames_missing_valid: place.missing.is_some(),
            encoder: output.position.map_or(0, |position| position.counts),
            position: output.position.map_or(0.0, |position| position.value.0),
            encoder_source: self.position_source(output.position),
            encoder_status: output.position.map_or(doubt::STALE, |position| position.doubts),
            receive_stamp: Time::from_ns(*time_ns),
            ..FrameTrace::default()
        }
    }
}
