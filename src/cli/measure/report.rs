//! The result of a measuring tool as text and JSON.

use serde_json::{Map, Value as Json, json};

use crate::{cli::Outcome, results::Figure};

/// Display unit of a value.
#[derive(Clone, Copy, Debug)]
pub(super) enum Unit {
    Millimetre,
    Micrometre,
    Milliradian,
    CubicMillimetre,
    SquareMillimetre,
    None,
}

impl Unit {
    /// Returns factor, number of decimals and name.
    const fn form(self) -> (f64, usize, &'static str) {
        match self {
            Self::Millimetre => (1e3, 5, " mm"),
            Self::Micrometre => (1e6, 3, " µm"),
            Self::Milliradian => (1e3, 4, " mrad"),
            Self::CubicMillimetre => (1e9, 5, " mm³"),
            Self::SquareMillimetre => (1e6, 3, " mm²"),
            Self::None => (1.0, 0, ""),
        }
    }
}

/// Result of a tool: values in the order in which they are printed.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) outcome: Outcome,
    object: Map<String, Json>,
    lines: Vec<(String, String)>,
}

impl Answer {
    pub(super) fn new(tool: &str) -> Self {
        let mut answer = Self { outcome: Outcome::Done, object: Map::new(), lines: Vec::new() };
        answer.object.insert("tool".into(), json!(tool));
        answer
    }

    /// Adds a value to the JSON object only.
    pub(super) fn hidden(&mut self, key: &str, value: Json) {
        self.object.insert(key.into(), value);
    }

    pub(super) fn text_line(&mut self, key: &str, label: &str, value: &str) {
        self.object.insert(key.into(), json!(value));
        self.lines.push((label.into(), value.into()));
    }

    pub(super) fn number(&mut self, key: &str, label: &str, value: f64, unit: Unit) {
        let (factor, digits, name) = unit.form();
        self.object.insert(key.into(), json!(value));
        self.lines.push((label.into(), format!("{:.digits$}{name}", factor * value)));
    }

    pub(super) fn count(&mut self, key: &str, label: &str, value: u64) {
        self.object.insert(key.into(), json!(value));
        self.lines.push((label.into(), value.to_string()));
    }

    pub(super) fn place(&mut self, key: &str, label: &str, metres: &[f64]) {
        self.object.insert(key.into(), json!(metres));
        let numbers: Vec<_> = metres.iter().map(|m| format!("{:.5}", 1e3 * m)).collect();
        self.lines.push((label.into(), format!("{} mm", numbers.join(", "))));
    }

    pub(super) fn figure(&mut self, key: &str, label: &str, figure: Figure, unit: Unit) {
        let Figure { value, sigma, u95, calibration } = figure;
        let (factor, digits, name) = unit.form();
        let object =
            json!({"value": value, "sigma": sigma, "u95": u95, "sigma_calibration": calibration});
        self.object.insert(key.into(), object);
        let number = |number: f64| format!("{:.digits$}", factor * number);
        let [value, sigma, u95] = [value, sigma, u95].map(number);
        let share = calibration
            .map_or(String::new(), |sigma| format!(", of it calibration {}", number(sigma)));
        self.lines
            .push((label.into(), format!("{value}{name} ± {u95} (95 %), sigma {sigma}{share}")));
    }

    pub(super) fn heading(&mut self, text: &str) {
        self.lines.push((text.into(), String::new()));
    }

    /// Adds the lines of a part and returns its JSON object.
    pub(super) fn absorb(&mut self, other: Self) -> Json {
        self.lines.extend(other.lines);
        Json::Object(other.object)
    }

    pub(super) fn json(&self) -> String {
        format!("{}\n", Json::Object(self.object.clone()))
    }

    pub(super) fn text(&self) -> String {
        let width = self.lines.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
        let line = |(label, value): &(String, String)| {
            format!("{label:width$}  {value}").trim_end().to_owned() + "\n"
        };
        self.lines.iter().map(line).collect()
    }
}
