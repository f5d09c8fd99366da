//! Views that were not used, each with its reason.

use std::collections::BTreeMap;

use serde_json::{Value as Json, json};

/// Number of views up to which a summary names each.
const MAX_NAMED: usize = 12;

/// A view that was not used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rejected {
    /// Its name.
    pub(super) view: String,
    /// Reason for the rejection.
    pub(super) reason: String,
}

impl Rejected {
    /// Creates an entry.
    pub(super) fn new(view: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { view: view.into(), reason: reason.into() }
    }
}

/// Returns a list of objects with `view` and `reason`.
pub(super) fn json(rejected: &[Rejected]) -> Json {
    rejected.iter().map(|view| json!({"view": view.view, "reason": view.reason})).collect()
}

/// Returns a number of views in words.
pub(super) fn views(num: usize) -> String {
    format!("{num} {}", if num == 1 { "view" } else { "views" })
}

/// Returns one line per view, or one line per reason if there are many views. Reasons that differ in numbers only count as one.
pub(super) fn text(rejected: &[Rejected]) -> String {
    if rejected.len() <= MAX_NAMED {
        let line = |view: &Rejected| format!("  {}: {}\n", view.view, view.reason);
        return rejected.iter().map(line).collect();
    }
    let mut by_reason: BTreeMap<String, Vec<&Rejected>> = BTreeMap::new();
    for view in rejected {
        let words = view.reason.chars().filter(|letter| !letter.is_ascii_digit()).collect();
        by_reason.entry(words).or_default().push(view);
    }
    let line = |alike: Vec<&Rejected>| match alike.as_slice() {
        [Rejected { view, reason }] => format!("  {view}: {reason}\n"),
        [Rejected { view, reason }, ..] => {
            format!("  {} views, the first one {view}: {reason}\n", alike.len())
        }
        [] => String::new(),
    };
    by_reason.into_values().map(line).collect()
}
