//! Data of a chart; uPlot draws it on a page, plotters as SVG.

use serde::Serialize;

/// Curves over a common axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Chart {
    /// Identifier: the element `chart-ID` of a page, the file `ID.svg`.
    pub(crate) id: &'static str,
    /// Title.
    pub(crate) title: &'static str,
    /// Label of the horizontal axis.
    pub(crate) x_label: &'static str,
    /// Label of the vertical axis with its unit.
    pub(crate) y_label: &'static str,
    /// Horizontal positions, ascending.
    pub(crate) x: Vec<f64>,
    /// The curves.
    pub(crate) curves: Vec<Curve>,
}

/// One curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Curve {
    /// Name in the legend.
    pub(crate) name: String,
    /// One value per horizontal position; NaN if missing.
    pub(crate) values: Vec<f64>,
}

impl Curve {
    /// Creates a curve.
    #[must_use]
    pub(crate) fn new(name: &str, values: Vec<f64>) -> Self {
        // Six decimals suffice for drawing and keep the file small.
        let values = values.into_iter().map(|value| (value * 1e6).round() / 1e6).collect();
        Self { name: name.to_owned(), values }
    }

    /// True if any value is finite and not zero.
    #[must_use]
    pub(crate) fn is_something(&self) -> bool {
        self.values.iter().any(|value| value.is_finite() && *value != 0.0)
    }
}

impl Chart {
    /// Describes the range of each curve in words, for screen readers.
    #[must_use]
    pub(crate) fn description(&self) -> String {
        let curves = self.curves.iter().map(|curve| {
            let known = || curve.values.iter().filter(|value| value.is_finite());
            let low = known().fold(f64::INFINITY, |low, value| low.min(*value));
            let high = known().fold(f64::NEG_INFINITY, |high, value| high.max(*value));
            if low > high {
                format!("{}: nothing", curve.name)
            } else {
                format!("{}: {low:.4} to {high:.4}", curve.name)
            }
        });
        format!(
            "{}, {} over {}. {}",
            self.title,
            self.y_label,
            self.x_label,
            curves.collect::<Vec<_>>().join("; ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_has_a_description_and_its_gaps_are_null() {
        let chart = Chart {
            id: "a",
            title: "Heights",
            x_label: "frame",
            y_label: "z [mm]",
            x: vec![0.0, 1.0, 2.0],
            curves: vec![
                Curve::new("median", vec![1.5, f64::NAN, -2.0]),
                Curve::new("rest", vec![f64::NAN; 3]),
            ],
        };
        assert_eq!(
            chart.description(),
            "Heights, z [mm] over frame. median: -2.0000 to 1.5000; rest: nothing"
        );
        let json = serde_json::to_value(&chart).unwrap();
        assert_eq!(json["curves"][0]["values"], serde_json::json!([1.5, null, -2.0]));
        assert!(chart.curves[0].is_something() && !chart.curves[1].is_something());
    }
}
