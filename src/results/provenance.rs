//! Version, parameters and calibration that a results bag carries.

use std::collections::BTreeMap;

use serde_json::Value as Json;

use crate::bag::{BagError, BagReader};

/// Values of a YAML text by path, such as `extraction.blur_radius`.
pub(super) type Entries = BTreeMap<String, String>;

/// The origin of a results bag; everything is empty in a bag that this program did not write.
#[derive(Clone, Debug, Default)]
pub(crate) struct Provenance {
    /// The metadata record `laser_profiler`: version, parameters, input and others, each a text.
    pub(crate) record: BTreeMap<String, String>,
    /// Text of the calibration file.
    pub(crate) calibration: Option<String>,
}

impl Provenance {
    /// Reads metadata and attachments. Passes errors to `on_error` and continues.
    pub(super) fn read(bag: &BagReader, mut on_error: impl FnMut(&BagError)) -> Self {
        let mut provenance = Self::default();
        for found in bag.metadata() {
            match found {
                Ok(found) if found.name == "laser_profiler" => provenance.record = found.entries,
                Ok(_) => {}
                Err(error) => on_error(&error),
            }
        }
        for file in bag.attachments() {
            match file {
                Ok(file) if file.name == "calibration.yaml" => {
                    let text = String::from_utf8_lossy(&file.data).into_owned();
                    provenance.calibration = Some(text);
                }
                Ok(_) => {}
                Err(error) => on_error(&error),
            }
        }
        provenance
    }

    /// Returns a text of the record; `None` if it is missing or empty.
    #[must_use]
    pub(crate) fn recorded(&self, key: &str) -> Option<&str> {
        self.record.get(key).map(String::as_str).filter(|text| !text.is_empty())
    }

    /// Returns the parameters by name, such as `extraction.blur_radius`; empty if none are recorded.
    #[must_use]
    pub(crate) fn parameters(&self) -> BTreeMap<String, String> {
        const PREFIX: &str = "/**.ros__parameters.";
        let all = yaml_leaves(self.recorded("parameters").unwrap_or_default()).into_iter();
        all.map(|(key, value)| (key.strip_prefix(PREFIX).unwrap_or(&key).to_owned(), value))
            .collect()
    }

    /// Returns true if the recorded parameters place profiles by poses of tf.
    #[must_use]
    pub(crate) fn is_posed(&self) -> bool {
        let parameters = self.parameters();
        parameters.iter().any(|(name, value)| name.ends_with("motion.source") && value == "tf")
    }
}

/// Returns the values of a YAML text by path; for invalid YAML, the whole text as `text`.
pub(super) fn yaml_leaves(text: &str) -> Entries {
    let mut entries = Entries::new();
    // What this program records has no references, each of which could repeat a long text.
    let options = serde_saphyr::options! { budget: serde_saphyr::budget! { max_aliases: 0 } };
    match serde_saphyr::from_str_with_options::<Json>(text, options) {
        Ok(value) => add_leaves(String::new(), &value, &mut entries),
        Err(_not_yaml) => drop(entries.insert("text".to_owned(), text.to_owned())),
    }
    entries
}

fn add_leaves(path: String, value: &Json, entries: &mut Entries) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Json::Object(map) => {
            map.iter().for_each(|(key, value)| add_leaves(below(key), value, entries));
        }
        Json::Null if path.is_empty() => {}
        Json::String(text) => drop(entries.insert(path, text.clone())),
        value => drop(entries.insert(path, value.to_string())),
    }
}
