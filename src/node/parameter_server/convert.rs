//! Converts values and declarations to and from `rcl_interfaces`.

use std::borrow::Cow;

use crate::{
    msg::rcl_interfaces::{
        FloatingPointRange, IntegerRange, Parameter, ParameterDescriptor, ParameterValue, Text,
        parameter_type,
    },
    ros::{parameters::Declared, table::Kind, value::Value},
};

/// Converts a value to a message.
pub(super) fn value_message(value: &Value) -> ParameterValue<'_> {
    let kind = type_of(value);
    let none = ParameterValue::default();
    match value {
        Value::Bool(value) => ParameterValue { kind, bool_value: *value, ..none },
        Value::Integer(value) => ParameterValue { kind, integer_value: *value, ..none },
        Value::Float(value) => ParameterValue { kind, double_value: *value, ..none },
        Value::Text(text) => ParameterValue { kind, string_value: Cow::Borrowed(text), ..none },
        Value::TextList(texts) => {
            let string_array_value = texts.iter().map(|text| Text::from(text.as_str())).collect();
            ParameterValue { kind, string_array_value, ..none }
        }
    }
}

/// Returns the type of a value, a constant of [`parameter_type`].
pub(super) const fn type_of(value: &Value) -> u8 {
    match value {
        Value::Bool(_) => parameter_type::BOOL,
        Value::Integer(_) => parameter_type::INTEGER,
        Value::Float(_) => parameter_type::DOUBLE,
        Value::Text(_) => parameter_type::STRING,
        Value::TextList(_) => parameter_type::STRING_ARRAY,
    }
}

/// Converts a parameter and its value to a message.
pub(super) fn parameter_message<'a>(name: &'a str, value: &'a Value) -> Parameter<'a> {
    Parameter { name: Cow::Borrowed(name), value: value_message(value) }
}

/// Returns the value in a message, or the reason that no parameter of this node can have it.
pub(super) fn value(message: &ParameterValue<'_>) -> Result<Value, String> {
    match message.kind {
        parameter_type::BOOL => Ok(Value::Bool(message.bool_value)),
        parameter_type::INTEGER => Ok(Value::Integer(message.integer_value)),
        parameter_type::DOUBLE => Ok(Value::Float(message.double_value)),
        parameter_type::STRING => Ok(Value::Text(message.string_value.clone().into_owned())),
        parameter_type::STRING_ARRAY => {
            let texts = message.string_array_value.iter();
            Ok(Value::TextList(texts.map(|Text(text)| text.clone().into_owned()).collect()))
        }
        // rclpy guesses the type of a list from its elements, and of an empty one it cannot.
        parameter_type::BYTE_ARRAY..=parameter_type::DOUBLE_ARRAY if is_empty_array(message) => {
            Ok(Value::TextList(Vec::new()))
        }
        parameter_type::NOT_SET => Err("a parameter of this node always has a value".to_owned()),
        parameter_type::BYTE_ARRAY..=parameter_type::DOUBLE_ARRAY => {
            Err("no parameter of this node is an array of bytes or numbers".to_owned())
        }
        other => Err(format!("type {other} is not one of rcl_interfaces/msg/ParameterType")),
    }
}

fn is_empty_array(message: &ParameterValue<'_>) -> bool {
    message.byte_array_value.is_empty()
        && message.bool_array_value.is_empty()
        && message.integer_array_value.is_empty()
        && message.double_array_value.is_empty()
}

/// Returns the descriptor of a parameter, with its allowed values.
pub(super) fn descriptor(declared: &Declared) -> ParameterDescriptor<'_> {
    let row = declared.row();
    let (mut floating_point_range, mut integer_range) = (Vec::new(), Vec::new());
    let mut additional_constraints = String::new();
    match row.kind {
        Kind::Bool { .. } => {}
        Kind::Integer { min, max, .. } => {
            integer_range.push(IntegerRange { from_value: min, to_value: max, step: 0 });
        }
        Kind::Float { min, max, .. } => {
            let range = FloatingPointRange { from_value: min, to_value: max, step: 0.0 };
            floating_point_range.push(range);
        }
        Kind::Choice { .. } | Kind::Text { .. } | Kind::TextList { .. } => {
            additional_constraints = row.allowed();
        }
    }
    let description = match row.unit {
        "" => Cow::Borrowed(row.text),
        unit => Cow::Owned(format!("{} [{unit}]", row.text)),
    };
    ParameterDescriptor {
        name: Cow::Borrowed(declared.name()),
        kind: type_of(declared.value()),
        description,
        additional_constraints: Cow::Owned(additional_constraints),
        read_only: row.is_read_only,
        dynamic_typing: false,
        floating_point_range,
        integer_range,
    }
}
