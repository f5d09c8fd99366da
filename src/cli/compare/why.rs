//! In what two results may differ for a reason: version, parameters, calibration.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value as Json;

use crate::cli::report::source::Source;

/// One thing that is not the same, as A and as B have it; empty where one has it not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reason {
    pub(super) what: String,
    pub(super) values: [String; 2],
}

/// Everything that is not the same.
pub(super) fn reasons(sources: [&Source; 2]) -> Vec<Reason> {
    let recorded =
        |key: &str| sources.map(|source| source.record.get(key).cloned().unwrap_or_default());
    let mut reasons = differing("", &recorded("version").map(|text| one("version", text)));
    reasons.extend(differing(
        "",
        &recorded("parameters").map(|text| {
            let prefix = "/**.ros__parameters.";
            let all = flat(&text).into_iter();
            all.map(|(key, value)| (key.strip_prefix(prefix).unwrap_or(&key).to_owned(), value))
                .collect()
        }),
    ));
    let calibrations = sources.map(|source| source.calibration.clone().unwrap_or_default());
    reasons.extend(differing("calibration: ", &calibrations.map(|text| flat(&text))));
    reasons
}

type Entries = BTreeMap<String, String>;

fn one(key: &str, value: String) -> Entries {
    BTreeMap::from([(key.to_owned(), value)])
}

/// The entries that are not equal.
fn differing(prefix: &str, entries: &[Entries; 2]) -> Vec<Reason> {
    let keys: BTreeSet<&String> = entries.iter().flat_map(BTreeMap::keys).collect();
    let values =
        |key: &String| [0, 1].map(|which| entries[which].get(key).cloned().unwrap_or_default());
    let reasons =
        keys.into_iter().map(|key| Reason { what: format!("{prefix}{key}"), values: values(key) });
    reasons.filter(|reason| reason.values[0] != reason.values[1]).collect()
}

/// The leaves of a YAML text by their paths; the text itself where it is none.
fn flat(text: &str) -> Entries {
    let mut entries = Entries::new();
    match serde_saphyr::from_str::<Json>(text) {
        Ok(value) => flatten(String::new(), &value, &mut entries),
        Err(_not_yaml) => drop(entries.insert("text".to_owned(), text.to_owned())),
    }
    entries
}

fn flatten(path: String, value: &Json, entries: &mut Entries) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Json::Object(map) => {
            map.iter().for_each(|(key, value)| flatten(below(key), value, entries));
        }
        Json::Null if path.is_empty() => {}
        Json::String(text) => drop(entries.insert(path, text.clone())),
        value => drop(entries.insert(path, value.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_differs_is_a_reason() {
        let a = "extraction.blur_radius: 3\nroi: {x: 1, y: [1, 2]}\nname: \"left\"\n";
        let b = "extraction.blur_radius: 5\nroi: {x: 1, y: [1, 3]}\nname: left\nmore: true\n";
        let found = differing("", &[flat(a), flat(b)]);
        let told: Vec<_> = found
            .iter()
            .map(|reason| {
                (reason.what.as_str(), reason.values[0].as_str(), reason.values[1].as_str())
            })
            .collect();
        let expected = [
            ("extraction.blur_radius", "3", "5"),
            ("more", "", "true"),
            ("roi.y", "[1,2]", "[1,3]"),
        ];
        assert_eq!(told, expected);
        assert!(differing("", &[flat(""), flat("")]).is_empty());
        assert_eq!(
            differing("", &[flat("{"), flat("a: 1")]).len(),
            2,
            "what is no YAML is told whole"
        );
    }
}
