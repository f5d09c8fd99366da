//! `laser_profiler parameters`: the reference of the parameters, as a loadable parameter file.

use std::{
    fmt::Write as _,
    io::{self, Write},
};

use serde_json::{Value as Json, json};

use super::{Outcome, output};
use crate::ros::{
    parameters::Parameters,
    table::{CAMERA, Kind, NODE, Parameter},
};

const HELP: &str = "\
Examples:
  laser_profiler parameters > rig.yaml      edit it, then:
  laser_profiler replay my_recording -o results --params-file rig.yaml";

/// Prints all parameters with description, unit, range and default, as a parameter file.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct ParametersArgs {
    /// One JSON array on standard output: name, type, unit, default, min and max or choices, description.
    #[arg(long)]
    pub(crate) json: bool,
}

const WIDTH: usize = 100;

/// Prints the table on `out`.
///
/// # Errors
/// Standard output cannot be written. A closed pipe is not an error.
pub(crate) fn run(args: &ParametersArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    output::printed(if args.json { print_json(out) } else { print_file(out) })?;
    Ok(Outcome::Done)
}

fn print_json(out: &mut dyn Write) -> io::Result<()> {
    let of = |scope| move |row| json_entry(row, scope);
    let entries: Vec<_> =
        NODE.iter().map(of("node")).chain(CAMERA.iter().map(of("camera"))).collect();
    serde_json::to_writer_pretty(&mut *out, &entries)?;
    writeln!(out)
}

fn json_entry(parameter: &Parameter, scope: &str) -> Json {
    let Parameter { name, unit, kind, is_read_only, text } = parameter;
    let own = match kind {
        Kind::Bool { default } => json!({"type": "bool", "default": default}),
        Kind::Integer { default, min, max } => {
            json!({"type": "integer", "default": default, "min": min, "max": max})
        }
        Kind::Float { default, min, max } => {
            json!({"type": "double", "default": default, "min": min, "max": max})
        }
        Kind::Choice { default, names } => {
            json!({"type": "string", "default": default, "choices": names})
        }
        Kind::Text { default } => json!({"type": "string", "default": default}),
        Kind::TextList { max_items } => {
            json!({"type": "string_array", "default": [], "max_items": max_items})
        }
    };
    let mut entry = json!({
        "name": name, "scope": scope, "read_only": is_read_only, "unit": unit, "description": text
    });
    if let (Json::Object(entry), Json::Object(own)) = (&mut entry, own) {
        entry.extend(own);
    }
    entry
}

fn print_file(out: &mut dyn Write) -> io::Result<()> {
    out.write_all(parameter_file().as_bytes())
}

/// Writes the defaults as a parameter file with comments.
fn parameter_file() -> String {
    let mut out = String::from("/**:\n  ros__parameters:\n");
    let mut open_group = "";
    for declared in Parameters::default().iter() {
        let (parameter, value) = (declared.row(), declared.value());
        let (group, key) = parameter.name.rsplit_once('.').unwrap_or(("", parameter.name));
        out.push('\n');
        if group != open_group && !group.is_empty() {
            _ = writeln!(out, "    {group}:");
        }
        open_group = group;
        let indent = if group.is_empty() { "    " } else { "      " };
        for line in wrap(parameter.text, WIDTH - indent.len() - 2) {
            _ = writeln!(out, "{indent}# {line}");
        }
        let fixed = if parameter.is_read_only { "; only at the start" } else { "" };
        _ = writeln!(out, "{indent}# {}; default {value}{fixed}", parameter.allowed());
        _ = writeln!(out, "{indent}{key}: {value}");
    }
    out
}

fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.len() + 1 + word.len() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::{
        arguments::RosArguments, names::NodeNames, parameters::Declared, value::Value,
    };

    #[test]
    fn the_printed_file_loads_and_gives_the_defaults() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        run(&ParametersArgs { json: false }, &mut file).unwrap();
        let arguments =
            RosArguments { parameter_files: vec![file.path().to_owned()], ..Default::default() };
        let names = NodeNames::new("laser_profiler", &[]).unwrap();
        let loaded = Parameters::load(&names, &arguments).unwrap();
        let defaults = Parameters::default();
        assert!(
            loaded.iter().all(|declared| loaded.is_set(declared.name())),
            "each one is in the file"
        );
        assert!(loaded.iter().map(Declared::value).eq(defaults.iter().map(Declared::value)));
        let lines = std::fs::read_to_string(file.path()).unwrap();
        assert!(lines.lines().all(|line| line.len() <= 2 * WIDTH), "wrapped");
    }

    #[test]
    fn the_json_names_every_parameter_and_its_default() {
        let mut out = Vec::new();
        run(&ParametersArgs { json: true }, &mut out).unwrap();
        let entries: Vec<Json> = serde_json::from_slice(&out).unwrap();
        assert_eq!(entries.len(), Parameters::default().iter().count());
        for (entry, declared) in entries.iter().zip(Parameters::default().iter()) {
            assert_eq!(entry["name"], declared.name());
            let default = match declared.value() {
                Value::Integer(value) => json!(value),
                Value::Float(value) => json!(value),
                Value::Bool(value) => json!(value),
                Value::Text(value) => json!(value),
                Value::TextList(value) => json!(value),
            };
            assert_eq!(entry["default"], default, "{}", declared.name());
        }
    }
}
