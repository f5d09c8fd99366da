//! What the pipeline said, as messages on their topics.

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
        height_map::HeightMap,
        image::Image,
        params::{MotionSource, Params, RegionOfInterest},
        pipeline::{FrameIndex, Output as Measurement},
        scan::{Point, Slice},
    },
};

use super::{
    order::{NumberSource, Place},
    publisher::{Halt, Publisher},
    topics::Output,
};

/// A measured frame and where it came from.
pub(super) struct Measured<'a> {
    pub(super) header: &'a Header<'a>,
    pub(super) image: Image<'a>,
    pub(super) place: Place,
    pub(super) index: FrameIndex,
    pub(super) output: Measurement<'a>,
    /// Log time of the input, and so of the results, nanoseconds since the epoch.
    pub(super) time_ns: i64,
}

/// What every result repeats, and buffers for those that need one.
pub struct Results {
    roi: RegionOfInterest,
    method: String,
    position_source: u8,
    frame_id: String,
    calibration_id: String,
    dense: Vec<Point>,
    annotations: ImageAnnotations<'static>,
}

impl Results {
    /// Results of a measurement with these values; `parameters_sha256` is the hash of the camera's parameters.
    pub fn new(
        params: &Params,
        calibration: Option<&Calibration>,
        parameters_sha256: &str,
    ) -> Self {
        let hash = parameters_sha256.get(..8).unwrap_or(parameters_sha256);
        Self {
            roi: params.roi,
            method: format!("{}/{hash}", params.extraction.method.name()),
            position_source: match params.motion.source {
                MotionSource::None => FrameTrace::SOURCE_NONE,
                MotionSource::Constant => FrameTrace::SOURCE_HOST,
            },
            frame_id: calibration.map(|c| c.frame_id().to_owned()).unwrap_or_default(),
            calibration_id: calibration.map(Calibration::id).unwrap_or_default(),
            dense: Vec::new(),
            annotations: ImageAnnotations::default(),
        }
    }

    /// Publishes what one frame gave; first what it completed, which is older.
    pub(super) fn publish_frame(
        &mut self,
        measured: &Measured<'_>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        let &Measured { header, image, output, time_ns, .. } = measured;
        self.publish_completed((output.slice, output.height_map), time_ns, out)?;
        let source = results::FrameSource {
            header: header.borrowed(),
            trace: self.trace(measured),
            image_width: image.width(),
            image_height: image.height(),
            roi: self.roi,
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
        (slice, height_map): (Option<&Slice>, Option<&HeightMap>),
        time_ns: i64,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        if let Some(slice) = slice {
            out.publish(Output::Points, time_ns, &cloud::organised(&self.frame_id, slice))?;
            let dense = cloud::dense(&self.frame_id, slice, &mut self.dense);
            out.publish(Output::PointsDense, time_ns, &dense)?;
            let info = results::slice_info(&self.frame_id, "", slice);
            out.publish(Output::SliceInfo, time_ns, &info)?;
        }
        if let Some(map) = height_map {
            out.publish(Output::HeightMap, time_ns, &cloud::height_map(&self.frame_id, map))?;
        }
        Ok(())
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
            position: output.position_m,
            encoder_source: self.position_source,
            receive_stamp: Time::from_ns(*time_ns),
            ..FrameTrace::default()
        }
    }
}
