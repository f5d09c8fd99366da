//! Curves as SVG files.

use std::{fs, ops::Range, path::Path};

use anyhow::{Context, anyhow};
use plotters::{prelude::*, style::register_font};

const FONT: &str = "sans-serif";
const TITLE: (&str, i32) = (FONT, 20);
const TEXT: (&str, i32) = (FONT, 15);
const SIZE_PX: (u32, u32) = (960, 460);
/// Number of points above which a curve has no marks.
const MANY: usize = 100;
/// Left edge of the legend, right of the chart, pixels.
const KEY_PX: u32 = 760;

/// The colours of Okabe and Ito, distinguishable with any colour vision; black is reserved for the bound.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
];

/// Curves over one axis.
#[derive(Clone, Debug)]
pub(in crate::cli) struct Plot {
    /// File name, with `.svg`.
    pub(in crate::cli) file: String,
    /// Title.
    pub(in crate::cli) title: String,
    /// Label of the horizontal axis with its unit.
    pub(in crate::cli) x_label: &'static str,
    /// Label of the vertical axis with its unit.
    pub(in crate::cli) y_label: &'static str,
    /// True if the vertical axis is logarithmic.
    pub(in crate::cli) is_log: bool,
    /// The curves.
    pub(in crate::cli) curves: Vec<Curve>,
}

/// One curve.
#[derive(Clone, Debug)]
pub(in crate::cli) struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
    is_bound: bool,
}

impl Curve {
    /// Returns the curve of a method. NaN points are omitted.
    pub(in crate::cli) fn method(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.to_owned(), points, is_bound: false }
    }

    /// Returns any other curve.
    pub(in crate::cli) fn plain(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self::method(name, points)
    }

    /// Returns the curve of a lower bound: black and dashed.
    pub(in crate::cli) fn bound(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.to_owned(), points, is_bound: true }
    }
}

impl Plot {
    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(in crate::cli) fn save(&self, directory: &Path) -> anyhow::Result<()> {
        let path = directory.join(&self.file);
        fs::write(&path, self.svg()?).with_context(|| format!("cannot write {}", path.display()))
    }

    fn svg(&self) -> anyhow::Result<String> {
        // Only measures the width of text; the file names a font of the reader's system.
        register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
            .map_err(|_invalid| anyhow!("the built-in font is not a font"))?;
        let curves: Vec<_> = self.curves.iter().map(|curve| (curve, self.drawn(curve))).collect();
        let all = || curves.iter().flat_map(|(_, points)| points);
        let x = range(all().map(|point| point.0), 0.0);
        let y = range(all().map(|point| point.1), 0.05);
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, SIZE_PX).into_drawing_area();
            root.fill(&WHITE)?;
            let (left, key) = root.split_horizontally(KEY_PX);
            let mut chart = ChartBuilder::on(&left)
                .caption(&self.title, TITLE)
                .margin(12)
                .x_label_area_size(46)
                .y_label_area_size(76)
                .build_cartesian_2d(x, y)?;
            chart
                .configure_mesh()
                .light_line_style(WHITE)
                .label_style(TEXT)
                .axis_desc_style(TEXT)
                .x_desc(self.x_label)
                .y_desc(self.y_label)
                .y_label_formatter(&|&y| label(if self.is_log { 10_f64.powf(y) } else { y }))
                .x_label_formatter(&|&x| label(x))
                .draw()?;
            let mut colors = COLORS.iter().cycle();
            for ((curve, points), row) in curves.iter().zip(0..) {
                let color = if curve.is_bound { BLACK } else { *colors.next().unwrap_or(&BLACK) };
                let style = color.stroke_width(2);
                let points = points.iter().copied();
                if curve.is_bound {
                    chart.draw_series(DashedLineSeries::new(points, 6, 5, style))?;
                } else {
                    let size_px = if points.len() > MANY { 0 } else { 2 };
                    chart.draw_series(LineSeries::new(points, style).point_size(size_px))?;
                }
                let y_px = 60 + 24 * row;
                key.draw(&PathElement::new([(0, y_px), (22, y_px)], style))?;
                let text = TextStyle::from(TEXT);
                key.draw(&Text::new(curve.name.as_str(), (30, y_px - 8), text))?;
            }
            root.present()?;
        }
        Ok(svg)
    }

    /// Returns the points in the coordinates of the chart.
    fn drawn(&self, curve: &Curve) -> Vec<(f64, f64)> {
        let points =
            curve.points.iter().map(|&(x, y)| (x, if self.is_log { y.log10() } else { y }));
        points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
    }
}

/// Returns the range of the values, extended by `margin` of its length on both sides.
fn range(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let ends = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    if low > high {
        return 0.0..1.0;
    }
    let margin = (margin * (high - low)).max(1e-9);
    low - margin..high + margin
}

/// Formats a tick label with the fewest digits that distinguish it from its neighbours.
fn label(value: f64) -> String {
    let decimals = match value.abs() {
        size if size < 1e-9 => 0,
        size if size < 0.01 => 4,
        size if size < 0.1 => 3,
        size if size < 1.0 => 2,
        size if size < 10.0 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(curves: Vec<Curve>) -> Plot {
        Plot {
            file: "rms.svg".to_owned(),
            title: "RMS & bound".to_owned(),
            x_label: "noise",
            y_label: "RMS [px]",
            is_log: true,
            curves,
        }
    }

    #[test]
    fn a_plot_names_its_curves_and_omits_nan() {
        let curves = vec![
            Curve::method("steger", vec![(1.0, 0.1), (2.0, f64::NAN), (3.0, 0.3), (4.0, 0.0)]),
            Curve::bound("bound", vec![(1.0, 0.05), (3.0, 0.2)]),
        ];
        let svg = plot(curves.clone()).svg().unwrap();
        for text in ["steger", "bound", "RMS &amp; bound", "noise", "#0072B2"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert_eq!(svg, plot(curves).svg().unwrap());
        assert!(
            plot(Vec::new()).svg().unwrap().contains("noise"),
            "nothing measured, nothing drawn"
        );
    }

    #[test]
    fn a_missing_directory_is_named() {
        let error = plot(Vec::new()).save(Path::new("/nonexistent")).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/rms.svg"), "{error}");
    }
}
