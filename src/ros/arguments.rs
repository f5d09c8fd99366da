//! Separates `--ros-args … --` groups from the program's own arguments.

use std::path::PathBuf;

use ros2args::{LogLevelAssignment, RemapRule, Ros2ArgsError};
use thiserror::Error;

use super::value::Value;

/// Errors in ROS arguments.
#[derive(Debug, Error)]
pub enum ArgumentError {
    /// Invalid syntax.
    #[error("{0}")]
    Syntax(#[from] Ros2ArgsError),
    /// An argument of rcl that this program does not support.
    #[error("ROS argument {0} is not supported: remove it")]
    Unsupported(&'static str),
    /// A value that is neither a scalar nor a list of texts.
    #[error("-p {0}: the value must be a boolean, a number, a text or a list of texts in brackets")]
    Value(String),
}

/// One `-p [node:]name:=value`.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// Node that it applies to; `None`: every node.
    pub(crate) node: Option<String>,
    /// Name of the parameter.
    pub(crate) name: String,
    /// New value.
    pub(crate) value: Value,
}

/// Content of all `--ros-args` groups of a command line.
#[derive(Clone, Debug, Default)]
pub struct RosArguments {
    /// `-r`, in order.
    pub remaps: Vec<RemapRule>,
    /// `-p`, in order.
    pub assignments: Vec<Assignment>,
    /// `--params-file`, in order.
    pub parameter_files: Vec<PathBuf>,
    /// `--log-level`, for the whole program or one logger, in order.
    pub log_levels: Vec<LogLevelAssignment>,
}

/// Splits a command line into ROS arguments and the rest.
///
/// # Errors
/// An unknown, unsupported or malformed ROS argument.
pub fn split(arguments: &[String]) -> Result<(RosArguments, Vec<String>), ArgumentError> {
    let (parsed, rest) = ros2args::parse_ros2_args(arguments)?;
    if parsed.log_config_file.is_some() {
        return Err(ArgumentError::Unsupported("--log-config-file"));
    }
    if parsed.enclave.is_some() {
        return Err(ArgumentError::Unsupported("--enclave"));
    }
    let assignments = parsed.param_assignments.iter().map(assignment).collect::<Result<_, _>>()?;
    let arguments = RosArguments {
        log_levels: parsed.log_levels,
        remaps: parsed.remap_rules,
        assignments,
        parameter_files: parsed.param_files,
    };
    Ok((arguments, rest))
}

fn assignment(parsed: &ros2args::ParamAssignment) -> Result<Assignment, ArgumentError> {
    let value = if let Some(value) = parsed.as_bool() {
        Value::Bool(value)
    } else if let Some(value) = parsed.as_i64() {
        Value::Integer(value)
    } else if let Some(value) = parsed.as_f64() {
        Value::Float(value)
    } else if let Some(value) = parsed.as_str() {
        Value::Text(value.to_owned())
    } else {
        let elements = parsed.as_vec().map(|elements| elements.iter());
        let texts = elements.and_then(|elements| {
            elements.map(|element| element.as_str().map(str::to_owned)).collect()
        });
        Value::TextList(texts.ok_or_else(|| ArgumentError::Value(parsed.name.clone()))?)
    };
    Ok(Assignment { node: parsed.node_name.clone(), name: parsed.name.clone(), value })
}

#[cfg(test)]
mod tests {
    use ros2args::LogLevel;

    use super::*;

    fn line(text: &str) -> Vec<String> {
        text.split_whitespace().map(str::to_owned).collect()
    }

    #[test]
    fn several_groups_are_separated() {
        let (ros, rest) = split(&line(
            "replay --ros-args -r a:=b -p top:motion.step:=0.5 -- bag --ros-args --params-file f.yaml --log-level debug --log-level top:=warn",
        ))
        .unwrap();
        assert_eq!(rest, line("replay bag"));
        assert_eq!(ros.remaps, [RemapRule::new_global("a".into(), "b".into())]);
        let step = Assignment {
            node: Some("top".into()),
            name: "motion.step".into(),
            value: Value::Float(0.5),
        };
        assert_eq!(ros.assignments, [step]);
        assert_eq!(ros.parameter_files, [PathBuf::from("f.yaml")]);
        let top = LogLevelAssignment::new_logger_specific("top".into(), LogLevel::Warn);
        assert_eq!(ros.log_levels, [LogLevelAssignment::new_global(LogLevel::Debug), top]);
    }

    #[test]
    fn values_keep_their_yaml_type() {
        let (ros, _) =
            split(&line("--ros-args -p a:=35 -p b:=35.0 -p c:=auto -p d:=true -p e:='35' -p f:=[left,'1'] -p g:=[]"))
                .unwrap();
        let values: Vec<_> =
            ros.assignments.into_iter().map(|assignment| assignment.value).collect();
        let expected = [
            Value::Integer(35),
            Value::Float(35.0),
            Value::Text("auto".into()),
            Value::Bool(true),
            Value::Text("35".into()),
            Value::TextList(vec!["left".into(), "1".into()]),
            Value::TextList(Vec::new()),
        ];
        assert_eq!(values, expected);
    }

    #[test]
    fn unsupported_arguments_are_rejected() {
        for text in [
            "--bogus",
            "-r",
            "-r a",
            "-p a",
            "-p a:=[1,2]",
            "-p a:=",
            "--enclave /e",
            "--log-level loud",
        ] {
            assert!(split(&line(&format!("--ros-args {text}"))).is_err(), "{text}");
        }
    }
}
