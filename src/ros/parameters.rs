//! The values in force: defaults < parameter files in order < `-p`, each checked against the table.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::{
    arguments::RosArguments,
    names::NodeNames,
    parameter_file::{self, FileError},
    table::{Kind, Parameter, TABLE},
    value::Value,
};

/// Why parameters are refused.
#[derive(Debug, Error)]
pub enum ParameterError {
    /// A file that is no parameter file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A name that is not declared.
    #[error("{origin}: no parameter is called {name:?}; {hint}")]
    Unknown {
        /// The name.
        name: String,
        /// Which file or option says so.
        origin: String,
        /// What was perhaps meant.
        hint: String,
    },
    /// A value of another type, out of range or not among the choices.
    #[error("{origin}: {name} is {value}, but must be {allowed}")]
    Value {
        /// The parameter.
        name: &'static str,
        /// What was given.
        value: String,
        /// What would be right.
        allowed: String,
        /// Which file or option says so.
        origin: String,
    },
    /// Values that contradict one another.
    #[error("{0}")]
    Conflict(String),
}

#[derive(Clone, Debug, PartialEq)]
struct Entry {
    value: Value,
    /// Which file or option set it; `None`: the default.
    origin: Option<String>,
    /// Where relative paths start; empty: the working directory.
    base: PathBuf,
}

/// One value for every parameter of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    entries: Vec<Entry>,
}

/// The defaults of the table.
impl Default for Parameters {
    fn default() -> Self {
        let entry = |parameter: &Parameter| Entry {
            value: parameter.default_value(),
            origin: None,
            base: PathBuf::new(),
        };
        Self { entries: TABLE.iter().map(entry).collect() }
    }
}

impl Parameters {
    /// The values for a node, from its parameter files and `-p`.
    ///
    /// Within the files, and again within `-p`, a section with the node's exact name beats a wildcard, and then the
    /// later one wins: the order that rcl's merged parameter tree has.
    ///
    /// # Errors
    /// The first file or value that is refused.
    pub fn load(node: &NodeNames, arguments: &RosArguments) -> Result<Self, ParameterError> {
        let mut values = Self::default();
        let fqn = node.fully_qualified();
        let mut settings = Vec::new();
        for path in &arguments.parameter_files {
            let file = parameter_file::read(path, &fqn)?;
            if !file.has_section {
                let (file, sections) = (path.display(), file.sections.join(", "));
                tracing::warn!(
                    "parameter file {file} says nothing about {fqn}: it has sections for [{sections}]"
                );
            }
            settings.extend(file.settings.into_iter().map(|setting| (path, setting)));
        }
        // Stable: the order of files stays within each half.
        settings.sort_by_key(|(_, setting)| setting.is_exact);
        for (path, setting) in settings {
            let base = path.parent().unwrap_or(Path::new("")).to_owned();
            let origin = format!("parameter file {}", path.display());
            values.put(&setting.name, setting.value, (origin, base))?;
        }

        let of_node = |node_name: &Option<String>| node_name.as_deref() == Some(node.name());
        let mut assignments: Vec<_> = arguments
            .assignments
            .iter()
            .filter(|assignment| assignment.node.is_none() || of_node(&assignment.node))
            .collect();
        assignments.sort_by_key(|assignment| assignment.node.is_some());
        for assignment in assignments {
            values.set(&assignment.name, assignment.value.clone(), "-p")?;
        }
        Ok(values)
    }

    /// Sets one value; `origin` says who set it, for messages.
    ///
    /// # Errors
    /// An undeclared name, another type, a value out of range.
    pub fn set(&mut self, name: &str, value: Value, origin: &str) -> Result<(), ParameterError> {
        self.put(name, value, (origin.to_owned(), PathBuf::new()))
    }

    fn put(
        &mut self,
        name: &str,
        value: Value,
        (origin, base): (String, PathBuf),
    ) -> Result<(), ParameterError> {
        let Some(index) = TABLE.iter().position(|parameter| parameter.name == name) else {
            return Err(ParameterError::Unknown {
                name: name.to_owned(),
                origin,
                hint: hint(name),
            });
        };
        if let Err(allowed) = TABLE[index].check(&value) {
            let value = match &value {
                Value::Text(text) => format!("{text:?}"),
                other => other.to_string(),
            };
            return Err(ParameterError::Value { name: TABLE[index].name, value, allowed, origin });
        }
        self.entries[index] = Entry { value, origin: Some(origin), base };
        Ok(())
    }

    /// Whether a file or option set this parameter.
    pub fn is_set(&self, name: &str) -> bool {
        self.entry(name).is_ok_and(|entry| entry.origin.is_some())
    }

    /// Name and value of every parameter, in the order of the table.
    pub fn iter(&self) -> impl Iterator<Item = (&'static Parameter, &Value)> {
        TABLE.iter().zip(&self.entries).map(|(parameter, entry)| (parameter, &entry.value))
    }

    /// The canonical text: a parameter file in the order of the table. Of paths only the file's name, so that the same
    /// settings give the same text on every machine.
    pub fn to_yaml(&self) -> String {
        let mut out = String::from("/**:\n  ros__parameters:\n");
        for (parameter, value) in self.iter() {
            let value = match (parameter.kind, value) {
                (Kind::Text { .. }, Value::Text(path)) => {
                    let name = Path::new(path).file_name().unwrap_or_default();
                    Value::Text(name.to_string_lossy().into_owned())
                }
                _ => value.clone(),
            };
            // Writing to a string cannot fail.
            _ = writeln!(out, "    {}: {value}", parameter.name);
        }
        out
    }

    /// SHA-256 of [`to_yaml`](Self::to_yaml), 64 hexadecimal digits.
    pub fn sha256(&self) -> String {
        let digest = Sha256::digest(self.to_yaml().as_bytes());
        digest.iter().fold(String::with_capacity(64), |mut out, byte| {
            _ = write!(out, "{byte:02x}");
            out
        })
    }

    fn entry(&self, name: &str) -> Result<&Entry, ParameterError> {
        let index = TABLE.iter().position(|parameter| parameter.name == name);
        index.and_then(|index| self.entries.get(index)).ok_or_else(|| ParameterError::Unknown {
            name: name.to_owned(),
            origin: "the program".to_owned(),
            hint: hint(name),
        })
    }

    pub(super) fn integer(&self, name: &str) -> Result<i64, ParameterError> {
        match self.entry(name)?.value {
            Value::Integer(value) => Ok(value),
            _ => Err(mistyped(name, "an integer")),
        }
    }

    pub(super) fn float(&self, name: &str) -> Result<f64, ParameterError> {
        match self.entry(name)?.value {
            Value::Float(value) => Ok(value),
            _ => Err(mistyped(name, "a float")),
        }
    }

    pub(super) fn choice<T>(
        &self,
        name: &str,
        from_name: impl Fn(&str) -> Option<T>,
    ) -> Result<T, ParameterError> {
        match &self.entry(name)?.value {
            Value::Text(text) => from_name(text).ok_or_else(|| mistyped(name, "a choice")),
            _ => Err(mistyped(name, "a choice")),
        }
    }

    /// A path, resolved against the file that sets it; `None` when empty.
    pub(super) fn path(&self, name: &str) -> Result<Option<PathBuf>, ParameterError> {
        match self.entry(name)? {
            Entry { value: Value::Text(text), base, .. } => {
                Ok((!text.is_empty()).then(|| base.join(text)))
            }
            _ => Err(mistyped(name, "a path")),
        }
    }
}

/// The table and the code that reads it disagree: a programming error, reported instead of a panic.
fn mistyped(name: &str, kind: &str) -> ParameterError {
    ParameterError::Conflict(format!("{name} is read as {kind}, but is not declared so"))
}

impl Parameter {
    /// The default as a value.
    pub fn default_value(&self) -> Value {
        match self.kind {
            Kind::Integer { default, .. } => Value::Integer(default),
            Kind::Float { default, .. } => Value::Float(default),
            Kind::Choice { default, .. } | Kind::Text { default } => {
                Value::Text(default.to_owned())
            }
        }
    }

    /// What values are allowed, in words.
    pub fn allowed(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" [{}]", self.unit) };
        match self.kind {
            Kind::Integer { min, max, .. } => format!("an integer from {min} to {max}{unit}"),
            Kind::Float { min, max, .. } => format!("a float from {min:?} to {max:?}{unit}"),
            Kind::Choice { names, .. } => format!("one of {}", names.join(", ")),
            Kind::Text { .. } => "a text".to_owned(),
        }
    }

    /// Whether the value is allowed; otherwise what would be.
    fn check(&self, value: &Value) -> Result<(), String> {
        let is_allowed = match (self.kind, value) {
            (Kind::Integer { min, max, .. }, Value::Integer(value)) => (min..=max).contains(value),
            // NaN is in no range.
            (Kind::Float { min, max, .. }, Value::Float(value)) => (min..=max).contains(value),
            (Kind::Choice { names, .. }, Value::Text(value)) => names.contains(&value.as_str()),
            (Kind::Text { .. }, Value::Text(_)) => true,
            // Strict as ROS is, but with a way out.
            (Kind::Float { .. }, Value::Integer(value)) => {
                return Err(format!("{}: write {value}.0", self.allowed()));
            }
            (_, other) => return Err(format!("{}, not {}", self.allowed(), other.kind())),
        };
        if is_allowed { Ok(()) } else { Err(self.allowed()) }
    }
}

/// Parameters whose last word is the same or begins alike; else where to find them all.
fn hint(name: &str) -> String {
    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
    let similar = TABLE.iter().find(|parameter| {
        let (given, declared) = (last(name), last(parameter.name));
        !given.is_empty() && (declared.starts_with(&given) || given.starts_with(&declared))
    });
    similar.map_or_else(
        || "`laser_profiler parameters` lists them".to_owned(),
        |parameter| {
            format!("did you mean {}? `laser_profiler parameters` lists them", parameter.name)
        },
    )
}

#[cfg(test)]
mod tests;
