//! How parameters are declared: name, unit, type, range, default and what they do.
//!
//! Defaults and ranges stand in the two tables here and nowhere else; [`node_params`](super::node_params) and
//! [`camera_params`](super::camera_params) turn the values into types.

pub mod node;
pub mod camera;

use super::value::Value;

/// Longest text of a parameter: as long as a path may be.
const MAX_TEXT_BYTES: usize = 4096;

/// Type, range and default of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Yes or no.
    Bool {
        /// Value when nothing else is said.
        default: bool,
    },
    /// A whole number.
    Integer {
        /// Value when nothing else is said.
        default: i64,
        /// Smallest value allowed.
        min: i64,
        /// Largest value allowed.
        max: i64,
    },
    /// A finite number.
    Float {
        /// Value when nothing else is said.
        default: f64,
        /// Smallest value allowed.
        min: f64,
        /// Largest value allowed.
        max: f64,
    },
    /// One of some words.
    Choice {
        /// Word when nothing else is said.
        default: &'static str,
        /// Words allowed.
        names: &'static [&'static str],
    },
    /// Any text.
    Text {
        /// Text when nothing else is said.
        default: &'static str,
    },
    /// A list of texts, empty when nothing else is said.
    TextList {
        /// Most texts allowed.
        max_items: usize,
    },
}

/// A declared parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name, levels joined by dots; without the name of a camera.
    pub name: &'static str,
    /// Unit of the value; empty for words and counts without one.
    pub unit: &'static str,
    /// Type, range and default.
    pub kind: Kind,
    /// Whether it stands fast once the node runs.
    pub is_read_only: bool,
    /// What it does, what it costs, when to change it, a good value.
    pub text: &'static str,
}

impl Parameter {
    /// The default as a value.
    pub fn default_value(&self) -> Value {
        match self.kind {
            Kind::Bool { default } => Value::Bool(default),
            Kind::Integer { default, .. } => Value::Integer(default),
            Kind::Float { default, .. } => Value::Float(default),
            Kind::Choice { default, .. } | Kind::Text { default } => {
                Value::Text(default.to_owned())
            }
            Kind::TextList { .. } => Value::TextList(Vec::new()),
        }
    }

    /// What values are allowed, in words.
    pub fn allowed(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" [{}]", self.unit) };
        match self.kind {
            Kind::Bool { .. } => "true or false".to_owned(),
            Kind::Integer { min, max, .. } => format!("an integer from {min} to {max}{unit}"),
            Kind::Float { min, max, .. } => format!("a float from {min:?} to {max:?}{unit}"),
            Kind::Choice { names, .. } => format!("one of {}", names.join(", ")),
            Kind::Text { .. } => format!("a text of at most {MAX_TEXT_BYTES} bytes"),
            Kind::TextList { max_items } => format!("a list of at most {max_items} texts"),
        }
    }

    /// Whether the value is allowed.
    ///
    /// # Errors
    /// What would be allowed, in words.
    pub fn check(&self, value: &Value) -> Result<(), String> {
        let is_allowed = match (self.kind, value) {
            (Kind::Integer { min, max, .. }, Value::Integer(value)) => (min..=max).contains(value),
            // NaN is in no range.
            (Kind::Float { min, max, .. }, Value::Float(value)) => (min..=max).contains(value),
            (Kind::Choice { names, .. }, Value::Text(value)) => names.contains(&value.as_str()),
            (Kind::Bool { .. }, Value::Bool(_)) => true,
            (Kind::Text { .. }, Value::Text(text)) => text.len() <= MAX_TEXT_BYTES,
            (Kind::TextList { max_items }, Value::TextList(texts)) => texts.len() <= max_items,
            // Strict as ROS is, but with a way out.
            (Kind::Float { .. }, Value::Integer(value)) => {
                return Err(format!("{}: write {value}.0", self.allowed()));
            }
            (_, other) => return Err(format!("{}, not {}", self.allowed(), other.kind())),
        };
        if is_allowed { Ok(()) } else { Err(self.allowed()) }
    }

    const fn read_only(self) -> Self {
        Self { is_read_only: true, ..self }
    }
}

const MIB: i64 = 1 << 20;

const fn parameter(
    name: &'static str,
    unit: &'static str,
    kind: Kind,
    text: &'static str,
) -> Parameter {
    Parameter { name, unit, kind, is_read_only: false, text }
}

const ON: Kind = Kind::Bool { default: true };
const OFF: Kind = Kind::Bool { default: false };

/// `default` is [`ON`] or [`OFF`].
const fn flag(name: &'static str, default: Kind, text: &'static str) -> Parameter {
    parameter(name, "", default, text)
}

const fn choice(
    name: &'static str,
    default: &'static str,
    names: &'static [&'static str],
    text: &'static str,
) -> Parameter {
    parameter(name, "", Kind::Choice { default, names }, text)
}

const fn integer(
    name: &'static str,
    unit: &'static str,
    (default, min, max): (i64, i64, i64),
    text: &'static str,
) -> Parameter {
    parameter(name, unit, Kind::Integer { default, min, max }, text)
}

const fn float(
    name: &'static str,
    unit: &'static str,
    (default, min, max): (f64, f64, f64),
    text: &'static str,
) -> Parameter {
    parameter(name, unit, Kind::Float { default, min, max }, text)
}

const fn text(name: &'static str, default: &'static str, text: &'static str) -> Parameter {
    parameter(name, "", Kind::Text { default }, text)
}

const fn text_list(name: &'static str, max_items: usize, text: &'static str) -> Parameter {
    parameter(name, "", Kind::TextList { max_items }, text)
}
