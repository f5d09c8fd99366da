//! Draws charts into a PNG file.

use std::{ops::Range, path::Path};

use anyhow::{Context, anyhow};
use plotters::{coord::Shift, prelude::*, style::register_font};

type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

const SIZE_PX: (u32, u32) = (1280, 960);
const FONT: &str = "sans-serif";
const TITLE: (&str, i32) = (FONT, 22);
const TEXT: (&str, i32) = (FONT, 16);
/// Blue and vermilion of Okabe and Ito, distinguishable with any colour vision.
const BLUE: RGBColor = RGBColor(0, 114, 178);
const VERMILION: RGBColor = RGBColor(213, 94, 0);

/// One chart of a report.
pub(super) struct Chart {
    /// Title.
    pub(super) title: String,
    /// The axes, with their units.
    pub(super) labels: [&'static str; 2],
    /// Ranges from left to right and from bottom to top; a falling range reverses the axis.
    pub(super) ranges: [Range<f64>; 2],
    /// Data.
    pub(super) marks: Marks,
}

/// The data of a chart.
pub(super) enum Marks {
    /// One dot per point.
    Dots(Vec<(f64, f64)>),
    /// Start and end of each line.
    Arrows(Vec<[(f64, f64); 2]>),
    /// One bar from 0 for each number, in order.
    Bars(Vec<f64>),
    /// One bar of this half length about each number.
    Spans(Vec<(f64, f64)>),
}

/// Draws charts, two per row, into a PNG file.
///
/// # Errors
/// The file cannot be written.
pub(super) fn save(path: &Path, charts: &[Chart]) -> anyhow::Result<()> {
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_invalid| anyhow!("the built-in font is not a font"))?;
    let (width, height) = SIZE_PX;
    let mut pixels = vec![0; width as usize * height as usize * 3];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, SIZE_PX).into_drawing_area();
        root.fill(&WHITE)?;
        let areas = root.split_evenly((charts.len().div_ceil(2), charts.len().min(2)));
        for (area, chart) in areas.iter().zip(charts) {
            draw(area, chart)?;
        }
        root.present()?;
    }
    image::save_buffer_with_format(
        path,
        &pixels,
        width,
        height,
        image::ColorType::Rgb8,
        image::ImageFormat::Png,
    )
    .with_context(|| format!("cannot write {}", path.display()))
}

fn draw(area: &Area<'_>, chart: &Chart) -> anyhow::Result<()> {
    let [x, y] = chart.ranges.clone();
    let mut axes = ChartBuilder::on(area)
        .caption(&chart.title, TITLE)
        .margin(10)
        .margin_right(24)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d(x, y)?;
    axes.configure_mesh()
        .light_line_style(WHITE)
        .label_style(TEXT)
        .axis_desc_style(TEXT)
        .x_desc(chart.labels[0])
        .y_desc(chart.labels[1])
        .draw()?;
    match &chart.marks {
        Marks::Dots(dots) => {
            let dot = |&at: &(f64, f64)| Circle::new(at, 1, BLUE.filled());
            axes.draw_series(dots.iter().map(dot))?;
        }
        Marks::Arrows(arrows) => {
            let line = |ends: &[(f64, f64); 2]| PathElement::new(*ends, VERMILION.stroke_width(1));
            axes.draw_series(arrows.iter().map(line))?;
        }
        Marks::Bars(bars) => {
            let bar = |(at, &value): (usize, &f64)| {
                Rectangle::new([(at as f64 - 0.4, 0.0), (at as f64 + 0.4, value)], BLUE.filled())
            };
            axes.draw_series(bars.iter().enumerate().map(bar))?;
        }
        Marks::Spans(spans) => {
            let span = |(at, &(middle, half)): (usize, &(f64, f64))| {
                let ends = [(at as f64, middle - half), (at as f64, middle + half)];
                PathElement::new(ends, BLUE.stroke_width(3))
            };
            axes.draw_series(spans.iter().enumerate().map(span))?;
            let dot = |(at, &(middle, _)): (usize, &(f64, f64))| {
                Circle::new((at as f64, middle), 4, VERMILION.filled())
            };
            axes.draw_series(spans.iter().enumerate().map(dot))?;
        }
    }
    Ok(())
}

/// Returns the range of some values plus a tenth of it on both sides; never empty.
pub(super) fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let margin = (0.1 * (high - low)).max(1e-9);
    low - margin..high + margin
}

/// Returns the position of each of the given number of bars.
pub(super) fn places(count: usize) -> Range<f64> {
    -0.6..count as f64 - 0.4
}
