//! Reasons why two results may differ: version, parameters, calibration.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    Notes, Provenance, ResultsRecording,
    provenance::{Entries, yaml_leaves},
};

/// An entry whose values in A and B differ; a missing value is empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Reason {
    /// Name of the entry: `version`, a parameter, or `calibration: ` and a path in the file.
    pub(crate) name: String,
    /// Values in A and in B.
    pub(crate) values: [String; 2],
}

/// Returns all entries of version, parameters and calibration whose values differ.
#[must_use]
pub(crate) fn reasons(provenances: [&Provenance; 2]) -> Vec<Reason> {
    let versions = provenances.map(|provenance| {
        let version = provenance.recorded("version").unwrap_or_default();
        BTreeMap::from([("version".to_owned(), version.to_owned())])
    });
    let mut reasons = differing("", &versions);
    reasons.extend(differing("", &provenances.map(Provenance::parameters)));
    let calibrations = provenances
        .map(|provenance| yaml_leaves(provenance.calibration.as_deref().unwrap_or_default()));
    reasons.extend(differing("calibration: ", &calibrations));
    reasons
}

fn differing(prefix: &str, entries: &[Entries; 2]) -> Vec<Reason> {
    let keys: BTreeSet<&String> = entries.iter().flat_map(BTreeMap::keys).collect();
    let values =
        |key: &String| [0, 1].map(|which| entries[which].get(key).cloned().unwrap_or_default());
    let reasons =
        keys.into_iter().map(|key| Reason { name: format!("{prefix}{key}"), values: values(key) });
    reasons.filter(|reason| reason.values[0] != reason.values[1]).collect()
}

/// Returns the differences between the inputs of two results: their recording and its topic. Notes an input that is not
/// stated.
#[must_use]
pub(crate) fn different_inputs(
    recordings: [&ResultsRecording; 2],
    notes: &mut Notes,
) -> Vec<String> {
    let mut found = Vec::new();
    for key in ["input", "input_topic"] {
        let inputs = recordings.map(|recording| recording.provenance().recorded(key));
        match inputs {
            [Some(a), Some(b)] if a == b => {}
            [Some(a), Some(b)] => {
                found.push(format!("A was made from {a:?}, B from {b:?} ({key})"));
            }
            [a, _] => {
                let path = recordings[usize::from(a.is_some())].path().display();
                notes.add(format!("{path} does not state its input ({key})"));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_differing_entries_are_reasons() {
        let a = "extraction.blur_radius: 3\nroi: {x: 1, y: [1, 2]}\nname: \"left\"\n";
        let b = "extraction.blur_radius: 5\nroi: {x: 1, y: [1, 3]}\nname: left\nmore: true\n";
        let found = differing("", &[yaml_leaves(a), yaml_leaves(b)]);
        let values: Vec<_> = found
            .iter()
            .map(|reason| {
                (reason.name.as_str(), reason.values[0].as_str(), reason.values[1].as_str())
            })
            .collect();
        let expected = [
            ("extraction.blur_radius", "3", "5"),
            ("more", "", "true"),
            ("roi.y", "[1,2]", "[1,3]"),
        ];
        assert_eq!(values, expected);
        assert!(differing("", &[yaml_leaves(""), yaml_leaves("")]).is_empty());
        assert_eq!(
            differing("", &[yaml_leaves("{"), yaml_leaves("a: 1")]).len(),
            2,
            "invalid YAML is compared as a whole"
        );
    }
}
