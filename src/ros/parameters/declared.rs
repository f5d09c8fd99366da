//! A declared parameter, and access to the values of the node or of one camera.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use laser_triangulation::parameters::{Kind, Parameter, Setting, Value};

/// A row of the table with its full name and value.
#[derive(Clone, Debug, PartialEq)]
pub struct Declared {
    pub(super) name: String,
    pub(super) row: &'static Parameter,
    pub(super) value: Value,
    /// File or option that set it; `None`: the default.
    pub(super) origin: Option<String>,
    /// Base of relative paths; empty: the working directory.
    pub(super) base: PathBuf,
}

impl Declared {
    /// Declares a row with its default; `name` is the full name, which differs from the row's for cameras and topics.
    pub(super) fn new(name: String, row: &'static Parameter) -> Self {
        Self { name, row, value: row.default_value(), origin: None, base: PathBuf::new() }
    }

    /// Returns the full name: the row's, after the camera's name and a dot if there are several cameras.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the declaration.
    pub const fn row(&self) -> &'static Parameter {
        self.row
    }

    /// Returns the value.
    pub const fn value(&self) -> &Value {
        &self.value
    }

    /// Returns the directory that relative paths in the value start at; empty for the working directory.
    pub(crate) fn base(&self) -> &Path {
        &self.base
    }

    /// Returns the value in the canonical text. Paths are reduced to file names, so that the same settings give the
    /// same text on every machine.
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

/// Values of the node itself or of one camera, by the names in the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section<'a>(pub(super) &'a [Declared]);

impl<'a> Section<'a> {
    fn entry(self, name: &str) -> Option<&'a Declared> {
        self.0.iter().find(|declared| declared.row.name == name)
    }

    /// Returns the value of a parameter.
    pub(super) fn value(self, name: &str) -> Option<&'a Value> {
        self.entry(name).map(Declared::value)
    }

    /// Returns true if a file or option set this parameter.
    pub(super) fn is_set(self, name: &str) -> bool {
        self.entry(name).is_some_and(|declared| declared.origin.is_some())
    }

    /// Returns a path, resolved against the file that sets it; `None` if it is empty.
    pub(super) fn file(self, name: &str) -> Option<PathBuf> {
        let declared = self.entry(name)?;
        let path: Option<PathBuf> = Setting::from_value(&declared.value)?;
        path.map(|path| declared.base.join(path))
    }
}
