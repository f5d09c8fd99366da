//! The node's parameters as types, after the table has checked every value.

use std::path::PathBuf;

use laser_triangulation::named_enum;

use super::{
    camera_params::CameraParams,
    parameters::{ParameterError, Parameters, Section},
    qos_overrides::QosOverrides,
};

named_enum! {
    /// How images arrive.
    ImageTransport {
        /// `sensor_msgs/Image`.
        Raw = "raw",
        /// `sensor_msgs/CompressedImage`.
        Compressed = "compressed",
    }
}

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

/// Everything that the node can be told.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeParams {
    /// Whether the node configures and activates itself.
    pub autostart: bool,
    /// Whether the time is that of `/clock`.
    pub use_sim_time: bool,
    /// How services are spoken on DDS.
    pub service_mapping: ServiceMapping,
    /// How the live node records.
    pub recording: RecordingParams,
    /// Changes to the quality of service of topics.
    pub qos_overrides: QosOverrides,
    /// The cameras, at least one.
    pub cameras: Vec<CameraParams>,
}

/// How results, and images if wanted, are recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingParams {
    /// Whether to record as long as the node is active.
    pub enabled: bool,
    /// Where bags are made.
    pub directory: PathBuf,
    /// Whether raw images are recorded too.
    pub images: bool,
    /// Compression of the results.
    pub compression: Compression,
    /// Size at which the next file begins, bytes; 0: never.
    pub split_bytes: u64,
    /// Duration after which the next file begins, seconds; 0: never.
    pub split_seconds: u64,
    /// Space left free on the disk, bytes.
    pub min_free_bytes: u64,
    /// Memory for messages that wait for the disk, bytes.
    pub queue_bytes: u64,
    /// How much of the past is kept for a snapshot, seconds; 0: nothing.
    pub snapshot_seconds: u64,
    /// Memory for that past, bytes.
    pub snapshot_bytes: u64,
}

impl NodeParams {
    /// Takes the checked values into types and checks what no single value can show.
    ///
    /// # Errors
    /// Values that contradict one another.
    pub fn new(values: &Parameters) -> Result<Self, ParameterError> {
        let node = values.of_node();
        let camera = |name: &String| CameraParams::new(name, values.of_camera(name));
        Ok(Self {
            autostart: node.flag("autostart")?,
            use_sim_time: node.flag("use_sim_time")?,
            service_mapping: node.choice("dds.service_mapping", ServiceMapping::from_name)?,
            recording: RecordingParams::new(node)?,
            qos_overrides: QosOverrides::of(values),
            cameras: values.cameras().iter().map(camera).collect::<Result<_, _>>()?,
        })
    }
}

impl RecordingParams {
    fn new(node: Section<'_>) -> Result<Self, ParameterError> {
        Ok(Self {
            enabled: node.flag("recording.enabled")?,
            directory: node.path("recording.directory")?,
            images: node.flag("recording.images")?,
            compression: node.choice("recording.compression", Compression::from_name)?,
            split_bytes: node.unsigned("recording.split_bytes")?,
            split_seconds: node.unsigned("recording.split_seconds")?,
            min_free_bytes: node.unsigned("recording.min_free_bytes")?,
            queue_bytes: node.unsigned("recording.queue_bytes")?,
            snapshot_seconds: node.unsigned("recording.snapshot_seconds")?,
            snapshot_bytes: node.unsigned("recording.snapshot_bytes")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::{table::Kind, value::Value};

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
