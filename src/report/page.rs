//! Contents and HTML of a page.

use askama::Template;
use serde::Serialize;

use super::{chart::Chart, grid::About, overlay::Overlay};

/// Style sheet.
const STYLE: &str =
    concat!(include_str!("uplot/uPlot.min.css"), "\n", include_str!("pages/page.css"));
/// Scripts.
const SCRIPT: &str = concat!(
    include_str!("uplot/uPlot.iife.min.js"),
    "\n",
    include_str!("pages/map.js"),
    "\n",
    include_str!("pages/charts.js"),
    "\n",
    include_str!("pages/page.js")
);
/// Licence of the drawing library, which must accompany it.
const LICENCE: &str = include_str!("uplot/LICENSE");

/// A named value in the list of facts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fact {
    /// Title.
    pub(crate) name: String,
    /// Value with its unit.
    pub(crate) value: String,
}

impl Fact {
    /// Creates a fact.
    #[must_use]
    pub(crate) fn new(name: &str, value: impl Into<String>) -> Self {
        Self { name: name.to_owned(), value: value.into() }
    }
}

/// One axis of a map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Axis {
    /// Label, as in `x, along the stripe`.
    pub(crate) label: &'static str,
    /// Display unit.
    pub(crate) unit: &'static str,
    /// Factor from the grid's unit to the display unit.
    pub(crate) factor: f64,
    /// Number of decimals.
    pub(crate) digits: u8,
}

/// A map and the sections through it.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    /// Title.
    pub(crate) title: &'static str,
    /// Caption.
    pub(crate) caption: String,
    /// Titles of the sections across and along the motion.
    pub(crate) sections: [&'static str; 2],
    /// Axes of x, y and z.
    pub(crate) axes: [Axis; 3],
    /// True if x and y are lengths and share one scale.
    pub(crate) is_metric: bool,
    /// 256 colours from the lowest to the highest, `#rrggbb`.
    pub(crate) colors: Vec<String>,
    /// Description of the grid.
    pub(crate) about: About,
    /// The packed grid.
    pub(crate) packed: String,
}

/// A long text, collapsed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Document {
    /// Title.
    pub(crate) title: String,
    /// The text.
    pub(crate) text: String,
}

/// A table with a header row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Table {
    /// Title.
    pub(crate) title: String,
    /// Column headers.
    pub(crate) heads: Vec<String>,
    /// Rows with one cell per header.
    pub(crate) rows: Vec<Vec<String>>,
}

/// A page. Empty parts are omitted.
#[derive(Clone, Debug, Default, Template)]
#[template(path = "page.html")]
pub(crate) struct Page {
    /// Title.
    pub(crate) title: String,
    /// Line below the title.
    pub(crate) subtitle: String,
    /// The most important figures.
    pub(crate) facts: Vec<Fact>,
    /// Notes on missing or lost data and anything unusual.
    pub(crate) notes: Vec<String>,
    /// Height map.
    pub(crate) map: Option<Map>,
    /// Frames with their centrelines.
    pub(crate) overlays: Vec<Overlay>,
    /// Charts over the frames.
    pub(crate) charts: Vec<Chart>,
    /// Tables.
    pub(crate) tables: Vec<Table>,
    /// Calibration, parameters and other texts.
    pub(crate) documents: Vec<Document>,
    /// Program and version.
    pub(crate) program: String,
}

impl Page {
    /// Returns the HTML.
    ///
    /// # Errors
    /// Errors of the template; none are expected.
    pub(crate) fn html(&self) -> Result<String, askama::Error> {
        self.render()
    }

    /// Returns the data for the page's scripts, as JSON that is safe in a script element.
    fn data(&self) -> String {
        let map = self.map.as_ref().map(|map| {
            serde_json::json!({
                "axes": map.axes,
                "is_metric": map.is_metric,
                "colors": map.colors,
                "sections": map.sections,
                "grid": map.about,
            })
        });
        let data = serde_json::json!({"map": map, "charts": self.charts});
        data.to_string().replace('<', "\\u003c")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_a_recording_is_escaped() {
        let evil = "</script><script>alert(1)</script>";
        let page = Page {
            title: evil.to_owned(),
            notes: vec![evil.to_owned()],
            facts: vec![Fact::new(evil, evil)],
            documents: vec![Document { title: evil.to_owned(), text: evil.to_owned() }],
            charts: vec![Chart {
                id: "a",
                title: "b",
                x_label: "c",
                y_label: "d",
                x: vec![0.0],
                curves: vec![super::super::chart::Curve::new(evil, vec![1.0])],
            }],
            ..Page::default()
        };
        let html = page.html().unwrap();
        assert!(
            !html.contains(evil) && html.contains("&#60;script") || html.contains("&lt;script")
        );
        let data = html.split("id=\"report-data\"").nth(1).unwrap();
        let (_, data) = data.split_once('>').unwrap();
        let (data, _) = data.split_once("</script>").unwrap();
        let data: serde_json::Value = serde_json::from_str(data).unwrap();
        assert_eq!(data["charts"][0]["curves"][0]["name"], evil);
    }

    #[test]
    fn the_library_is_the_published_one() {
        use sha2::{Digest, Sha256};
        // `npm pack uplot@1.6.32`, dist/uPlot.iife.min.js.
        let published = "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f";
        let digest = Sha256::digest(include_bytes!("uplot/uPlot.iife.min.js"));
        let digest = digest.iter().fold(String::new(), |text, byte| text + &format!("{byte:02x}"));
        assert_eq!(digest, published);
    }
}
