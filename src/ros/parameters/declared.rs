//! A parameter that the node has, and the readers that take the values of one owner into types.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use laser_triangulation::parameters::{Kind, Parameter, Setting, Value};

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
    pub(crate) fn name(&self) -> &str {
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
    fn entry(self, name: &str) -> Option<&'a Declared> {
        self.0.iter().find(|declared| declared.row.name == name)
    }

    /// Returns the value of a parameter.
    pub(in crate::ros) fn value(self, name: &str) -> Option<&'a Value> {
        self.entry(name).map(Declared::value)
    }

    /// Returns true if a file or option set this parameter.
    pub(in crate::ros) fn is_set(self, name: &str) -> bool {
        self.entry(name).is_some_and(|declared| declared.origin.is_some())
    }

    /// Returns a path, resolved against the file that sets it; `None` if it is empty.
    pub(in crate::ros) fn file(self, name: &str) -> Option<PathBuf> {
        let declared = self.entry(name)?;
        let path: Option<PathBuf> = Setting::from_value(&declared.value)?;
        path.map(|path| declared.base.join(path))
    }
}
