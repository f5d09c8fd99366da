//! Errors of the YAML parser in plain words, with key and line.

use serde_saphyr::{Error, Location, UserMessageFormatter};

use super::tree::{Node, Value, documents};

/// Most known keys that an error lists.
const MAX_LISTED: usize = 24;

/// Returns the reason why a text is no calibration.
pub(super) fn explain(text: &str, error: &Error) -> String {
    let error = error.without_snippet();
    let location = error.location();
    let line = location.map(|at| format!("line {}: ", at.line())).unwrap_or_default();
    let at_key = location.and_then(|at| key_at(text, at)).unwrap_or_else(|| "the value".to_owned());
    let reason = match error {
        Error::SerdeUnknownField { field, expected, .. } => unknown(field, expected),
        Error::SerdeMissingField { field, .. } => return format!("the key `{field}` is missing"),
        Error::DuplicateMappingKey { key, .. } => {
            format!("the key `{}` is there twice: delete one", key.as_deref().unwrap_or_default())
        }
        Error::SerdeInvalidLength { len, expected, .. } => {
            format!("{at_key} has {len} values, wanted is {}", plain(expected))
        }
        Error::SerdeInvalidType { unexpected, expected, .. }
        | Error::SerdeInvalidValue { unexpected, expected, .. } => {
            format!("{at_key} is {unexpected}, wanted is {}", plain(expected))
        }
        Error::NonFiniteFloat { value, .. } => {
            format!("{at_key} is {value}, wanted is a finite number")
        }
        Error::InvalidScalar { ty, .. } => format!("{at_key} must be {}", plain(ty)),
        Error::Unexpected { expected, .. } => format!("{at_key} must be {}", plain(expected)),
        Error::UnexpectedSequenceEnd { .. } => format!("{at_key} has too few values"),
        Error::Eof { .. } => return "the file is empty".to_owned(),
        other => {
            let message = other.render_with_formatter(&UserMessageFormatter);
            message.lines().next().unwrap_or_default().to_owned()
        }
    };
    format!("{line}{reason}")
}

fn unknown(field: &str, expected: &[&str]) -> String {
    let plain = |key: &str| key.replace('_', "").to_lowercase();
    let distance = |key: &&&str| edits(&plain(key), &plain(field));
    let near =
        expected.iter().min_by_key(distance).filter(|key| 3 * distance(key) <= field.len().min(6));
    let known = || expected.iter().take(MAX_LISTED).copied().collect::<Vec<_>>().join(", ");
    let hint = near
        .map_or_else(|| format!("known are {}", known()), |key| format!("did you mean `{key}`?"));
    format!("unknown key `{field}`: {hint}")
}

/// Returns the number of inserted, deleted and replaced letters between two words.
fn edits(one: &str, other: &str) -> usize {
    let other: Vec<char> = other.chars().collect();
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (index, letter) in one.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = index + 1;
        for (column, same) in other.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *same);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row.last().copied().unwrap_or_default()
}

/// Replaces the names of Rust's types.
fn plain(expected: &str) -> String {
    let list = |count: &str| format!("a list of {count} numbers");
    match expected {
        "floating point" | "f64" => "a number".to_owned(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or more".to_owned(),
        "i8" | "i32" | "i64" => "a whole number".to_owned(),
        "sequence start" | "sequence" | "a sequence" => "a list [.., ..]".to_owned(),
        "mapping start" | "mapping" => "a group of keys {key: value, ..}".to_owned(),
        "string scalar" | "string" | "a string" => "a text".to_owned(),
        _ => match expected
            .strip_prefix("an array of length ")
            .or_else(|| expected.strip_prefix("a tuple of size "))
        {
            Some(count) => list(count),
            None => match expected.strip_prefix("struct ") {
                Some(_) => "a group of keys {key: value, ..}".to_owned(),
                None => expected.to_owned(),
            },
        },
    }
}

/// Returns the path of the last key before a place in the text.
fn key_at(text: &str, at: Location) -> Option<String> {
    let documents = documents(text).ok()?;
    let mut path = Vec::new();
    let mut node = documents.first()?;
    while let Value::Map(entries) = &node.value {
        let is_before = |(_, value): &&(String, Node)| {
            (value.line as u64, value.column as u64) <= (at.line(), at.column())
        };
        let Some((key, value)) = entries.iter().rev().find(is_before) else { break };
        path.push(key.as_str());
        node = value;
    }
    (!path.is_empty()).then(|| path.join("."))
}
