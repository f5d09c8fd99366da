//! Values in force: defaults, overridden by parameter files in order, then by `-p`; each is checked against the table.

mod declared;
mod hint;
mod received;
mod typed;

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use laser_triangulation::parameters::NotAllowed;
use ros2args::names;
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::{
    arguments::RosArguments,
    names::NodeNames,
    parameter_file::{self, FileError, Setting},
    qos_overrides,
    table::{CAMERA, CAMERAS, NODE},
    value::Value,
};
pub(crate) use declared::Declared;
use declared::Section;

/// Largest length of a camera's name, bytes.
const MAX_CAMERA_NAME_BYTES: usize = 64;

/// Largest number of characters of a value in an error.
const MAX_SHOWN: usize = 80;

/// Errors in parameters.
#[derive(Debug, Error)]
pub enum ParameterError {
    /// An invalid parameter file.
    #[error(transparent)]
    File(#[from] FileError),
    /// An undeclared name.
    #[error("{origin}: no parameter is called {name:?}; {hint}")]
    Unknown {
        /// Name of the parameter.
        name: String,
        /// File or option that sets it.
        origin: String,
        /// Suggested correction.
        hint: String,
    },
    /// A value of the wrong type, out of range or not among the choices.
    #[error("{origin}: {name} is {value}, but must be {allowed}")]
    Value {
        /// Name of the parameter.
        name: String,
        /// Rejected value.
        value: String,
        /// Allowed values.
        allowed: String,
        /// File or option that sets it.
        origin: String,
    },
    /// A parameter that is read-only while the node runs.
    #[error("{origin}: {name} is read-only: set it when starting the node")]
    ReadOnly {
        /// Name of the parameter.
        name: String,
        /// Source of the request.
        origin: String,
    },
    /// Values that contradict each other.
    #[error("{0}")]
    Conflict(String),
    /// A value that its parameter does not allow.
    #[error(transparent)]
    NotAllowed(#[from] NotAllowed),
}

/// Values of all parameters: those of the node, then those of each camera, then overrides of quality of service.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    declared: Vec<Declared>,
    /// Names of the cameras; empty for a single camera without a name.
    cameras: Vec<String>,
}

/// Defaults of the table, for one camera without a name.
impl Default for Parameters {
    fn default() -> Self {
        let rows = NODE.iter().chain(CAMERA.iter());
        let declared = rows.map(|row| Declared::new(row.name.to_owned(), row)).collect();
        Self { declared, cameras: vec![String::new()] }
    }
}

/// Source of a value.
struct Origin {
    /// Its name in errors.
    name: String,
    /// Directory that relative paths start at; empty for the working directory.
    base: PathBuf,
}

impl Origin {
    fn without_base(name: &str) -> Self {
        Self { name: name.to_owned(), base: PathBuf::new() }
    }
}

impl Parameters {
    /// Loads the values for a node from its parameter files and `-p`.
    ///
    /// Within the files, and likewise within `-p`, a section with the node's exact name takes precedence over a
    /// wildcard, then the later one over the earlier: the order of rcl's merged parameter tree.
    ///
    /// # Errors
    /// The first invalid file or value.
    pub fn load(node: &NodeNames, arguments: &RosArguments) -> Result<Self, ParameterError> {
        let mut values = Self::default();
        let fqn = node.fully_qualified();
        let mut settings = Vec::new();
        for path in &arguments.parameter_files {
            let file = parameter_file::read(path, &fqn)?;
            if !file.has_section {
                let (file, sections) = (path.display(), file.sections.join(", "));
                tracing::warn!(
                    "parameter file {file} has no section for {fqn}, only for [{sections}]"
                );
            }
            settings.extend(file.settings.into_iter().map(|setting| (path, setting)));
        }
        // Stable sort: keeps the order of files within each half.
        settings.sort_by_key(|(_, setting)| setting.is_exact);
        let in_file = |(path, setting): (&PathBuf, Setting)| {
            let base = path.parent().unwrap_or(Path::new("")).to_owned();
            let name = format!("parameter file {}", path.display());
            (setting.name, setting.value, Origin { name, base })
        };
        let mut settings: Vec<_> = settings.into_iter().map(in_file).collect();

        let of_node = |node_name: &Option<String>| node_name.as_deref() == Some(node.name());
        let mut assignments: Vec<_> = arguments
            .assignments
            .iter()
            .filter(|assignment| assignment.node.is_none() || of_node(&assignment.node))
            .collect();
        assignments.sort_by_key(|assignment| assignment.node.is_some());
        settings.extend(assignments.into_iter().map(|assignment| {
            (assignment.name.clone(), assignment.value.clone(), Origin::without_base("-p"))
        }));
        // First `cameras`, which declares further parameters.
        settings.sort_by_key(|(name, ..)| name != CAMERAS);
        for (name, value, origin) in settings {
            values.put(&name, value, origin)?;
        }
        Ok(values)
    }

    /// Sets one value; `origin` names its source in errors. Setting `cameras` declares the parameters of each camera
    /// and removes those of cameras no longer listed.
    ///
    /// # Errors
    /// An undeclared name, a wrong type or a value out of range.
    pub(crate) fn set(
        &mut self,
        name: &str,
        value: Value,
        origin: &str,
    ) -> Result<(), ParameterError> {
        self.put(name, value, Origin::without_base(origin))
    }

    /// Sets one value of a running node, as a peer sent it, like [`set`](Self::set). A text that is a number counts as
    /// one where a float is needed. A read-only parameter may be set to the value that it has, as in a dump of this node.
    ///
    /// # Errors
    /// Those of [`set`](Self::set), and another value of a read-only parameter.
    pub(crate) fn change(
        &mut self,
        name: &str,
        value: Value,
        origin: &str,
    ) -> Result<(), ParameterError> {
        let Some(declared) = self.get(name) else {
            return Err(unknown(name, origin, self.hint(name)));
        };
        let value = received::meant(declared.row.kind, value);
        if !declared.row.is_read_only {
            return self.set(name, value, origin);
        }
        if declared.value == value {
            return Ok(());
        }
        Err(ParameterError::ReadOnly { name: name.to_owned(), origin: origin.to_owned() })
    }

    fn put(&mut self, name: &str, value: Value, origin: Origin) -> Result<(), ParameterError> {
        let Origin { name: origin, base } = origin;
        let found = self.declared.iter().position(|declared| declared.name == name);
        let row = match found {
            Some(index) => self.declared[index].row,
            None if name.starts_with(qos_overrides::PREFIX) => {
                qos_overrides::row(name).map_err(|hint| unknown(name, &origin, hint))?
            }
            None => return Err(unknown(name, &origin, self.hint(name))),
        };
        let mut checked = row.check(&value);
        if let (true, Ok(()), Value::TextList(names)) = (name == CAMERAS, &checked, &value) {
            checked = self.declare_cameras(names);
        }
        if let Err(allowed) = checked {
            let (name, value) = (name.to_owned(), shown(&value));
            return Err(ParameterError::Value { name, value, allowed, origin });
        }
        let declared =
            Declared { value, origin: Some(origin), base, ..Declared::new(name.to_owned(), row) };
        match found {
            Some(index) => self.declared[index] = declared,
            None => self.insert_override(declared),
        }
        Ok(())
    }

    /// Inserts an override: they come last, sorted by name.
    fn insert_override(&mut self, declared: Declared) {
        let first = NODE.len() + self.cameras.len() * CAMERA.len();
        let place = self.declared[first..].partition_point(|other| other.name < declared.name);
        self.declared.insert(first + place, declared);
    }

    /// Replaces the parameters of the cameras; those of cameras that remain keep their values.
    fn declare_cameras(&mut self, names: &[String]) -> Result<(), String> {
        check_cameras(names)?;
        let unnamed = [String::new()];
        let names = if names.is_empty() { &unnamed } else { names };
        let first = NODE.len();
        let end = first + self.cameras.len() * CAMERA.len();
        let before: Vec<_> = self.declared[first..end].to_vec();
        let full_name = |camera: &String, row: &str| match camera.as_str() {
            "" => row.to_owned(),
            camera => format!("{camera}.{row}"),
        };
        let of_camera = |camera| CAMERA.iter().map(move |row| (full_name(camera, row.name), row));
        let after: Vec<_> = names
            .iter()
            .flat_map(of_camera)
            .map(|(name, row)| {
                let kept = before.iter().find(|declared| declared.name == name);
                kept.cloned().unwrap_or_else(|| Declared::new(name, row))
            })
            .collect();
        self.declared.splice(first..end, after);
        self.cameras = names.to_vec();
        Ok(())
    }

    /// Returns the names of the cameras, at least one; empty for a single camera without a name.
    pub(crate) fn cameras(&self) -> &[String] {
        &self.cameras
    }

    /// Iterates over all parameters: those of the node and of each camera in the order of their tables, then overrides
    /// of quality of service by name.
    pub fn iter(&self) -> impl Iterator<Item = &Declared> {
        self.declared.iter()
    }

    /// Returns the parameter with that full name.
    pub(crate) fn get(&self, name: &str) -> Option<&Declared> {
        self.declared.iter().find(|declared| declared.name == name)
    }

    /// Returns true if a file or option set this parameter.
    pub(crate) fn is_set(&self, name: &str) -> bool {
        self.get(name).is_some_and(|declared| declared.origin.is_some())
    }

    /// Returns the canonical text: a parameter file in the order of [`iter`](Self::iter). Paths are reduced to file
    /// names, so that the same settings give the same text on every machine.
    pub(crate) fn to_yaml(&self) -> String {
        to_yaml(self.iter().map(|declared| (declared.name(), declared)))
    }

    /// Returns the canonical text of the parameters that determine the results of one camera, under the names of a
    /// camera without a name. It depends neither on the camera's name nor on the recording.
    pub(crate) fn camera_yaml(&self, camera: &str) -> String {
        let Section(declared) = self.of_camera(camera);
        to_yaml(declared.iter().map(|declared| (declared.row.name, declared)))
    }

    /// Returns the SHA-256 of [`camera_yaml`](Self::camera_yaml), 64 hexadecimal digits.
    pub(crate) fn camera_sha256(&self, camera: &str) -> String {
        let digest = Sha256::digest(self.camera_yaml(camera).as_bytes());
        digest.iter().fold(String::with_capacity(64), |mut out, byte| {
            _ = write!(out, "{byte:02x}");
            out
        })
    }

    /// Returns the values of the node.
    fn of_node(&self) -> Section<'_> {
        Section(&self.declared[..NODE.len()])
    }

    /// Returns the values of a camera; empty for an unknown camera.
    fn of_camera(&self, camera: &str) -> Section<'_> {
        let index = self.cameras.iter().position(|name| name == camera);
        Section(index.map_or(&[], |index| {
            &self.declared[NODE.len() + index * CAMERA.len()..][..CAMERA.len()]
        }))
    }
}

fn to_yaml<'a>(values: impl Iterator<Item = (&'a str, &'a Declared)>) -> String {
    let mut out = String::from("/**:\n  ros__parameters:\n");
    for (name, declared) in values {
        // Writing to a string cannot fail.
        _ = writeln!(out, "    {name}: {}", declared.canonical());
    }
    out
}

/// Formats a value for errors: texts in quotes, long ones truncated.
fn shown(value: &Value) -> String {
    let text = match value {
        Value::Text(text) => format!("{text:?}"),
        other => other.to_string(),
    };
    match text.char_indices().nth(MAX_SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

fn unknown(name: &str, origin: &str, hint: String) -> ParameterError {
    ParameterError::Unknown { name: name.to_owned(), origin: origin.to_owned(), hint }
}

/// Checks names of cameras: each becomes part of the names of topics and parameters.
fn check_cameras(names: &[String]) -> Result<(), String> {
    let is_taken = |name: &str| {
        NODE.iter().any(|row| row.name.split('.').next() == Some(name))
            || qos_overrides::PREFIX.strip_suffix('.') == Some(name)
    };
    let is_good = |(index, name): (usize, &String)| {
        name.len() <= MAX_CAMERA_NAME_BYTES
            && names::validate_node_name(name).is_ok()
            && !is_taken(name)
            && !names[..index].contains(name)
    };
    if names.iter().enumerate().all(is_good) {
        return Ok(());
    }
    Err(format!(
        "a list of unique names of letters, digits and _, at most {MAX_CAMERA_NAME_BYTES} bytes long, not starting with \
         a digit and not the name of a parameter of the node; empty for one camera without a name"
    ))
}

#[cfg(test)]
mod tests;
