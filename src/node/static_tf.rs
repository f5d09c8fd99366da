//! The pose of each laser plane in its camera's frame, published on `/tf_static` once and after every change, and written
//! to the results of a replay.

use nalgebra::Isometry3;
use thiserror::Error;

use crate::{
    msg::{convert::tf, qos::QosProfile, tf2_msgs::TFMessage},
    ros::{
        names::NodeNames,
        transport::{Publication, Transport, TransportError},
    },
    scanner::{calibration::Calibration, params::StripeDirection},
};

use super::{
    endpoints::{self, SendError},
    topics::STATIC_TF,
};

/// The reason that a frame cannot be placed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(crate) enum StaticFrameError {
    /// The images have no `frame_id`.
    #[error("images have no frame_id, so the laser plane {child:?} cannot be placed")]
    Empty {
        /// The laser plane's frame.
        child: String,
    },
    /// Parent and child frame are the same.
    #[error(
        "images and laser plane both have frame {0:?}: give the calibration a frame_id of its own"
    )]
    Same(String),
    /// The frame would have two parents.
    #[error(
        "the laser planes of two cameras both have frame {0:?}: give each calibration a frame_id of its own"
    )]
    Taken(String),
}

/// The pose of a laser plane.
#[derive(Clone, Debug, PartialEq)]
struct Place {
    camera_frame: String,
    laser_frame: String,
    camera_from_laser: Isometry3<f64>,
}

/// Names of the frames of an image and of its laser plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneFrames<'a> {
    /// Frame of the camera.
    pub(crate) camera: &'a str,
    /// Frame of the laser plane.
    pub(crate) laser: &'a str,
}

/// The publisher of `/tf_static` for all cameras of the node. Every message contains all transforms, because a late
/// subscriber receives only the last message.
pub(crate) struct StaticTf {
    publication: Box<dyn Publication>,
    /// Pose of each camera's laser plane.
    places: Vec<Option<Place>>,
    refused: Vec<Option<StaticFrameError>>,
}

impl StaticTf {
    /// Creates a publisher for `num_cameras` cameras.
    ///
    /// # Errors
    /// The middleware rejects the topic.
    pub(crate) fn start(
        transport: &dyn Transport,
        names: &NodeNames,
        num_cameras: usize,
    ) -> Result<Self, TransportError> {
        let qos = QosProfile::latched(1);
        let publication = endpoints::advertise::<TFMessage<'_>>(transport, names, STATIC_TF, qos)?;
        let (places, refused) = (vec![None; num_cameras], vec![None; num_cameras]);
        Ok(Self { publication, places, refused })
    }

    /// Places the laser plane of a camera; called for every image. Publishes if something changed. Logs the reason
    /// once if a plane cannot be placed; [`refusal`](Self::refusal) returns it.
    ///
    /// # Panics
    /// `camera` is not below the number of cameras.
    ///
    /// # Errors
    /// The middleware rejects the message; the next image tries again.
    pub(crate) fn place(
        &mut self,
        camera: usize,
        frames: PlaneFrames<'_>,
        camera_from_laser: &Isometry3<f64>,
        now_ns: i64,
    ) -> Result<(), SendError> {
        let PlaneFrames { camera: camera_frame, laser: laser_frame } = frames;
        if let Err(error) = self.check(camera, camera_frame, laser_frame) {
            self.refuse(camera, error);
            return Ok(());
        }
        self.refused[camera] = None;
        if self.is_placed(camera, camera_frame, laser_frame, camera_from_laser) {
            return Ok(());
        }
        let place = Place {
            camera_frame: camera_frame.to_owned(),
            laser_frame: laser_frame.to_owned(),
            camera_from_laser: *camera_from_laser,
        };
        let before = self.places[camera].replace(place);
        let sent = self.send(now_ns);
        if sent.is_err() {
            self.places[camera] = before;
        }
        sent
    }

    /// Returns the reason why a camera's laser plane could not be placed for the last image.
    pub(crate) fn refusal(&self, camera: usize) -> Option<&StaticFrameError> {
        self.refused[camera].as_ref()
    }

    fn is_placed(&self, camera: usize, parent: &str, child: &str, pose: &Isometry3<f64>) -> bool {
        self.places[camera].as_ref().is_some_and(|place| {
            place.camera_frame == parent
                && place.laser_frame == child
                && place.camera_from_laser == *pose
        })
    }

    fn check(&self, camera: usize, parent: &str, child: &str) -> Result<(), StaticFrameError> {
        check_names(parent, child)?;
        let mut others = self.places.iter().enumerate().filter(|(other, _)| *other != camera);
        if others.any(|(_, place)| matches!(place, Some(place) if place.laser_frame == child)) {
            return Err(StaticFrameError::Taken(child.to_owned()));
        }
        Ok(())
    }

    fn refuse(&mut self, camera: usize, error: StaticFrameError) {
        let last = &mut self.refused[camera];
        if last.as_ref() != Some(&error) {
            tracing::warn!("/tf_static: {error}");
            *last = Some(error);
        }
    }

    fn send(&mut self, now_ns: i64) -> Result<(), SendError> {
        let places = self.places.iter().flatten();
        let transforms = places
            .map(|place| {
                let (parent, child) = (&place.camera_frame, &place.laser_frame);
                tf::transform(now_ns, parent, child, &place.camera_from_laser)
            })
            .collect();
        endpoints::send(&mut *self.publication, &TFMessage { transforms }, now_ns)
    }
}

fn check_names(parent: &str, child: &str) -> Result<(), StaticFrameError> {
    // Old drivers prefix the name with a slash.
    let parent = parent.trim_start_matches('/');
    if parent.is_empty() {
        return Err(StaticFrameError::Empty { child: child.to_owned() });
    }
    if parent == child.trim_start_matches('/') {
        return Err(StaticFrameError::Same(child.to_owned()));
    }
    Ok(())
}

/// The pose of the laser plane in the results of a replay: written with the first frame, and again if the images' frame
/// changes.
pub(crate) struct RecordedTf {
    laser_frame: String,
    camera_from_laser: Isometry3<f64>,
    /// Frame of the last image.
    camera_frame: Option<String>,
}

impl RecordedTf {
    /// The pose of this calibration's plane; `None` if it has none, as a map from known heights.
    pub(crate) fn new(calibration: &Calibration, direction: StripeDirection) -> Option<Self> {
        Some(Self {
            laser_frame: calibration.frame_id().to_owned(),
            camera_from_laser: calibration.camera_from_laser(direction)?,
            camera_frame: None,
        })
    }

    /// Returns the message to write before the results of an image with that frame, if one is due. Logs the reason if the
    /// plane cannot be placed.
    pub(super) fn due(&mut self, camera_frame: &str, time_ns: i64) -> Option<TFMessage<'_>> {
        if self.camera_frame.as_deref() == Some(camera_frame) {
            return None;
        }
        self.camera_frame = Some(camera_frame.to_owned());
        if let Err(error) = check_names(camera_frame, &self.laser_frame) {
            tracing::warn!("/tf_static: {error}");
            return None;
        }
        let (parent, child) = (self.camera_frame.as_deref()?, &self.laser_frame);
        let transform = tf::transform(time_ns, parent, child, &self.camera_from_laser);
        Some(TFMessage { transforms: vec![transform] })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use nalgebra::Translation3;

    use super::*;
    use crate::{
        msg::cdr,
        ros::{
            loopback::Loopback,
            transport::{Arrival, Fault, Subscription},
        },
    };

    struct Rig {
        network: Loopback,
        names: NodeNames,
        tf: StaticTf,
    }

    impl Rig {
        fn new(num_cameras: usize) -> Self {
            let network = Loopback::default();
            let names = NodeNames::new("laser_profiler", &[]).unwrap();
            let tf = StaticTf::start(&network, &names, num_cameras).unwrap();
            Self { network, names, tf }
        }

        /// Messages as a subscriber receives them: `parent>child z`, joined by commas.
        fn listen(&self) -> (Arc<Mutex<Vec<String>>>, Box<dyn Subscription>) {
            let received = Arc::new(Mutex::new(Vec::new()));
            let kept = Arc::clone(&received);
            let on_arrival = Box::new(move |arrival: Result<Arrival, Fault>| {
                let bytes = arrival.unwrap().data;
                let message: TFMessage<'_> = cdr::decode(&bytes).unwrap();
                let line: Vec<_> = message
                    .transforms
                    .iter()
                    .map(|tf| {
                        let z_m = tf.transform.translation.z;
                        format!("{}>{} {z_m}", tf.header.frame_id, tf.child_frame_id)
                    })
                    .collect();
                kept.lock().unwrap().push(line.join(", "));
            });
            let qos = QosProfile::latched(1);
            let topic =
                endpoints::topic_of::<TFMessage<'_>>(&self.names, "/tf_static", qos).unwrap();
            (received, self.network.subscribe(&topic, 1000, on_arrival).unwrap())
        }

        fn place(&mut self, camera: usize, [image, laser]: [&str; 2], z_m: f64) {
            let frames = PlaneFrames { camera: image, laser };
            let pose = Isometry3::from(Translation3::new(0.0, 0.0, z_m));
            self.tf.place(camera, frames, &pose, 5).unwrap();
        }
    }

    fn take(received: &Mutex<Vec<String>>) -> Vec<String> {
        std::mem::take(&mut received.lock().unwrap())
    }

    #[test]
    fn poses_are_sent_once_and_after_every_change() {
        let mut rig = Rig::new(1);
        let (received, _subscription) = rig.listen();
        for _ in 0..3 {
            rig.place(0, ["optical", "laser"], 0.3);
        }
        assert_eq!(take(&received), ["optical>laser 0.3"]);
        rig.place(0, ["optical", "laser"], 0.4);
        rig.place(0, ["other", "laser"], 0.4);
        assert_eq!(take(&received), ["optical>laser 0.4", "other>laser 0.4"]);
        assert!(rig.tf.refusal(0).is_none());
    }

    #[test]
    fn a_late_subscriber_receives_every_camera() {
        let mut rig = Rig::new(2);
        rig.place(0, ["left", "left_laser"], 0.3);
        rig.place(1, ["right", "right_laser"], 0.5);
        let (received, _subscription) = rig.listen();
        assert_eq!(take(&received), ["left>left_laser 0.3, right>right_laser 0.5"]);
    }

    #[test]
    fn frames_that_would_not_form_a_tree_are_not_sent() {
        let mut rig = Rig::new(2);
        let (received, _subscription) = rig.listen();
        rig.place(0, ["", "laser"], 0.3);
        rig.place(0, ["laser", "laser"], 0.3);
        rig.place(0, ["/laser", "laser"], 0.3);
        assert!(take(&received).is_empty());
        assert!(matches!(rig.tf.refusal(0), Some(StaticFrameError::Same(_))));
        rig.place(0, ["left", "laser"], 0.3);
        rig.place(1, ["right", "laser"], 0.3);
        assert_eq!(take(&received), ["left>laser 0.3"]);
        assert!(rig.tf.refusal(0).is_none());
        assert!(matches!(rig.tf.refusal(1), Some(StaticFrameError::Taken(_))));
        // The reason ends with the fault, even if the pose is still the published one.
        rig.place(0, ["", "laser"], 0.3);
        assert!(matches!(rig.tf.refusal(0), Some(StaticFrameError::Empty { .. })));
        rig.place(0, ["left", "laser"], 0.3);
        assert!(rig.tf.refusal(0).is_none() && take(&received).is_empty());
    }
}
