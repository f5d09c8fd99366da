//! The node's parameters as types, after the table has checked every value.

use std::path::PathBuf;

use laser_triangulation::{named_enum, parameter_group};

pub(crate) use super::camera_params::ImageTransport;
use super::{
    camera_params::CameraParams,
    parameters::{ParameterError, Parameters},
    qos_overrides::QosOverrides,
};

const MIB: i64 = 1 << 20;
const MAX_SECONDS: i64 = 366 * 24 * 3600;
const MAX_FILE_BYTES: i64 = 1 << 50;
const MAX_MEMORY_BYTES: i64 = 1 << 40;

named_enum! {
    /// How the results' recording is compressed.
    Compression {
        /// Zstandard, level 1.
        Zstd = "zstd",
        /// LZ4.
        Lz4 = "lz4",
        /// Not at all.
        None = "none",
    }
}

named_enum! {
    /// How a request says who wants the answer: the implementations of DDS in ROS differ.
    ServiceMapping {
        /// Each request is answered in the mapping it came in.
        Auto = "auto",
        /// As Fast DDS and Connext do: beside the message.
        Enhanced = "enhanced",
        /// As Cyclone DDS does: in front of the message.
        Cyclone = "cyclone",
    }
}

parameter_group! {
    /// Every parameter of the node.
    #[derive(Clone, Debug, PartialEq)]
    pub struct NodeParams {
        /// Whether the node configures and activates itself. false: it waits for ~/change_state, as from a lifecycle
        /// manager.
        autostart: bool = true => ["autostart", read_only],
        /// Whether the time is that of /clock, as a simulator or a player sends it, instead of the machine's.
        use_sim_time: bool = false => ["use_sim_time"],
        /// How services are spoken on DDS. auto: each request is answered as it was asked, Fast DDS and Cyclone DDS
        /// side by side; enhanced: all as by Fast DDS; cyclone: all as by Cyclone DDS.
        service_mapping: ServiceMapping = ServiceMapping::Auto => ["dds.service_mapping", read_only],
        /// Recording of results and images.
        recording: RecordingParams = RecordingParams::default() => group,
        /// Changes to the quality of service of topics.
        qos_overrides: QosOverrides = QosOverrides::default() => computed,
        /// The cameras, at least one.
        cameras: Vec<CameraParams> = vec![CameraParams::default()] => computed,
    }
}

parameter_group! {
    /// Recording of results, and of images if wanted.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct RecordingParams {
        /// Whether results are recorded as long as the node is active; ~/record switches it too.
        enabled: bool = false => ["recording.enabled"],
        /// Where recordings are made, each a directory laser_profiler_<UTC time>. A relative path starts from the
        /// working directory.
        directory: PathBuf = PathBuf::from(".") => ["recording.directory"],
        /// Whether the raw images are recorded too, in a bag of their own beside the results. Needs a disk that takes
        /// what the cameras give: 120 MB/s for 2592 x 2048 pixels at 22 frames/s.
        images: bool = false => ["recording.images"],
        /// Compression of the results' recording. zstd: level 1, some threefold; lz4: cheaper, larger; none: for the
        /// fastest disk.
        compression: Compression = Compression::Zstd => ["recording.compression"],
        /// Size at which a recording goes on in its next file; 0: never. Some gigabytes suit most tools.
        split_bytes: Option<u64> = None => ["recording.split_bytes", 0..=MAX_FILE_BYTES, "bytes"],
        /// Duration after which a recording goes on in its next file; 0: never.
        split_seconds: Option<u64> = None => ["recording.split_seconds", 0..=MAX_SECONDS, "s"],
        /// Space that a recording leaves free on its disk: it ends before there is less. The topics go on.
        min_free_bytes: u64 = 1 << 30 => ["recording.min_free_bytes", 0..=MAX_FILE_BYTES, "bytes"],
        /// Memory for messages that wait for the disk; what does not fit is dropped and counted. Raise it for disks
        /// that pause, at 120 MB/s for a large camera's images.
        queue_bytes: u64 = 256 << 20 => ["recording.queue_bytes", MIB..=MAX_MEMORY_BYTES, "bytes"],
        /// How much of the past is kept in memory, to be written when the snapshot service is called; 0: nothing.
        snapshot_seconds: Option<u64> = None => ["recording.snapshot_seconds", 0..=MAX_SECONDS, "s"],
        /// Memory for that past: the oldest goes first, even when it is younger than recording.snapshot_seconds.
        snapshot_bytes: u64 = 256 << 20 => ["recording.snapshot_bytes", MIB..=MAX_MEMORY_BYTES, "bytes"],
    }
}

impl NodeParams {
    /// Converts the checked values into types and checks that they agree with each other.
    ///
    /// # Errors
    /// Values that contradict each other.
    pub fn new(values: &Parameters) -> Result<Self, ParameterError> {
        let camera = |name: &String| CameraParams::new(name, values.of_camera(name));
        let node = values.of_node();
        Ok(Self {
            qos_overrides: QosOverrides::of(values),
            cameras: values.cameras().iter().map(camera).collect::<Result<_, _>>()?,
            ..Self::from_values(&|name| node.value(name))?
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use laser_triangulation::parameters::{Kind, Value};

    /// Some value other than the default, in range.
    fn other(kind: &Kind) -> Value {
        match *kind {
            Kind::Bool { default } => Value::Bool(!default),
            Kind::Integer { default, min, .. } => {
                Value::Integer(if default == min { default + 1 } else { default - 1 })
            }
            Kind::Float { default, max, .. } => Value::Float(f64::midpoint(default, max)),
            Kind::Choice { default, names } => {
                Value::Text(names.iter().find(|name| **name != default).unwrap().to_string())
            }
            Kind::Text { .. } => Value::Text("file.yaml".to_owned()),
            Kind::TextList { .. } => Value::TextList(vec!["left".to_owned()]),
        }
    }

    #[test]
    fn every_parameter_of_the_table_reaches_its_type() {
        let default = NodeParams::new(&Parameters::default()).unwrap();
        for parameter in Parameters::default().iter() {
            let mut values = Parameters::default();
            values.set(parameter.name(), other(&parameter.row().kind), "a test").unwrap();
            match NodeParams::new(&values) {
                Ok(changed) => assert_ne!(changed, default, "{}", parameter.name()),
                Err(error) => assert!(error.to_string().contains(parameter.name()), "{error}"),
            }
        }
    }

    #[test]
    fn contradictions_are_refused() {
        let cases: [&[(&str, Value)]; 4] = [
            &[("extraction.smoothing_columns", Value::Integer(4))],
            &[("motion.source", Value::Text("constant".into()))],
            &[("motion.step", Value::Float(0.1)), ("motion.velocity", Value::Float(0.1))],
            &[("slice.profiles", Value::Integer(10)), ("scan.max_profiles", Value::Integer(9))],
        ];
        for case in cases {
            let mut values = Parameters::default();
            for (name, value) in case {
                values.set(name, value.clone(), "a test").unwrap();
            }
            assert!(
                matches!(NodeParams::new(&values), Err(ParameterError::Conflict(_))),
                "{case:?}"
            );
        }
    }
}
