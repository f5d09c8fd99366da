//! What an image says besides its stripe: its frame, where the laser plane is placed in it, and its `camera_info`.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::Isometry3;

use crate::{
    msg::{cdr, diagnostic_msgs::DiagnosticStatus, sensor_msgs::CameraInfo},
    node::{
        camera_info::{CameraInfos, ImageHeader, Pairing},
        static_tf::StaticTf,
        status::Note,
        worker::live::NowNs,
    },
    ros::transport::OnArrival,
};

/// Where a camera's laser plane is, if it is calibrated.
#[derive(Clone, Debug)]
pub(super) struct LaserPlane {
    /// Its frame.
    pub(super) frame_id: String,
    /// Its place in the camera's frame.
    pub(super) camera_from_laser: Isometry3<f64>,
}

/// Looks at every image of a camera; clones share what they have seen.
#[derive(Clone)]
pub(super) struct Observer {
    camera: usize,
    plane: Option<LaserPlane>,
    tf: Arc<Mutex<StaticTf>>,
    seen: Arc<Mutex<Seen>>,
    now_ns: NowNs,
}

#[derive(Default)]
struct Seen {
    infos: CameraInfos,
    conflict: Option<String>,
    num_malformed: u64,
}

impl Observer {
    pub(super) fn new(
        camera: usize,
        plane: Option<LaserPlane>,
        tf: Arc<Mutex<StaticTf>>,
        now_ns: NowNs,
    ) -> Self {
        Self { camera, plane, tf, seen: Arc::default(), now_ns }
    }

    /// Takes the camera's descriptions.
    pub(super) fn on_info(&self) -> OnArrival {
        let seen = Arc::clone(&self.seen);
        Box::new(move |arrival| {
            let seen = &mut *lock(&seen);
            let Ok(arrival) = arrival else { return seen.num_malformed += 1 };
            match cdr::decode::<CameraInfo<'_>>(&arrival.data) {
                Ok(info) => seen.infos.insert(&info),
                Err(error) => {
                    seen.num_malformed += 1;
                    tracing::debug!("camera_info: {error}");
                }
            }
        })
    }

    /// Looks at an image.
    pub(super) fn on_image(&self, image: &ImageHeader<'_>) {
        if let Some(plane) = &self.plane {
            let frames = (image.frame_id, plane.frame_id.as_str());
            let placed = lock(&self.tf).place(
                self.camera,
                frames,
                &plane.camera_from_laser,
                (self.now_ns)(),
            );
            if let Err(error) = placed {
                tracing::debug!("/tf_static: {error}");
            }
        }
        let seen = &mut *lock(&self.seen);
        match seen.infos.pair(image) {
            Pairing::Matched { calibration_id, is_new } => {
                seen.conflict = None;
                if is_new {
                    tracing::info!("camera_info describes calibration {calibration_id:016x}");
                }
            }
            Pairing::NoneYet => {}
            Pairing::Conflict(conflict) => seen.conflict = Some(conflict.to_string()),
        }
    }

    /// What is odd about the descriptions.
    pub(super) fn notes(&self) -> Vec<Note> {
        let seen = lock(&self.seen);
        let warning = |text| Note { level: DiagnosticStatus::WARN, key: "camera_info", text };
        let malformed = (seen.num_malformed > 0)
            .then(|| warning(format!("{} malformed camera_info messages", seen.num_malformed)));
        seen.conflict.clone().map(warning).into_iter().chain(malformed).collect()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
