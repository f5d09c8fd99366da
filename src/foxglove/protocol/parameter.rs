//! Parameters as viewers read and write them.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

/// Type of a value that its JSON text leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterType {
    /// Bytes, written as base64 text.
    ByteArray,
    /// A float, which may be written like an integer.
    Float64,
    /// Floats, which may be written like integers.
    Float64Array,
}

/// Value of a parameter. What lists and dictionaries hold is plain JSON: a type that contained itself would be read with
/// a copy of the rest at every level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ParameterValue {
    /// An integer.
    Integer(i64),
    /// A float.
    Float64(f64),
    /// True or false.
    Bool(bool),
    /// A text.
    String(String),
    /// A list.
    Array(Vec<Json>),
    /// A dictionary.
    Dict(Map<String, Json>),
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// Type, if the value leaves it open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#type: Option<ParameterType>,
    /// Value; `None` in a request to delete the parameter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<ParameterValue>,
}

impl Parameter {
    /// Converts an integer that is stated to be a float.
    pub(super) fn with_stated_type(mut self) -> Self {
        if let (Some(ParameterType::Float64), Some(ParameterValue::Integer(value))) =
            (self.r#type, &self.value)
        {
            self.value = Some(ParameterValue::Float64(*value as f64));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use crate::foxglove::protocol::Request;

    #[test]
    fn nested_values_take_memory_in_proportion() {
        const DEPTH: usize = 100;
        let values = [
            format!("{}1{}", "[".repeat(DEPTH), ",1".repeat(120_000) + &"]".repeat(DEPTH)),
            format!("[{}[]]", "[],".repeat(80_000)),
            format!("[{}0]", "{\"a\":0},".repeat(26_000)),
        ];
        for value in values {
            let text = format!(
                r#"{{"op":"setParameters","parameters":[{{"name":"a","value":{value}}}]}}"#
            );
            assert!(text.len() < 256 << 10);
            let info = allocation_counter::measure(|| {
                let request = Request::from_text(&text).unwrap();
                assert!(matches!(request, Request::Set(parameters, _) if parameters.len() == 1));
            });
            assert!(info.bytes_max < 64 << 20, "{} bytes", info.bytes_max);
        }
    }
}
