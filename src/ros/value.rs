//! A parameter's value as it stands in YAML, with the types that ROS tells apart.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

/// One value.
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
    /// Texts in their order.
    TextList(Vec<String>),
}

impl Value {
    /// The type's name, for messages.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Bool(_) => "a boolean",
            Self::Integer(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Text(_) => "a text",
            Self::TextList(_) => "a list",
        }
    }
}

/// As YAML reads it back with the same type.
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

/// Words that YAML cannot take for anything but text.
fn is_plain(text: &str) -> bool {
    let word = text.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let special = ["true", "false", "null", "yes", "no", "on", "off", "y", "n", ""];
    word && !special.contains(&text)
}

/// A node of a YAML document: mappings in their order.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Yaml {
    Null,
    Scalar(Value),
    Sequence(Vec<Self>),
    Mapping(Vec<(String, Self)>),
}

impl<'de> Deserialize<'de> for Yaml {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(YamlVisitor)
    }
}

struct YamlVisitor;

impl<'de> Visitor<'de> for YamlVisitor {
    type Value = Yaml;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "a mapping or a scalar")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(Value::Bool(value)))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(Value::Integer(value)))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Yaml, E> {
        let fits = i64::try_from(value);
        fits.map(|value| Yaml::Scalar(Value::Integer(value))).map_err(E::custom)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(Value::Float(value)))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Yaml, E> {
        Ok(Yaml::Scalar(Value::Text(value.to_owned())))
    }

    fn visit_unit<E: Error>(self) -> Result<Yaml, E> {
        Ok(Yaml::Null)
    }

    fn visit_none<E: Error>(self) -> Result<Yaml, E> {
        Ok(Yaml::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Yaml, D::Error> {
        Yaml::deserialize(deserializer)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Yaml, A::Error> {
        let mut sequence = Vec::new();
        while let Some(element) = elements.next_element()? {
            sequence.push(element);
        }
        Ok(Yaml::Sequence(sequence))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Yaml, A::Error> {
        let mut mapping: Vec<(String, Yaml)> = Vec::new();
        while let Some((key, value)) = entries.next_entry::<String, Yaml>()? {
            if mapping.iter().any(|(earlier, _)| *earlier == key) {
                return Err(A::Error::custom(format!("key {key:?} stands twice in one mapping")));
            }
            mapping.push((key, value));
        }
        Ok(Yaml::Mapping(mapping))
    }
}
