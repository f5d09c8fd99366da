//! Finds the `camera_info` of an image: the message with exactly the same stamp. Pure.

pub(crate) mod fit;

use std::collections::VecDeque;

use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::{
    msg::sensor_msgs::CameraInfo,
    scanner::{calibration::Calibration, camera::View},
};
use fit::{Fit, Misfit, fit, is_unknown};

/// Maximum number of messages that wait for their image; more than any camera sends ahead.
const CAPACITY: usize = 32;

/// The reason that an image and its `camera_info` do not belong together.
#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum Conflict {
    /// Their frames differ.
    #[error(
        "camera_info has frame {info:?}, but the image has {image:?}: the driver must give both the same frame_id"
    )]
    Frame {
        /// Frame of the message.
        info: String,
        /// Frame of the image.
        image: String,
    },
    /// Their sizes differ.
    #[error(
        "camera_info describes images of {} x {} pixels, but the image has {} x {}: calibrate at this size, or state binning and roi",
        .info.0, .info.1, .image.0, .image.1
    )]
    Size {
        /// Columns and rows according to the message.
        info: (u32, u32),
        /// Columns and rows of the image.
        image: (u32, u32),
    },
    /// The message is from a camera other than the calibrated one.
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

impl Conflict {
    /// True if metric results would be wrong: true for every conflict except differing frame names.
    pub(crate) const fn is_of_geometry(&self) -> bool {
        !matches!(self, Self::Frame { .. })
    }
}

/// The description of an image's camera.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CameraMatch {
    /// A matching message exists.
    Matched {
        /// Calibration identity: equal for equal calibrations. Shown as sixteen hexadecimal digits.
        calibration_id: u64,
        /// True if the previous image had another calibration.
        is_new: bool,
        /// The part of the sensor that the image shows.
        view: View,
        /// Largest distance between the projections of the described and the calibrated camera, pixels.
        difference_px: f64,
    },
    /// No message with this stamp has arrived (yet).
    NoneYet,
    /// The message contradicts the image.
    Conflict(Conflict),
}

/// The metadata of an image that its description must match.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageHeader<'a> {
    /// Time of acquisition, nanoseconds since the epoch.
    pub(crate) stamp_ns: i64,
    /// Optical frame of the camera.
    pub(crate) frame_id: &'a str,
    /// Columns.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
}

/// The last messages of one camera, by stamp.
#[derive(Debug, Default)]
pub(crate) struct CameraInfos {
    calibration: Option<Calibration>,
    waiting: VecDeque<Described>,
    calibration_id: Option<u64>,
    has_arrived: bool,
}

#[derive(Debug)]
struct Described {
    stamp_ns: i64,
    frame_id: String,
    fit: Result<Fit, Misfit>,
    calibration_id: u64,
}

impl CameraInfos {
    /// Creates an empty buffer that compares messages with `calibration`.
    pub(crate) fn of(calibration: Option<Calibration>) -> Self {
        Self { calibration, ..Self::default() }
    }

    /// Stores a message for its image. Replaces a message with the same stamp, and drops the oldest message if the
    /// buffer is full. A message of zeros describes nothing.
    pub(crate) fn insert(&mut self, info: &CameraInfo<'_>) {
        self.has_arrived = true;
        if is_unknown(info) {
            return;
        }
        let stamp_ns = info.header.stamp.to_ns();
        self.waiting.retain(|waiting| waiting.stamp_ns != stamp_ns);
        if self.waiting.len() == CAPACITY {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Described {
            stamp_ns,
            frame_id: info.header.frame_id.as_ref().to_owned(),
            fit: match &self.calibration {
                Some(calibration) => fit(calibration, info),
                None => fit::view(info).map(|view| Fit { view, difference_px: 0.0 }),
            },
            calibration_id: calibration_id(info),
        });
    }

    /// True if any message has arrived, even one of zeros.
    pub(crate) const fn has_arrived(&self) -> bool {
        self.has_arrived
    }

    /// Finds the message of an image. Keeps the message, because an image may be repeated.
    pub(crate) fn pair(&mut self, image: &ImageHeader<'_>) -> CameraMatch {
        match self.waiting.iter().position(|info| info.stamp_ns == image.stamp_ns) {
            Some(place) => self.compare(place, image),
            None => CameraMatch::NoneYet,
        }
    }

    /// Like [`pair`](Self::pair), but falls back to the last message received if none has the image's stamp: drivers
    /// send it before or after the image.
    pub(crate) fn pair_or_last(&mut self, image: &ImageHeader<'_>) -> CameraMatch {
        match (self.pair(image), self.waiting.len().checked_sub(1)) {
            (CameraMatch::NoneYet, Some(last)) => self.compare(last, image),
            (pairing, _) => pairing,
        }
    }

    fn compare(&mut self, place: usize, image: &ImageHeader<'_>) -> CameraMatch {
        let info = &self.waiting[place];
        if info.frame_id != image.frame_id {
            let (info, image) = (info.frame_id.clone(), image.frame_id.to_owned());
            return CameraMatch::Conflict(Conflict::Frame { info, image });
        }
        let Fit { view, difference_px } = match &info.fit {
            Ok(fit) => *fit,
            Err(misfit) => return CameraMatch::Conflict(Conflict::Misfit(misfit.clone())),
        };
        let (size, described) = ((image.width, image.height), view.size_px.into());
        if described != size {
            return CameraMatch::Conflict(Conflict::Size { info: described, image: size });
        }
        let calibration_id = info.calibration_id;
        let is_new = self.calibration_id.replace(calibration_id) != Some(calibration_id);
        CameraMatch::Matched { calibration_id, is_new, view, difference_px }
    }
}

/// First 64 bits of the SHA-256 over all values that affect the projection of a point.
fn calibration_id(info: &CameraInfo<'_>) -> u64 {
    let roi = &info.roi;
    let sizes = [
        info.width,
        info.height,
        info.binning_x.max(1),
        info.binning_y.max(1),
        roi.x_offset,
        roi.y_offset,
        roi.width,
        roi.height,
    ];
    let mut hash = Sha256::new();
    hash.update(info.distortion_model.as_bytes());
    hash.update([0]);
    for size in sizes {
        hash.update(size.to_le_bytes());
    }
    hash.update((info.d.len() as u64).to_le_bytes());
    for value in info.d.iter().chain(&info.k).chain(&info.r).chain(&info.p) {
        hash.update(value.to_le_bytes());
    }
    let digest = hash.finalize();
    digest[..8].iter().fold(0, |id, byte| id << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::{builtin_interfaces::Time, sensor_msgs::RegionOfInterest, std_msgs::Header};

    fn info(stamp_ns: i64) -> CameraInfo<'static> {
        CameraInfo {
            header: Header { stamp: Time::from_ns(stamp_ns), frame_id: "camera".into() },
            width: 640,
            height: 480,
            k: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        }
    }

    fn image(stamp_ns: i64) -> ImageHeader<'static> {
        ImageHeader { stamp_ns, frame_id: "camera", width: 640, height: 480 }
    }

    fn is_new(pairing: &CameraMatch) -> bool {
        matches!(pairing, CameraMatch::Matched { is_new: true, .. })
    }

    #[test]
    fn only_equal_stamps_match() {
        let mut infos = CameraInfos::default();
        assert_eq!(infos.pair(&image(7)), CameraMatch::NoneYet);
        infos.insert(&info(7));
        assert!(is_new(&infos.pair(&image(7))));
        assert_eq!(infos.pair(&image(8)), CameraMatch::NoneYet);
        // The same image twice; order does not matter.
        infos.insert(&info(9));
        infos.insert(&info(8));
        for stamp_ns in [8, 7, 9] {
            let pairing = infos.pair(&image(stamp_ns));
            assert!(matches!(pairing, CameraMatch::Matched { is_new: false, .. }), "{pairing:?}");
        }
    }

    #[test]
    fn another_frame_or_size_is_a_conflict_with_its_reason() {
        let mut infos = CameraInfos::default();
        infos.insert(&info(7));
        let CameraMatch::Conflict(conflict) =
            infos.pair(&ImageHeader { frame_id: "left", ..image(7) })
        else {
            panic!("other frame");
        };
        assert!(conflict.to_string().contains(r#"frame "camera", but the image has "left""#));
        let CameraMatch::Conflict(conflict) = infos.pair(&ImageHeader { width: 320, ..image(7) })
        else {
            panic!("other size");
        };
        assert!(conflict.to_string().contains("640 x 480 pixels, but the image has 320 x 480"));
    }

    #[test]
    fn binning_and_roi_determine_the_image_size() {
        let roi = RegionOfInterest { width: 400, height: 100, ..RegionOfInterest::default() };
        let mut infos = CameraInfos::default();
        infos.insert(&CameraInfo { binning_x: 2, binning_y: 2, roi, ..info(7) });
        let pairing = infos.pair(&ImageHeader { width: 200, height: 50, ..image(7) });
        assert!(is_new(&pairing), "{pairing:?}");
    }

    #[test]
    fn any_other_value_is_a_new_calibration_once() {
        let mut infos = CameraInfos::default();
        let mut stamp_ns = 0;
        let mut pair = |info: CameraInfo<'static>| {
            stamp_ns += 1;
            let stamp = Time::from_ns(stamp_ns);
            infos.insert(&CameraInfo { header: Header { stamp, ..info.header }, ..info });
            is_new(&infos.pair(&image(stamp_ns)))
        };
        assert!(pair(info(0)) && !pair(info(0)));
        let mut other = info(0);
        other.k[0] = 501.0;
        assert!(pair(other.clone()) && !pair(other));
        assert!(pair(CameraInfo { d: vec![0.1], ..info(0) }));
        assert!(pair(CameraInfo { distortion_model: "plumb_bob".into(), ..info(0) }));
        assert!(pair(info(0)));
        // Binning 0 means binning 1.
        assert!(!pair(CameraInfo { binning_x: 1, binning_y: 1, ..info(0) }));
    }

    #[test]
    fn an_image_without_a_message_of_its_stamp_uses_the_last_one() {
        let mut infos = CameraInfos::default();
        assert_eq!(infos.pair_or_last(&image(7)), CameraMatch::NoneYet);
        infos.insert(&info(6));
        assert!(is_new(&infos.pair_or_last(&image(7))));
        let other = CameraInfo { width: 320, ..info(8) };
        infos.insert(&other);
        assert!(
            matches!(infos.pair_or_last(&image(7)), CameraMatch::Conflict(_)),
            "until its own message arrives"
        );
        infos.insert(&info(7));
        assert!(!is_new(&infos.pair_or_last(&image(7))));
    }

    #[test]
    fn zeros_describe_nothing() {
        let mut infos = CameraInfos::default();
        assert!(!infos.has_arrived());
        infos.insert(&CameraInfo { width: 0, height: 0, k: [0.0; 9], ..info(7) });
        assert!(infos.has_arrived());
        assert_eq!(infos.pair_or_last(&image(7)), CameraMatch::NoneYet);
        infos.insert(&info(8));
        infos.insert(&CameraInfo { width: 0, height: 0, k: [0.0; 9], ..info(9) });
        assert!(is_new(&infos.pair_or_last(&image(9))), "the last one that describes a camera");
    }

    #[test]
    fn messages_without_an_image_are_bounded() {
        let mut infos = CameraInfos::default();
        for stamp_ns in 0..1000 {
            infos.insert(&info(stamp_ns));
            infos.insert(&info(stamp_ns));
        }
        assert_eq!(infos.waiting.len(), CAPACITY);
        assert_eq!(infos.pair(&image(0)), CameraMatch::NoneYet);
        assert!(is_new(&infos.pair(&image(1000 - CAPACITY as i64))));
    }
}
