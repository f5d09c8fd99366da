//! Parameters that are declared once: [`parameter_group!`](crate::parameter_group) makes a struct, its `Default`, its
//! table and its reader from one row per parameter.

mod group;
mod setting;
mod value;

pub use setting::Setting;
pub use value::Value;

use thiserror::Error;

/// Longest text of a parameter: the longest path that Linux accepts.
const MAX_TEXT_BYTES: usize = 4096;

/// Type, range and default of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// True or false.
    Bool {
        /// Default.
        default: bool,
    },
    /// A whole number.
    Integer {
        /// Default.
        default: i64,
        /// Smallest allowed value.
        min: i64,
        /// Largest allowed value.
        max: i64,
    },
    /// A finite number.
    Float {
        /// Default.
        default: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// One of several words.
    Choice {
        /// Default.
        default: &'static str,
        /// Allowed words.
        names: &'static [&'static str],
    },
    /// Any text.
    Text {
        /// Default.
        default: &'static str,
    },
    /// A list of texts; empty by default.
    TextList {
        /// Largest allowed number of texts.
        max_items: usize,
    },
}

/// A declared parameter: one row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name; levels are joined by dots.
    pub name: &'static str,
    /// Unit of the value; empty for words and plain counts.
    pub unit: &'static str,
    /// Type, range and default.
    pub kind: Kind,
    /// True if the value cannot change while the node runs.
    pub is_read_only: bool,
    /// Description: effect, cost, when to change it, a good value.
    pub text: &'static str,
}

/// A value that its parameter does not allow.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{name} must be {allowed}")]
pub struct NotAllowed {
    /// The parameter.
    pub name: &'static str,
    /// Description of the allowed values.
    pub allowed: String,
}

impl Parameter {
    /// Returns the default as a value.
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

    /// Describes the allowed values.
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

    /// Checks type and range of a value.
    ///
    /// # Errors
    /// A description of the allowed values.
    pub fn check(&self, value: &Value) -> Result<(), String> {
        let is_allowed = match (self.kind, value) {
            (Kind::Integer { min, max, .. }, Value::Integer(value)) => (min..=max).contains(value),
            // NaN is in no range.
            (Kind::Float { min, max, .. }, Value::Float(value)) => (min..=max).contains(value),
            (Kind::Choice { names, .. }, Value::Text(value)) => names.contains(&value.as_str()),
            (Kind::Bool { .. }, Value::Bool(_)) => true,
            (Kind::Text { .. }, Value::Text(text)) => text.len() <= MAX_TEXT_BYTES,
            (Kind::TextList { max_items }, Value::TextList(texts)) => texts.len() <= max_items,
            // ROS does not convert integers to floats; the message says how to write the value.
            (Kind::Float { .. }, Value::Integer(value)) => {
                return Err(format!("{}: write {value}.0", self.allowed()));
            }
            (_, other) => return Err(format!("{}, not {}", self.allowed(), other.kind())),
        };
        if is_allowed { Ok(()) } else { Err(self.allowed()) }
    }

    /// Checks a value, if there is one.
    ///
    /// # Errors
    /// The value is not allowed.
    #[doc(hidden)]
    pub fn check_found(&self, value: Option<&Value>) -> Result<(), NotAllowed> {
        let checked = value.map_or(Ok(()), |value| self.check(value));
        checked.map_err(|allowed| NotAllowed { name: self.name, allowed })
    }
}
