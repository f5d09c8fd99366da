//! `rcl_interfaces`: parameters of a node, as other nodes read and set them.

mod services;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

pub(crate) use super::text::Text;
use super::{builtin_interfaces::Time, schema::message, text};
pub(crate) use services::*;

/// Types of a parameter, as in [`ParameterValue::kind`].
pub(crate) mod parameter_type {
    pub(crate) const NOT_SET: u8 = 0;
    pub(crate) const BOOL: u8 = 1;
    pub(crate) const INTEGER: u8 = 2;
    pub(crate) const DOUBLE: u8 = 3;
    pub(crate) const STRING: u8 = 4;
    pub(crate) const BYTE_ARRAY: u8 = 5;
    pub(crate) const DOUBLE_ARRAY: u8 = 8;
    pub(crate) const STRING_ARRAY: u8 = 9;
}

/// Value of a parameter: only the field that `kind` selects is valid.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ParameterValue<'a> {
    /// A constant of [`parameter_type`].
    #[serde(rename = "type")]
    pub(crate) kind: u8,
    pub(crate) bool_value: bool,
    pub(crate) integer_value: i64,
    pub(crate) double_value: f64,
    #[serde(borrow, with = "text")]
    pub(crate) string_value: Cow<'a, str>,
    pub(crate) byte_array_value: Vec<u8>,
    pub(crate) bool_array_value: Vec<bool>,
    pub(crate) integer_array_value: Vec<i64>,
    pub(crate) double_array_value: Vec<f64>,
    #[serde(borrow)]
    pub(crate) string_array_value: Vec<Text<'a>>,
}

/// A parameter and its value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Parameter<'a> {
    /// Full name.
    #[serde(borrow, with = "text")]
    pub name: Cow<'a, str>,
    /// Value.
    #[serde(borrow)]
    pub(crate) value: ParameterValue<'a>,
}

/// Description of a parameter and its allowed values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ParameterDescriptor<'a> {
    /// Full name.
    #[serde(borrow, with = "text")]
    pub(crate) name: Cow<'a, str>,
    /// A constant of [`parameter_type`].
    #[serde(rename = "type")]
    pub(crate) kind: u8,
    /// Description of its effect.
    #[serde(borrow, with = "text")]
    pub(crate) description: Cow<'a, str>,
    /// Constraints that a range cannot express.
    #[serde(borrow, with = "text")]
    pub(crate) additional_constraints: Cow<'a, str>,
    /// True if it is read-only.
    pub(crate) read_only: bool,
    /// True if its type may change.
    pub(crate) dynamic_typing: bool,
    /// Range of a float, at most one; empty: unlimited.
    pub(crate) floating_point_range: Vec<FloatingPointRange>,
    /// Range of an integer, at most one; empty: unlimited.
    pub(crate) integer_range: Vec<IntegerRange>,
}

/// Range of a float parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct FloatingPointRange {
    /// Minimum.
    pub(crate) from_value: f64,
    /// Maximum.
    pub(crate) to_value: f64,
    /// Step between allowed values; 0: any value in the range.
    pub(crate) step: f64,
}

/// Range of an integer parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct IntegerRange {
    /// Minimum.
    pub(crate) from_value: i64,
    /// Maximum.
    pub(crate) to_value: i64,
    /// Step between allowed values; 0: any value in the range.
    pub(crate) step: u64,
}

/// Changes to a node's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ParameterEvent<'a> {
    /// Time of the change.
    pub(crate) stamp: Time,
    /// Fully qualified name of the node.
    #[serde(borrow, with = "text")]
    pub(crate) node: Cow<'a, str>,
    /// Declared parameters.
    #[serde(borrow)]
    pub(crate) new_parameters: Vec<Parameter<'a>>,
    /// Changed parameters.
    #[serde(borrow)]
    pub(crate) changed_parameters: Vec<Parameter<'a>>,
    /// Deleted parameters.
    #[serde(borrow)]
    pub(crate) deleted_parameters: Vec<Parameter<'a>>,
}

/// Result of a request to set parameters.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SetParametersResult<'a> {
    /// True if they are set.
    pub(crate) successful: bool,
    /// Reason for a failure.
    #[serde(borrow, with = "text")]
    pub(crate) reason: Cow<'a, str>,
}

/// Names with a requested prefix.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ListParametersResult<'a> {
    /// Full names of the parameters.
    #[serde(borrow)]
    pub(crate) names: Vec<Text<'a>>,
    /// Their prefixes: the parts before the last dot.
    #[serde(borrow)]
    pub(crate) prefixes: Vec<Text<'a>>,
}

message!(
    ParameterValue<'_>,
    "rcl_interfaces/msg/ParameterValue",
    include_str!("definitions/rcl_interfaces/ParameterValue.msg"),
    "RIHS01_115fc089a387e23c7ecd3525c9189c379109119d6ab82e8dfbde0fdf6a7f9b68",
    []
);
message!(
    Parameter<'_>,
    "rcl_interfaces/msg/Parameter",
    include_str!("definitions/rcl_interfaces/Parameter.msg"),
    "RIHS01_ddfe6442cffc462317adb5c92536a7b6dd55858c5c3e1e328165a6b73c2831af",
    [ParameterValue<'_>]
);
message!(
    ParameterDescriptor<'_>,
    "rcl_interfaces/msg/ParameterDescriptor",
    include_str!("definitions/rcl_interfaces/ParameterDescriptor.msg"),
    "RIHS01_52175dbfda6c51153101d33d2a9da05743f66f02d5ab2ca9ec4709b46b73d704",
    [FloatingPointRange, IntegerRange]
);
message!(
    FloatingPointRange,
    "rcl_interfaces/msg/FloatingPointRange",
    include_str!("definitions/rcl_interfaces/FloatingPointRange.msg"),
    "RIHS01_e6af23a23c177fee5f3075c8b1e435162a9b63c863d78c06017460b49684262d",
    []
);
message!(
    IntegerRange,
    "rcl_interfaces/msg/IntegerRange",
    include_str!("definitions/rcl_interfaces/IntegerRange.msg"),
    "RIHS01_f7b7fdc0f65f07702e099218e13288c3963bcb9345bde78b560e6cd19800fc5a",
    []
);
message!(
    ParameterEvent<'_>,
    "rcl_interfaces/msg/ParameterEvent",
    include_str!("definitions/rcl_interfaces/ParameterEvent.msg"),
    "RIHS01_043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204",
    [Time, Parameter<'_>]
);
message!(
    SetParametersResult<'_>,
    "rcl_interfaces/msg/SetParametersResult",
    include_str!("definitions/rcl_interfaces/SetParametersResult.msg"),
    "RIHS01_cfcc0fb0371ee5159b403960ef4300f8f9d2f1fd6117c8666b7f9654d528a9b1",
    []
);
message!(
    ListParametersResult<'_>,
    "rcl_interfaces/msg/ListParametersResult",
    include_str!("definitions/rcl_interfaces/ListParametersResult.msg"),
    "RIHS01_237ae3428413dcbcfb452b510c42355f3a2b021dc091afa3e18526d57022f1cd",
    []
);
