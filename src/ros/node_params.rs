//! The node's parameters as types, after the table has checked every value.

use std::path::PathBuf;

use crate::scanner::params::{
    Channel, ExtractionParams, Method, MotionParams, MotionSource, Params, PeakSelection,
    RegionOfInterest, StripeDirection, Window, named_enum,
};

use super::parameters::{ParameterError, Parameters};

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

/// Everything that the node can be told.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeParams {
    /// How images arrive; `None` when nobody set it, and the default may give way to what a recording holds.
    pub image_transport: Option<ImageTransport>,
    /// Largest decoded image accepted, bytes.
    pub max_frame_bytes: u64,
    /// The calibration; `None`: centrelines only.
    pub calibration_file: Option<PathBuf>,
    /// Compression of the results.
    pub compression: Compression,
    /// The measurement.
    pub scanner: Params,
}

impl NodeParams {
    /// Takes the checked values into types and checks what no single value can show.
    ///
    /// # Errors
    /// Values that contradict one another.
    pub fn new(values: &Parameters) -> Result<Self, ParameterError> {
        let side = |name| values.integer(name).map(|value| value as u32);
        let transport = values.choice("image_transport", ImageTransport::from_name)?;
        let params = Self {
            image_transport: values.is_set("image_transport").then_some(transport),
            max_frame_bytes: values.integer("max_frame_bytes")? as u64,
            calibration_file: values.path("calibration_file")?,
            compression: values.choice("recording.compression", Compression::from_name)?,
            scanner: Params {
                channel: values.choice("channel", Channel::from_name)?,
                stripe_direction: values.choice("stripe_direction", StripeDirection::from_name)?,
                full_scale: side("full_scale")?,
                roi: RegionOfInterest {
                    x_offset: side("roi.x_offset")?,
                    y_offset: side("roi.y_offset")?,
                    width: side("roi.width")?,
                    height: side("roi.height")?,
                },
                extraction: extraction(values)?,
                motion: MotionParams {
                    source: values.choice("motion.source", MotionSource::from_name)?,
                    step_m: values.float("motion.step")?,
                    velocity_m_s: values.float("motion.velocity")?,
                },
                slice_profiles: side("slice.profiles")?,
                scan_max_profiles: side("scan.max_profiles")?,
            },
        };
        params.check()?;
        Ok(params)
    }

    fn check(&self) -> Result<(), ParameterError> {
        let MotionParams { source, step_m, velocity_m_s } = self.scanner.motion;
        let conflict = |text: String| Err(ParameterError::Conflict(text));
        if source == MotionSource::Constant && step_m == 0.0 && velocity_m_s == 0.0 {
            return conflict(
                "motion.source is constant, but motion.step and motion.velocity are both 0.0: set one of them"
                    .to_owned(),
            );
        }
        if step_m != 0.0 && velocity_m_s != 0.0 {
            return conflict(format!(
                "motion.step is {step_m} m/frame and motion.velocity is {velocity_m_s} m/s: set only one of them"
            ));
        }
        let (slice, scan) = (self.scanner.slice_profiles, self.scanner.scan_max_profiles);
        if slice > scan {
            return conflict(format!(
                "slice.profiles is {slice}, but a scan ends at scan.max_profiles {scan}: a slice may not be larger"
            ));
        }
        Ok(())
    }
}

fn extraction(values: &Parameters) -> Result<ExtractionParams, ParameterError> {
    Ok(ExtractionParams {
        method: values.choice("extraction.method", Method::from_name)?,
        window: values.choice("extraction.window", Window::from_name)?,
        blur_radius: values.integer("extraction.blur_radius")? as u32,
        segment_threshold: values.float("extraction.segment_threshold")?,
        min_segment_area: values.integer("extraction.min_segment_area")? as u32,
        width_threshold: values.float("extraction.width_threshold")?,
        peak_selection: values.choice("extraction.peak_selection", PeakSelection::from_name)?,
        read_noise: values.float("extraction.read_noise")?,
        shot_gain: values.float("extraction.shot_gain")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::{
        table::{Kind, TABLE},
        value::Value,
    };

    /// Some value other than the default, in range.
    fn other(kind: &Kind) -> Value {
        match *kind {
            Kind::Integer { default, min, .. } => {
                Value::Integer(if default == min { default + 1 } else { default - 1 })
            }
            Kind::Float { default, max, .. } => Value::Float(f64::midpoint(default, max)),
            Kind::Choice { default, names } => {
                Value::Text(names.iter().find(|name| **name != default).unwrap().to_string())
            }
            Kind::Text { .. } => Value::Text("file.yaml".to_owned()),
        }
    }

    #[test]
    fn every_parameter_of_the_table_reaches_its_type() {
        let default = NodeParams::new(&Parameters::default()).unwrap();
        for parameter in TABLE {
            let mut values = Parameters::default();
            values.set(parameter.name, other(&parameter.kind), "a test").unwrap();
            match NodeParams::new(&values) {
                Ok(changed) => assert_ne!(changed, default, "{}", parameter.name),
                Err(error) => assert!(error.to_string().contains(parameter.name), "{error}"),
            }
        }
    }

    #[test]
    fn contradictions_are_refused() {
        let cases: [&[(&str, Value)]; 3] = [
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
