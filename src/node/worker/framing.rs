//! `camera_info` in the worker: images of another camera are rejected, images of a region of the sensor are measured as
//! such, and a changed description starts a new scan.

use super::{Publisher, Worker, frame::NotMeasured, ledger::Rejection};
use crate::{
    bag::RawMessage,
    msg::{cdr, sensor_msgs::CameraInfo},
    node::camera_info::{CameraInfos, CameraMatch, ImageHeader},
    scanner::{calibration::Calibration, camera::View},
};

/// Smallest difference of two calibrations that causes a warning, pixels.
const WARN_ABOVE_PX: f64 = 0.1;

/// The calibration and the descriptions of a camera.
#[derive(Debug, Default)]
pub(super) struct Framing {
    /// Calibration of the whole sensor; `None`: results are not metric, and any description is accepted.
    calibration: Option<Calibration>,
    /// Recorded descriptions, in a replay. On a network, an observer keeps them.
    infos: CameraInfos,
    /// Topic of the recorded descriptions.
    pub(super) topic: Option<String>,
    /// Calibration and view of the last image.
    current: Option<(u64, View)>,
}

impl Framing {
    pub(super) fn new(calibration: Option<Calibration>, topic: Option<String>) -> Self {
        // Calibrations by formula 6 have no image size to compare.
        let calibration = calibration.filter(|calibration| calibration.image_size_px().is_some());
        let infos = CameraInfos::of(calibration.clone());
        Self { calibration, infos, topic, current: None }
    }

    /// Forgets the descriptions of the last recording. Returns the calibration of the whole sensor if a description has
    /// changed it.
    pub(super) fn restart(&mut self) -> Option<Calibration> {
        self.infos = CameraInfos::of(self.calibration.clone());
        self.current.take().and_then(|_| self.calibration.clone())
    }

    /// Keeps a recorded description for its image.
    pub(super) fn take(&mut self, message: &RawMessage) {
        match cdr::decode::<CameraInfo<'_>>(&message.data) {
            Ok(info) => self.infos.insert(&info),
            Err(error) => tracing::warn!("camera_info at {} ns: {error}", message.log_time_ns),
        }
    }

    /// True if images are compared with descriptions.
    pub(super) const fn is_calibrated(&self) -> bool {
        self.calibration.is_some()
    }

    /// True if a recorded description has arrived.
    pub(super) const fn is_described(&self) -> bool {
        self.infos.has_arrived()
    }

    /// Finds the description of a recorded image.
    pub(super) fn pair(&mut self, image: &ImageHeader<'_>) -> CameraMatch {
        self.infos.pair_or_last(image)
    }
}

impl Worker {
    /// Calibrates the pipeline for the view that `camera_info` describes, before the image is measured.
    ///
    /// # Errors
    /// The image is of another camera, or nothing more can be published.
    pub(super) fn apply_camera_info(
        &mut self,
        camera: CameraMatch,
        out: &mut Publisher<'_>,
    ) -> Result<(), NotMeasured> {
        let Some(calibration) = &self.framing.calibration else { return Ok(()) };
        let (calibration_id, view, difference_px) = match camera {
            CameraMatch::Matched { calibration_id, view, difference_px, .. } => {
                (calibration_id, view, difference_px)
            }
            CameraMatch::Conflict(conflict) if conflict.is_of_geometry() => {
                return Err(Rejection::from(conflict).into());
            }
            CameraMatch::Conflict(_) | CameraMatch::NoneYet => return Ok(()),
        };
        let before = self.framing.current.replace((calibration_id, view));
        if before == Some((calibration_id, view)) {
            return Ok(());
        }
        let calibration = calibration.seen_through(&view);
        if difference_px > WARN_ABOVE_PX {
            tracing::warn!(
                "K and D of camera_info project points up to {difference_px:.1} px from where the calibration does: the \
                 calibration is used; the driver has a different calibration of this camera"
            );
        }
        if before.is_some() {
            tracing::warn!(
                "camera_info changes within the stream: now {} x {} pixels from ({}, {}), binned {} x {}; starting a new scan",
                view.size_px[0],
                view.size_px[1],
                view.offset_px[0],
                view.offset_px[1],
                view.binning[0],
                view.binning[1],
            );
            self.end_scan(out)?;
        }
        self.measurer.pipeline.recalibrate(calibration);
        Ok(())
    }
}
