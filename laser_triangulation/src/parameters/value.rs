//! Values of parameters, with the types that ROS 2 distinguishes.

use std::fmt;

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `true` or `false`.
    Bool(bool),
    /// A number without a point.
    Integer(i64),
    /// A number with a point or an exponent.
    Float(f64),
    /// Any other scalar.
    Text(String),
    /// A list of texts.
    TextList(Vec<String>),
}

impl Value {
    /// Returns the name of the type, for messages.
    pub(super) const fn kind(&self) -> &'static str {
        match self {
            Self::Bool(_) => "a boolean",
            Self::Integer(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Text(_) => "a text",
            Self::TextList(_) => "a list",
        }
    }
}

/// Writes YAML that reads back as the same type.
impl fmt::Display for Value {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(out, "{value}"),
            Self::Integer(value) => write!(out, "{value}"),
            // Debug keeps the point: 35.0, not 35.
            Self::Float(value) if value.is_finite() => write!(out, "{value:?}"),
            Self::Float(value) if value.is_nan() => write!(out, ".nan"),
            Self::Float(value) => write!(out, "{}.inf", if *value < 0.0 { "-" } else { "" }),
            Self::Text(value) => write_text(value, out),
            Self::TextList(values) => {
                for (index, value) in values.iter().enumerate() {
                    out.write_str(if index == 0 { "[" } else { ", " })?;
                    write_text(value, out)?;
                }
                out.write_str(if values.is_empty() { "[]" } else { "]" })
            }
        }
    }
}

fn write_text(text: &str, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    if is_plain(text) {
        return out.write_str(text);
    }
    // A JSON string is a YAML string.
    write!(out, "{}", serde_json::Value::from(text))
}

/// Returns true if YAML reads the text as a text without quotes.
fn is_plain(text: &str) -> bool {
    let word = text.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let special = ["true", "false", "null", "yes", "no", "on", "off", "y", "n", ""];
    word && !special.contains(&text)
}
