//! ROS 2 parameter files: their values for one node.
//!
//! `ros2args::parse_param_file` is not used: it supports neither nested parameters nor nested namespaces, treats `foo*`
//! as a literal name and silently ignores a second document. Its wildcard matching is used.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use serde_saphyr::options::NonFiniteFloatPolicy;
use thiserror::Error;

use super::value::{Value, Yaml};

/// Largest accepted file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 20;
/// References in a file. ROS itself allows none.
const MAX_ALIASES: usize = 100;

/// Errors of parameter files.
#[derive(Debug, Error)]
pub enum FileError {
    /// The file cannot be read.
    #[error("parameter file {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is not a parameter file.
    #[error("parameter file {}: {reason}", path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Problem and valid content.
        reason: String,
    },
}

/// One parameter in a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    /// Full name, levels joined by dots.
    pub(crate) name: String,
    /// Value of the parameter.
    pub(crate) value: Value,
    /// True if the section names the node exactly, without a wildcard.
    pub(crate) is_exact: bool,
}

/// Settings of a file for one node.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FileSettings {
    /// Parameters in the order of the file.
    pub(crate) settings: Vec<Setting>,
    /// Names of all sections, for a warning if none matches.
    pub(crate) sections: Vec<String>,
    /// True if a section matches this node.
    pub(crate) has_section: bool,
}

/// Reads the sections of `path` that match the fully qualified name `node`.
///
/// # Errors
/// The file cannot be read, is larger than 1 MiB or is not a parameter file.
pub(crate) fn read(path: &Path, node: &str) -> Result<FileSettings, FileError> {
    let read = |source| FileError::Read { path: path.to_owned(), source };
    let content = |reason| FileError::Content { path: path.to_owned(), reason };
    let size = std::fs::metadata(path).map_err(read)?.len();
    if size > MAX_FILE_BYTES {
        return Err(content(format!("has {size} bytes, more than the limit of {MAX_FILE_BYTES}")));
    }
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(read)?;
    // A pipe states no size.
    file.take(MAX_FILE_BYTES + 1).read_to_string(&mut text).map_err(read)?;
    if text.len() as u64 > MAX_FILE_BYTES {
        return Err(content(format!("is longer than the limit of {MAX_FILE_BYTES} bytes")));
    }
    parse(&text, node).map_err(content)
}

/// Parses the content of a parameter file, like [`read`]; the error describes the problem.
pub(crate) fn parse(text: &str, node: &str) -> Result<FileSettings, String> {
    let mut out = FileSettings::default();
    // NaN and infinity are accepted here, so that the table can reject them with name and range.
    let options = serde_saphyr::options! {
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
        // Each reference could repeat a long text.
        budget: serde_saphyr::budget! { max_aliases: MAX_ALIASES },
    };
    let document = serde_saphyr::from_str_with_options::<Yaml>(text, options);
    match document.map_err(|error| error.to_string())? {
        Yaml::Null => Ok(out),
        Yaml::Mapping(entries) => {
            walk_sections(&entries, "", node, &mut out)?;
            Ok(out)
        }
        _ => Err("must be a mapping of node names to ros__parameters".to_owned()),
    }
}

fn walk_sections(
    entries: &[(String, Yaml)],
    parent: &str,
    node: &str,
    out: &mut FileSettings,
) -> Result<(), String> {
    for (key, value) in entries {
        let section = format!("{parent}/{}", key.trim_start_matches('/'));
        let partial =
            section.split('/').any(|part| part.contains('*') && part != "*" && part != "**");
        if partial {
            return Err(format!("section {key:?}: a wildcard must be the whole word * or **"));
        }
        let Yaml::Mapping(inner) = value else {
            return Err(format!("section {key:?} must contain ros__parameters or further names"));
        };
        let mut deeper = Vec::new();
        for (name, value) in inner {
            match (name.as_str(), value) {
                ("ros__parameters", Yaml::Mapping(parameters)) => {
                    take_section(&section, parameters, node, out)?;
                }
                ("ros__parameters", Yaml::Null) => take_section(&section, &[], node, out)?,
                ("ros__parameters", _) => {
                    return Err(format!("ros__parameters of {section} must be a mapping"));
                }
                _ => deeper.push((name.clone(), value.clone())),
            }
        }
        walk_sections(&deeper, &section, node, out)?;
    }
    Ok(())
}

fn take_section(
    section: &str,
    parameters: &[(String, Yaml)],
    node: &str,
    out: &mut FileSettings,
) -> Result<(), String> {
    out.sections.push(section.to_owned());
    if ros2args::match_wildcard_pattern(section, node) {
        out.has_section = true;
        let is_exact = section == node;
        flatten(parameters, "", &mut |name, value| {
            out.settings.push(Setting { name, value, is_exact });
        })?;
    }
    Ok(())
}

fn flatten(
    entries: &[(String, Yaml)],
    prefix: &str,
    take: &mut impl FnMut(String, Value),
) -> Result<(), String> {
    for (key, value) in entries {
        let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Yaml::Mapping(inner) => flatten(inner, &name, take)?,
            Yaml::Scalar(value) => take(name, value.clone()),
            Yaml::Sequence(elements) => {
                let texts = texts(elements).ok_or_else(|| {
                    format!("{name}: a list, but only lists of texts are supported")
                })?;
                take(name, Value::TextList(texts));
            }
            Yaml::Null => return Err(format!("{name}: has no value")),
        }
    }
    Ok(())
}

fn texts(elements: &[Yaml]) -> Option<Vec<String>> {
    let text = |element: &Yaml| match element {
        Yaml::Scalar(Value::Text(text)) => Some(text.clone()),
        _ => None,
    };
    elements.iter().map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str, node: &str) -> Vec<String> {
        let settings = parse(text, node).unwrap().settings;
        settings.into_iter().map(|setting| setting.name).collect()
    }

    #[test]
    fn sections_match_as_in_ros() {
        for section in ["/**", "/*", "/laser_profiler", "laser_profiler", "/**/laser_profiler"] {
            let text = format!("{section}: {{ros__parameters: {{a: 1}}}}");
            assert_eq!(names(&text, "/laser_profiler"), ["a"], "{section}");
        }
        for section in ["/cell/**", "/other", "/*/*", "/laser_profiler/x"] {
            let text = format!("{section}: {{ros__parameters: {{a: 1}}}}");
            assert!(names(&text, "/laser_profiler").is_empty(), "{section}");
        }
        for section in ["/cell/**", "/cell/*", "/*/top", "/**", "cell/top"] {
            let text = format!("{section}: {{ros__parameters: {{a: 1}}}}");
            assert_eq!(names(&text, "/cell/top"), ["a"], "{section}");
        }
        assert!(names("/*: {ros__parameters: {a: 1}}", "/cell/top").is_empty());
        assert_eq!(names("cell: {top: {ros__parameters: {a: 1}}}", "/cell/top"), ["a"]);
    }

    #[test]
    fn nested_and_dotted_keys_are_the_same() {
        let nested = "n: {ros__parameters: {a: {b: {c: 1}, d: x}}}";
        let dotted = "n: {ros__parameters: {a.b.c: 1, a.d: x}}";
        assert_eq!(parse(nested, "/n"), parse(dotted, "/n"));
        assert_eq!(names(nested, "/n"), ["a.b.c", "a.d"]);
    }

    #[test]
    fn values_keep_their_types() {
        let text = "n: {ros__parameters: {a: 1, b: 1.0, c: 1e-3, d: true, e: '1', f: auto, g: .nan, h: -7, i: '', j: [a, '1'], k: []}}";
        let values: Vec<_> =
            parse(text, "/n").unwrap().settings.into_iter().map(|setting| setting.value).collect();
        assert!(matches!(values[6], Value::Float(value) if value.is_nan()), "{:?}", values[6]);
        let text = |text: &str| Value::Text(text.to_owned());
        assert_eq!(
            [&values[..6], &values[7..]].concat(),
            [
                Value::Integer(1),
                Value::Float(1.0),
                Value::Float(1e-3),
                Value::Bool(true),
                text("1"),
                text("auto"),
                Value::Integer(-7),
                text(""),
                Value::TextList(vec!["a".into(), "1".into()]),
                Value::TextList(Vec::new()),
            ]
        );
    }

    #[test]
    fn invalid_files_are_rejected_with_a_reason() {
        let cases = [
            ("foo*: {ros__parameters: {a: 1}}", "wildcard"),
            ("/cell*/x: {ros__parameters: {a: 1}}", "wildcard"),
            ("n: 3", "must contain ros__parameters"),
            ("n: {ros__parameters: 3}", "must be a mapping"),
            ("n: {ros__parameters: {a: [1, 2]}}", "a: a list"),
            ("n: {ros__parameters: {a: [left, [right]]}}", "a: a list"),
            ("n: {ros__parameters: {a: }}", "a: has no value"),
            ("- 1", "must be a mapping"),
            ("n: {ros__parameters: {a: 1, a: 2}}", "a"),
            ("n: {ros__parameters: {a: 1}}\n---\nm: {ros__parameters: {a: 1}}", "document"),
            ("n: {", ""),
        ];
        for (text, reason) in cases {
            let error = parse(text, "/n").unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
        assert_eq!(parse("# nothing\n", "/n"), Ok(FileSettings::default()));
    }
}
