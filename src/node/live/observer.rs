//! The metadata of images: their frame, the pose of the laser plane in it, and their `camera_info`.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::{
    msg::{cdr, diagnostic_msgs::DiagnosticStatus, sensor_msgs::CameraInfo},
    node::{
        camera_info::{CameraInfos, CameraMatch, ImageHeader},
        clock::RosClock,
        static_tf::{PlaneFrames, StaticTf},
        status::Note,
        worker::online::Describe,
    },
    ros::transport::OnArrival,
    scanner::{calibration::Calibration, params::StripeDirection},
};

/// Observes every image of a camera; clones share one state.
#[derive(Clone)]
pub(super) struct Observer {
    camera: usize,
    calibration: Option<Calibration>,
    tf: Arc<Mutex<StaticTf>>,
    seen: Arc<Mutex<Seen>>,
    clock: RosClock,
}

struct Seen {
    infos: CameraInfos,
    /// The last image: its `camera_info` may arrive later.
    image: OwnedHeader,
    conflict: Option<String>,
    num_malformed: u64,
    /// Direction of the stripe, which determines the pose of the laser plane.
    direction: StripeDirection,
}

#[derive(Default)]
struct OwnedHeader {
    stamp_ns: i64,
    frame_id: String,
    size_px: (u32, u32),
}

impl Observer {
    pub(super) fn new(
        camera: usize,
        calibration: Option<Calibration>,
        direction: StripeDirection,
        tf: Arc<Mutex<StaticTf>>,
        clock: RosClock,
    ) -> Self {
        let seen = Seen {
            infos: CameraInfos::of(calibration.clone()),
            image: OwnedHeader::default(),
            conflict: None,
            num_malformed: 0,
            direction,
        };
        Self { camera, calibration, tf, seen: Arc::new(Mutex::new(seen)), clock }
    }

    /// Publishes the pose of the laser plane for stripes of `direction` from now on.
    pub(super) fn set_direction(&self, direction: StripeDirection) {
        lock(&self.seen).direction = direction;
    }

    /// Returns a callback for `camera_info` messages.
    pub(super) fn on_info(&self) -> OnArrival {
        let seen = Arc::clone(&self.seen);
        Box::new(move |arrival| {
            let seen = &mut *lock(&seen);
            let Ok(arrival) = arrival else { return seen.num_malformed += 1 };
            match cdr::decode::<CameraInfo<'_>>(&arrival.data) {
                Ok(info) => {
                    seen.infos.insert(&info);
                    if info.header.stamp.to_ns() == seen.image.stamp_ns {
                        seen.pair();
                    }
                }
                Err(error) => {
                    seen.num_malformed += 1;
                    tracing::debug!("camera_info: {error}");
                }
            }
        })
    }

    fn place(&self, calibration: &Calibration, direction: StripeDirection, camera_frame: &str) {
        let frames = PlaneFrames { camera: camera_frame, laser: calibration.frame_id() };
        // A map from known heights has no camera pose.
        let Some(camera_from_laser) = calibration.camera_from_laser(direction) else { return };
        let now_ns = self.clock.now_ns();
        let placed = lock(&self.tf).place(self.camera, frames, &camera_from_laser, now_ns);
        if let Err(error) = placed {
            tracing::debug!("/tf_static: {error}");
        }
    }

    /// Warnings about the descriptions, the pose of the laser plane and the clock.
    pub(super) fn notes(&self) -> Vec<Note> {
        let seen = lock(&self.seen);
        let warning = |key, text| Note { level: DiagnosticStatus::WARN, key, text };
        let malformed =
            |num, topic| (num > 0).then(|| format!("malformed {topic} messages: {num}"));
        let not_placed = lock(&self.tf).refusal(self.camera).map(ToString::to_string);
        [
            seen.conflict.clone().map(|text| warning("camera_info", text)),
            malformed(seen.num_malformed, "camera_info").map(|text| warning("camera_info", text)),
            not_placed.map(|text| warning("tf_static", text)),
            malformed(self.clock.num_bad(), "/clock").map(|text| warning("clock", text)),
            (!self.clock.is_known())
                .then(|| warning("clock", "use_sim_time is set, but no /clock has arrived".into())),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

impl Describe for Observer {
    fn observe(&self, image: &ImageHeader<'_>) -> CameraMatch {
        let seen = &mut *lock(&self.seen);
        seen.image.stamp_ns = image.stamp_ns;
        image.frame_id.clone_into(&mut seen.image.frame_id);
        seen.image.size_px = (image.width, image.height);
        seen.pair();
        if let Some(calibration) = &self.calibration {
            self.place(calibration, seen.direction, image.frame_id);
        }
        seen.infos.pair_or_last(image)
    }

    fn is_described(&self) -> bool {
        lock(&self.seen).infos.has_arrived()
    }
}

impl Seen {
    /// Compares the last image with its description, once that has arrived.
    fn pair(&mut self) {
        let OwnedHeader { stamp_ns, frame_id, size_px: (width, height) } = &self.image;
        let (stamp_ns, width, height) = (*stamp_ns, *width, *height);
        match self.infos.pair(&ImageHeader { stamp_ns, frame_id, width, height }) {
            CameraMatch::Matched { calibration_id, is_new, .. } => {
                self.conflict = None;
                if is_new {
                    tracing::info!("camera_info describes calibration {calibration_id:016x}");
                }
            }
            CameraMatch::NoneYet => {}
            CameraMatch::Conflict(conflict) => self.conflict = Some(conflict.to_string()),
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
