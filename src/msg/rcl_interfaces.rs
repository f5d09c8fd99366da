//! `rcl_interfaces`: parameters of a node, as other nodes see and set them.

mod services;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

pub(crate) use super::text::Text;
use super::{builtin_interfaces::Time, schema::message, text};
pub(crate) use services::*;

/// The types of a parameter, as in [`ParameterValue::kind`].
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

/// The value of a parameter: of the fields only the one that `kind` names counts.
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

/// What a parameter is and which values it may have.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ParameterDescriptor<'a> {
    /// Full name.
    #[serde(borrow, with = "text")]
    pub(crate) name: Cow<'a, str>,
    /// A constant of [`parameter_type`].
    #[serde(rename = "type")]
    pub(crate) kind: u8,
    /// What it does.
    #[serde(borrow, with = "text")]
    pub(crate) description: Cow<'a, str>,
    /// Rules that no range can say.
    #[serde(borrow, with = "text")]
    pub(crate) additional_constraints: Cow<'a, str>,
    /// Whether it stands fast.
    pub(crate) read_only: bool,
    /// Whether its type may change.
    pub(crate) dynamic_typing: bool,
    /// Range of a float, one at most; empty: any.
    pub(crate) floating_point_range: Vec<FloatingPointRange>,
    /// Range of an integer, one at most; empty: any.
    pub(crate) integer_range: Vec<IntegerRange>,
}

/// Floats that a parameter may have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct FloatingPointRange {
    /// Smallest.
    pub(crate) from_value: f64,
    /// Largest.
    pub(crate) to_value: f64,
    /// From one to the next; 0: any between.
    pub(crate) step: f64,
}

/// Integers that a parameter may have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct IntegerRange {
    /// Smallest.
    pub(crate) from_value: i64,
    /// Largest.
    pub(crate) to_value: i64,
    /// From one to the next; 0: any between.
    pub(crate) step: u64,
}

/// What became of a node's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ParameterEvent<'a> {
    /// When.
    pub(crate) stamp: Time,
    /// Fully qualified name of the node.
    #[serde(borrow, with = "text")]
    pub(crate) node: Cow<'a, str>,
    /// Those that were declared.
    #[serde(borrow)]
    pub(crate) new_parameters: Vec<Parameter<'a>>,
    /// Those that were set.
    #[serde(borrow)]
    pub(crate) changed_parameters: Vec<Parameter<'a>>,
    /// Those that are no more.
    #[serde(borrow)]
    pub(crate) deleted_parameters: Vec<Parameter<'a>>,
}

/// What came of a wish to set parameters.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SetParametersResult<'a> {
    /// Whether they are set.
    pub(crate) successful: bool,
    /// Why not.
    #[serde(borrow, with = "text")]
    pub(crate) reason: Cow<'a, str>,
}

/// Names that begin as somebody asked.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ListParametersResult<'a> {
    /// Full names of parameters.
    #[serde(borrow)]
    pub(crate) names: Vec<Text<'a>>,
    /// What stands before the last dot of any of them.
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
