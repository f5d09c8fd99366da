//! Typed parameters of one camera.

use std::path::PathBuf;

use laser_triangulation::{named_enum, parameter_group, parameters::Parameter};

use crate::{
    msg::convert::cloud,
    scanner::{calibration::Calibration, params::Params, scan::MAX_SLICE_POINTS},
};

const MIB: i64 = 1 << 20;

/// Parameters of the node listed among those of the measurement, each with its predecessor; all others come first.
const FOLLOWS: [(&str, &str); 6] = [
    ("extraction.background_file", "extraction.background_window"),
    ("calibration_file", "extraction.shot_gain"),
    ("motion.joint", "motion.velocity"),
    ("motion.part_frame", "motion.exposure_offset"),
    ("motion.sensor_frame", "motion.part_frame"),
    ("points.max_bytes", "slice.profiles"),
];

named_enum! {
    /// Type of the images.
    ImageTransport {
        /// `sensor_msgs/Image`.
        Raw = "raw",
        /// `sensor_msgs/CompressedImage`.
        Compressed = "compressed",
    }
}

parameter_group! {
    /// All parameters that determine the results of one camera.
    #[derive(Clone, Debug, PartialEq)]
    pub struct CameraParams {
        /// Name of the camera; empty for a single camera without a name.
        name: String = String::new() => computed,
        /// Subscribed image topic: raw: image_raw, compressed: image_raw/compressed; if not set, replay uses the topic
        /// in the recording. Lossy compression (JPEG) moves the centreline by some hundredths of a pixel.
        image_transport: ImageTransport = ImageTransport::Raw => ["image_transport"],
        /// True if a file or option sets `image_transport`.
        is_transport_set: bool = false => computed,
        /// Largest accepted size of a decoded image; larger ones are rejected as malformed. Limits the memory against
        /// damaged or hostile input; raise it only for cameras with larger frames.
        max_frame_bytes: u64 = 64 << 20 => ["max_frame_bytes", MIB..=1024 * MIB, "bytes"],
        /// Calibration of camera and laser plane; empty: centrelines only, no metric profiles. A relative path starts
        /// at the parameter file that sets it, or at the working directory if set by -p.
        calibration_file: Option<PathBuf> = None => ["calibration_file"],
        /// PNG for background reference, 8 or 16 bits, with the camera's size and depth, as written by laser_profiler
        /// ambient. A relative path starts at the parameter file that sets it, or at the working directory if set by
        /// -p.
        background_file: Option<PathBuf> = None => ["extraction.background_file"],
        /// Largest point cloud message: a slice ends before it exceeds this size, but contains at least one profile. 0:
        /// the largest size that reaches every peer with default settings, 96 KiB on DDS and unlimited otherwise.
        points_max_bytes: Option<u64> = None => ["points.max_bytes", 0..=1024 * MIB, "bytes"],
        /// Names in the messages of the motion.
        moved: Moved = Moved::default() => group,
        /// The measurement, without a limit on the points of a slice: see [`scanner_for`](Self::scanner_for).
        scanner: Params = Params::default() => computed,
    }
}

parameter_group! {
    /// Names in the messages of the motion.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Moved {
        /// For joint_state: name of the joint. Empty: the only joint in the messages.
        joint: String = String::new() => ["motion.joint"],
        /// Frame of the point clouds and height maps. For tf: the frame of the scan, such as base_link, required.
        /// Otherwise its name; empty: part if the calibration has an axis or a level, else the laser plane's frame.
        part_frame: String = String::new() => ["motion.part_frame"],
        /// For tf: frame whose pose is looked up. Empty: the frame of the images, the camera's optical frame;
        /// alternatively the laser plane's frame, if it is published.
        sensor_frame: String = String::new() => ["motion.sensor_frame"],
    }
}

impl CameraParams {
    /// Returns the parameters of the measurement and of the node in the order of a parameter file.
    pub(super) fn table() -> Vec<Parameter> {
        let mut rows = Params::parameters();
        for (index, row) in Self::parameters().into_iter().enumerate() {
            let follows = FOLLOWS.iter().find(|(name, _)| *name == row.name);
            let found =
                follows.and_then(|(_, before)| rows.iter().position(|row| row.name == *before));
            rows.insert(found.map_or(index, |place| place + 1), row);
        }
        rows
    }

    /// Returns the parameters of the measurement, with slices whose message in the frame `frame_id` fits into
    /// `points_max_bytes`.
    pub(crate) fn scanner_for(&self, frame_id: &str) -> Params {
        let slice_max_points = match self.points_max_bytes {
            None => MAX_SLICE_POINTS,
            Some(bytes) => {
                cloud::points_within(usize::try_from(bytes).unwrap_or(usize::MAX), frame_id)
            }
        };
        Params { slice_max_points, ..self.scanner }
    }

    /// Returns the frame of point clouds and height maps; empty without a calibration.
    pub(crate) fn part_frame(&self, calibration: Option<&Calibration>) -> String {
        let Some(calibration) = calibration else { return String::new() };
        let is_laser_plane = calibration.axis().is_none() && calibration.part().is_none();
        match self.moved.part_frame.as_str() {
            "" if is_laser_plane => calibration.frame_id().to_owned(),
            "" => "part".to_owned(),
            chosen => chosen.to_owned(),
        }
    }

    /// Returns true if measured poses are those of the laser plane.
    pub(crate) fn tracks_laser(&self, calibration: Option<&Calibration>) -> bool {
        let frame = calibration.map_or("", Calibration::frame_id);
        !frame.is_empty() && self.moved.sensor_frame == frame
    }

    /// Returns the type of the images if a file or option sets it; otherwise the recording determines it.
    pub(crate) fn chosen_transport(&self) -> Option<ImageTransport> {
        self.is_transport_set.then_some(self.image_transport)
    }

    /// Returns the full name of a parameter of this camera.
    pub(crate) fn full_name(&self, name: &str) -> String {
        if self.name.is_empty() { name.to_owned() } else { format!("{}.{name}", self.name) }
    }
}
