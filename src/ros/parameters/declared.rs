//! A parameter that the node has, and the readers that take the values of one owner into types.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use crate::ros::{
    table::{Kind, Parameter},
    value::Value,
};

use super::ParameterError;

/// A row of the table under its full name, and its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Declared {
    pub(super) name: String,
    pub(super) row: &'static Parameter,
    pub(super) value: Value,
    /// Which file or option set it; `None`: the default.
    pub(super) origin: Option<String>,
    /// Where relative paths start; empty: the working directory.
    pub(super) base: PathBuf,
}

impl Declared {
    /// A row with its default, under a name of its own where a camera or a topic has it.
    pub(super) fn new(name: String, row: &'static Parameter) -> Self {
        Self { name, row, value: row.default_value(), origin: None, base: PathBuf::new() }
    }

    /// Its full name: of a camera among several, the camera's name and a dot stand before the row's.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its declaration.
    pub const fn row(&self) -> &'static Parameter {
        self.row
    }

    /// Its value.
    pub const fn value(&self) -> &Value {
        &self.value
    }

    /// The value in the canonical text: of paths only the file's name, so that the same settings give the same text on
    /// every machine.
    pub(super) fn canonical(&self) -> impl fmt::Display {
        match (self.row.kind, &self.value) {
            (Kind::Text { .. }, Value::Text(path)) => {
                let path = Path::new(path);
                let name = path.file_name().unwrap_or(path.as_os_str());
                Value::Text(name.to_string_lossy().into_owned())
            }
            _ => self.value.clone(),
        }
    }
}

/// The values of the node itself or of one camera, by the names in the table.
#[derive(Clone, Copy, Debug)]
pub(in crate::ros) struct Section<'a>(pub(super) &'a [Declared]);

impl<'a> Section<'a> {
    fn entry(self, name: &str) -> Result<&'a Declared, ParameterError> {
        let found = self.0.iter().find(|declared| declared.row.name == name);
        found.ok_or_else(|| mistyped(name, "a parameter"))
    }

    /// Whether a file or option set this parameter.
    pub(in crate::ros) fn is_set(self, name: &str) -> bool {
        self.entry(name).is_ok_and(|declared| declared.origin.is_some())
    }

    pub(in crate::ros) fn flag(self, name: &str) -> Result<bool, ParameterError> {
        match self.entry(name)?.value {
            Value::Bool(value) => Ok(value),
            _ => Err(mistyped(name, "a boolean")),
        }
    }

    pub(in crate::ros) fn integer(self, name: &str) -> Result<i64, ParameterError> {
        match self.entry(name)?.value {
            Value::Integer(value) => Ok(value),
            _ => Err(mistyped(name, "an integer")),
        }
    }

    /// An integer whose range begins at 0 or above.
    pub(in crate::ros) fn unsigned(self, name: &str) -> Result<u64, ParameterError> {
        u64::try_from(self.integer(name)?).or(Err(mistyped(name, "an unsigned integer")))
    }

    pub(in crate::ros) fn float(self, name: &str) -> Result<f64, ParameterError> {
        match self.entry(name)?.value {
            Value::Float(value) => Ok(value),
            _ => Err(mistyped(name, "a float")),
        }
    }

    pub(in crate::ros) fn choice<T>(
        self,
        name: &str,
        from_name: impl Fn(&str) -> Option<T>,
    ) -> Result<T, ParameterError> {
        match &self.entry(name)?.value {
            Value::Text(text) => from_name(text).ok_or_else(|| mistyped(name, "a choice")),
            _ => Err(mistyped(name, "a choice")),
        }
    }

    /// A text.
    pub(in crate::ros) fn text(self, name: &str) -> Result<&'a str, ParameterError> {
        match &self.entry(name)?.value {
            Value::Text(text) => Ok(text),
            _ => Err(mistyped(name, "a text")),
        }
    }

    /// A path as it was given.
    pub(in crate::ros) fn path(self, name: &str) -> Result<PathBuf, ParameterError> {
        match &self.entry(name)?.value {
            Value::Text(text) => Ok(PathBuf::from(text)),
            _ => Err(mistyped(name, "a path")),
        }
    }

    /// A path, resolved against the file that sets it; `None` when empty.
    pub(in crate::ros) fn file(self, name: &str) -> Result<Option<PathBuf>, ParameterError> {
        let path = self.path(name)?;
        let base = &self.entry(name)?.base;
        Ok((!path.as_os_str().is_empty()).then(|| base.join(path)))
    }
}

/// The table and the code that reads it disagree: a programming error, reported instead of a panic.
fn mistyped(name: &str, kind: &str) -> ParameterError {
    ParameterError::Conflict(format!("{name} is read as {kind}, but is not declared so"))
}
