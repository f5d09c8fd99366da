//! Conversion of checked values into types, and checks for contradictions between values.

use crate::{
    ros::{camera_params::CameraParams, node_params::NodeParams, qos_overrides::QosOverrides},
    scanner::params::{Background, MotionParams, MotionSource, Params},
};

use super::{ParameterError, Parameters, Section};

impl NodeParams {
    /// Converts the checked values into types and checks that they do not contradict each other.
    ///
    /// # Errors
    /// Values that contradict each other.
    pub fn new(values: &Parameters) -> Result<Self, ParameterError> {
        let camera = |name: &String| CameraParams::new(name, values.of_camera(name));
        let node = values.of_node();
        Ok(Self {
            qos_overrides: values.qos_overrides(),
            cameras: values.cameras().iter().map(camera).collect::<Result<_, _>>()?,
            ..Self::from_values(&|name| node.value(name))?
        })
    }
}

impl Parameters {
    /// Returns the overrides of quality of service among the values.
    pub(crate) fn qos_overrides(&self) -> QosOverrides {
        QosOverrides::new(self.iter().map(|declared| (declared.name(), declared.value())))
    }
}

impl CameraParams {
    fn new(name: &str, values: Section<'_>) -> Result<Self, ParameterError> {
        let value = |name: &str| values.value(name);
        let params = Self {
            name: name.to_owned(),
            is_transport_set: values.is_set("image_transport"),
            calibration_file: values.file("calibration_file"),
            background_file: values.file("extraction.background_file"),
            scanner: Params::from_values(&value)?,
            ..Self::from_values(&value)?
        };
        params.check()?;
        Ok(params)
    }

    fn check(&self) -> Result<(), ParameterError> {
        let name = |name| self.full_name(name);
        let conflict = |text: String| Err(ParameterError::Conflict(text));
        check_motion(self)?;
        let is_reference = self.scanner.extraction.background == Background::Reference;
        if is_reference && self.background_file.is_none() {
            return conflict(format!(
                "{} is reference, but {} is empty: set it to a picture without laser, as written by \
                 laser_profiler ambient",
                name("extraction.background"),
                name("extraction.background_file")
            ));
        }
        let smoothed = self.scanner.extraction.smoothing_columns;
        if smoothed.is_multiple_of(2) {
            return conflict(format!(
                "{} is {smoothed}, but must be odd: a point and equally many neighbours on either side",
                name("extraction.smoothing_columns")
            ));
        }
        let (slice, scan) = (self.scanner.slice_profiles, self.scanner.scan_max_profiles);
        if slice > scan {
            return conflict(format!(
                "{} is {slice}, but a scan ends at {} {scan}: a slice may not be larger",
                name("slice.profiles"),
                name("scan.max_profiles")
            ));
        }
        Ok(())
    }
}

/// Checks for contradictions between several values.
fn check_motion(camera: &CameraParams) -> Result<(), ParameterError> {
    let MotionParams { source, step, velocity, .. } = camera.scanner.motion;
    let name = |name| camera.full_name(name);
    let conflict = |text: String| Err(ParameterError::Conflict(text));
    if source == MotionSource::Constant && step.is_none() && velocity.is_none() {
        return conflict(format!(
            "{} is constant, but {} and {} are both 0.0: set one of them",
            name("motion.source"),
            name("motion.step"),
            name("motion.velocity")
        ));
    }
    if let (Some(step), Some(velocity)) = (step, velocity) {
        return conflict(format!(
            "{} is {step} and {} is {velocity}: set only one of them",
            name("motion.step"),
            name("motion.velocity")
        ));
    }
    if source == MotionSource::Tf && camera.moved.part_frame.is_empty() {
        return conflict(format!(
            "{} is tf, but {} is empty: set it to the frame of the scan, such as base_link",
            name("motion.source"),
            name("motion.part_frame")
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::table::ALLOWED_DIRECTORIES;
    use laser_triangulation::parameters::{Kind, Value};

    /// Returns a value in range other than the default.
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
    fn every_parameter_of_the_table_has_a_field() {
        let default = NodeParams::new(&Parameters::default()).unwrap();
        // The store of the parameter server reads the directories itself.
        let is_typed = |name: &str| name != ALLOWED_DIRECTORIES;
        for parameter in Parameters::default().iter().filter(|row| is_typed(row.name())) {
            let mut values = Parameters::default();
            values.set(parameter.name(), other(&parameter.row().kind), "a test").unwrap();
            match NodeParams::new(&values) {
                Ok(changed) => assert_ne!(changed, default, "{}", parameter.name()),
                Err(error) => assert!(error.to_string().contains(parameter.name()), "{error}"),
            }
        }
    }

    #[test]
    fn contradictions_are_rejected() {
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
