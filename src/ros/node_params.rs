//! Typed parameters of the node, built from values that the table has checked.

use std::path::PathBuf;

use laser_triangulation::{named_enum, parameter_group};

pub(crate) use super::camera_params::ImageTransport;
use super::{camera_params::CameraParams, qos_overrides::QosOverrides};

const MIB: i64 = 1 << 20;
const MAX_SECONDS: i64 = 366 * 24 * 3600;
const MAX_FILE_BYTES: i64 = 1 << 50;
const MAX_MEMORY_BYTES: i64 = 1 << 40;

named_enum! {
    /// Compression of the recorded results.
    Compression {
        /// Zstandard, level 1.
        Zstd = "zstd",
        /// LZ4.
        Lz4 = "lz4",
        /// No compression.
        None = "none",
    }
}

named_enum! {
    /// Wire format that identifies the client of a request; ROS's implementations of DDS differ.
    #[derive(serde::Serialize, serde::Deserialize)]
    ServiceMapping {
        /// Each request is answered in its own format.
        Auto = "auto",
        /// As in Fast DDS and Connext: in the inline QoS of the sample.
        Enhanced = "enhanced",
        /// As in Cyclone DDS: a header in front of the message.
        Cyclone = "cyclone",
    }
}

parameter_group! {
    /// All parameters of the node.
    #[derive(Clone, Debug, PartialEq)]
    pub struct NodeParams {
        /// True: the node configures and activates itself. False: it waits for requests on ~/change_state, as from a
        /// lifecycle manager.
        autostart: bool = true => ["autostart", read_only],
        /// True: time comes from /clock, as a simulator or player publishes it. False: system time.
        use_sim_time: bool = false => ["use_sim_time"],
        /// Wire format of services on DDS. auto: each request is answered in its own format, for Fast DDS and Cyclone
        /// DDS side by side; enhanced: the format of Fast DDS; cyclone: the format of Cyclone DDS.
        service_mapping: ServiceMapping = ServiceMapping::Auto => ["dds.service_mapping", read_only],
        /// Memory of the middleware process; one that takes more is replaced, which costs the frames of some tenths of
        /// a second. Raise it for images above 16 MB.
        max_middleware_bytes: u64 = 192 << 20 =>
            ["middleware.max_memory_bytes", (64 * MIB)..=MAX_MEMORY_BYTES, "bytes", read_only],
        /// Recording of results and images.
        recording: RecordingParams = RecordingParams::default() => group,
        /// Overrides of the quality of service of topics.
        qos_overrides: QosOverrides = QosOverrides::default() => computed,
        /// The cameras, at least one.
        cameras: Vec<CameraParams> = vec![CameraParams::default()] => computed,
    }
}

parameter_group! {
    /// Recording of results and, optionally, images.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct RecordingParams {
        /// True: results are recorded while the node is active. ~/record switches recording at run time.
        enabled: bool = false => ["recording.enabled"],
        /// Parent directory of the recordings, each a directory laser_profiler_<UTC time>. A relative path starts at
        /// the working directory.
        directory: PathBuf = PathBuf::from(".") => ["recording.directory"],
        /// True: raw images are recorded too, in a separate bag next to the results. The disk must sustain the data
        /// rate of the cameras, 120 MB/s for 2592 x 2048 pixels at 22 frames/s.
        images: bool = false => ["recording.images"],
        /// Compression of the recorded results. zstd: level 1, about a factor of three; lz4: faster, larger files;
        /// none: least processor load.
        compression: Compression = Compression::Zstd => ["recording.compression"],
        /// File size at which a recording continues in a new file; 0: never. Typically some gigabytes.
        split_bytes: Option<u64> = None => ["recording.split_bytes", 0..=MAX_FILE_BYTES, "bytes"],
        /// Duration after which a recording continues in a new file; 0: never.
        split_seconds: Option<u64> = None => ["recording.split_seconds", 0..=MAX_SECONDS, "s"],
        /// Free disk space below which recording stops; topics are not affected.
        min_free_bytes: u64 = 1 << 30 => ["recording.min_free_bytes", 0..=MAX_FILE_BYTES, "bytes"],
        /// Memory for messages that wait for the disk; messages beyond it are dropped and counted. Raise it for disks
        /// that stall; the images of a large camera need 120 MB per second.
        queue_bytes: u64 = 256 << 20 => ["recording.queue_bytes", MIB..=MAX_MEMORY_BYTES, "bytes"],
        /// Duration of past results kept in memory, which the snapshot service writes; 0: none.
        snapshot_seconds: Option<u64> = None => ["recording.snapshot_seconds", 0..=MAX_SECONDS, "s"],
        /// Memory for past results; the oldest are discarded first, even if younger than recording.snapshot_seconds.
        snapshot_bytes: u64 = 256 << 20 => ["recording.snapshot_bytes", MIB..=MAX_MEMORY_BYTES, "bytes"],
    }
}
