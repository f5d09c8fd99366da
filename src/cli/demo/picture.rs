//! Pictures of a scan: a height map, and one cross-section with its ground truth.

use std::{ops::Range, path::Path};

use anyhow::{anyhow, ensure};
use nalgebra::Point3;
use plotters::prelude::*;

use crate::{
    cli::chart::{AXIS, Area, NOT_MEASURED, TICK, TITLE, draw_color_bar, save, viridis},
    metrology::surface::{Surface, is_measured},
};

/// Largest error on the error axis, micrometres.
const ERROR_UM: f64 = 60.0;
const OFF_SCALE: RGBColor = RGBColor(80, 80, 80);
// Blue and vermilion of Okabe and Ito: distinct for every kind of colour vision.
const MEASURED: RGBColor = RGBColor(0, 114, 178);
const TRUTH: RGBColor = RGBColor(213, 94, 0);

/// Draws the heights of a scan seen from above into a PNG.
///
/// Colours span `scale_m` (from, to), metres. Heights off this scale are dark grey; places without a measurement are
/// light grey.
///
/// # Errors
/// A scan without points, or a file that cannot be written.
pub(crate) fn save_height_map(
    path: &Path,
    title: &str,
    surface: &Surface,
    scale_m: [f32; 2],
) -> anyhow::Result<()> {
    let [x_mm, y_mm] = [0, 1].map(|axis| {
        let values = surface.measured().map(|(_, point)| point[axis] as f32);
        let [low, high] = range_of(values).unwrap_or_default();
        1e3 * low..1e3 * high
    });
    ensure!(!x_mm.is_empty() && !y_mm.is_empty(), "a scan without points has no picture");
    // Both axes have the same scale; the length along the motion spans 900 px.
    let map_px = 900.0 * (x_mm.end - x_mm.start) / (y_mm.end - y_mm.start);
    save(path, (1130, map_px.clamp(250.0, 1500.0) as u32 + 126), |root| {
        let root = root.titled(title, TITLE)?;
        let (map, bar) = root.split_horizontally(986);
        draw_map(&map, surface, scale_m, [y_mm, x_mm])?;
        let height_px = bar.dim_in_pixel().1;
        let (bar, key) = bar.split_vertically(height_px.saturating_sub(76));
        draw_color_bar(&bar, scale_m)?;
        draw_key(&key)
    })
}

fn draw_map(
    area: &Area<'_>,
    surface: &Surface,
    scale_m: [f32; 2],
    [y_mm, x_mm]: [Range<f32>; 2],
) -> anyhow::Result<()> {
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(56)
        .y_label_area_size(66)
        .build_cartesian_2d(y_mm, x_mm)?;
    chart.plotting_area().fill(&NOT_MEASURED)?;
    // Slightly more than half the pitch, so that rounding to pixels leaves no gaps.
    let [half_x, half_y] = surface.pitch_m().map(|metres| 0.55e3 * metres as f32);
    chart.draw_series(surface.measured().map(|(_, point)| {
        let [x, y] = [1e3 * point.x as f32, 1e3 * point.y as f32];
        let corners = [(y - half_y, x - half_x), (y + half_y, x + half_x)];
        Rectangle::new(corners, color_of(point.z as f32, scale_m).filled())
    }))?;
    chart
        .configure_mesh()
        .disable_mesh()
        .label_style(TICK)
        .axis_desc_style(AXIS)
        .x_desc("y, along the motion [mm]")
        .y_desc("x, along the stripe [mm]")
        .x_labels(12)
        .x_label_formatter(&|mm| format!("{mm:.0}"))
        .y_label_formatter(&|mm| format!("{mm:.0}"))
        .draw()?;
    Ok(())
}

fn color_of(height_m: f32, [low, high]: [f32; 2]) -> RGBColor {
    if (low..=high).contains(&height_m) { viridis(height_m, [low, high]) } else { OFF_SCALE }
}

fn draw_key(area: &Area<'_>) -> anyhow::Result<()> {
    for (row, color, text) in [(0, OFF_SCALE, "off the scale"), (1, NOT_MEASURED, "not measured")] {
        let top = 8 + 28 * row;
        area.draw(&Rectangle::new([(10, top), (26, top + 16)], color.filled()))?;
        area.draw(&Text::new(text, (34, top), TextStyle::from(TICK)))?;
    }
    Ok(())
}

/// Draws a profile with its ground truth, and their difference below, into a PNG.
///
/// `truth_m` is the true height at each point of the profile, metres.
///
/// # Errors
/// A profile without points, or a file that cannot be written.
pub(crate) fn save_profile(
    path: &Path,
    title: &str,
    profile: &[Point3<f64>],
    truth_m: &[f64],
) -> anyhow::Result<()> {
    let curve = |z_m: &dyn Fn(f64, f64) -> f64, unit: f64| -> Vec<(f64, f64)> {
        let points = profile.iter().zip(truth_m).filter(|(point, _)| is_measured(point));
        points.map(|(p, &truth)| (1e3 * p.x, unit * z_m(p.z, truth))).collect()
    };
    let measured = curve(&|z, _| z, 1e3);
    let truth = curve(&|_, truth| truth, 1e3);
    let error = curve(&|z, truth| z - truth, 1e6);
    let (Some(first), Some(last)) = (measured.first(), measured.last()) else {
        return Err(anyhow!("a profile without points has no picture"));
    };
    let x_mm = first.0..last.0;
    save(path, (1130, 720), |root| {
        let root = root.titled(title, TITLE)?;
        let (upper, lower) = root.split_vertically(460);
        let z_mm = padded(measured.iter().chain(&truth).map(|point| point.1));
        let mut chart = axes(&upper, [x_mm.clone(), z_mm], ["", "height z [mm]"])?;
        chart
            .draw_series(LineSeries::new(truth, TRUTH.stroke_width(4)))?
            .label("true surface")
            .legend(|(x, y)| Rectangle::new([(x, y - 2), (x + 20, y + 2)], TRUTH.filled()));
        chart
            .draw_series(measured.iter().map(|&at| Circle::new(at, 2, MEASURED.filled())))?
            .label("measured")
            .legend(|(x, y)| Circle::new((x + 10, y), 3, MEASURED.filled()));
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font(TICK)
            .background_style(WHITE)
            .border_style(BLACK)
            .draw()?;
        let (inside, beyond): (Vec<_>, Vec<_>) =
            error.into_iter().partition(|(_, micrometres)| micrometres.abs() <= ERROR_UM);
        let x_label = match beyond.len() {
            0 => "x, along the stripe [mm]".to_owned(),
            count => {
                format!("x, along the stripe [mm]  ({count} points lie beyond ±{ERROR_UM} µm)")
            }
        };
        let labels = [x_label.as_str(), "measured - true [µm]"];
        let mut chart = axes(&lower, [x_mm, -ERROR_UM..ERROR_UM], labels)?;
        chart.draw_series(inside.iter().map(|&at| Circle::new(at, 2, MEASURED.filled())))?;
        Ok(())
    })
}

/// Returns the smallest and the largest value; `None` without values.
pub(crate) fn range_of(values: impl Iterator<Item = f32>) -> Option<[f32; 2]> {
    values.fold(None, |range, value| {
        let [low, high] = range.unwrap_or([value, value]);
        Some([low.min(value), high.max(value)])
    })
}

/// Returns the range of the values, extended by a tenth on both sides.
fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    let margin = (0.1 * (high - low)).max(1e-3);
    low - margin..high + margin
}

type Chart<'a, 'b> = ChartContext<
    'a,
    BitMapBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

fn axes<'a, 'b>(
    area: &'a Area<'b>,
    [x, y]: [Range<f64>; 2],
    [x_label, y_label]: [&str; 2],
) -> anyhow::Result<Chart<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .margin_right(24)
        .x_label_area_size(if x_label.is_empty() { 30 } else { 56 })
        .y_label_area_size(76)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .label_style(TICK)
        .axis_desc_style(AXIS)
        .x_desc(x_label)
        .y_desc(y_label)
        .y_labels(7)
        .x_label_formatter(&|mm| format!("{mm:.0}"))
        .draw()?;
    Ok(chart)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns 101 x 81 points 0.1 x 0.2 mm apart from a height in metres over x in millimetres.
    fn surface(height_m: impl Fn(f64) -> f64) -> Surface {
        let places = (0..81_u8).flat_map(|row| (0..101_u8).map(move |column| (row, column)));
        let points = places.map(|(row, column)| {
            let [x, y] = [f64::from(column) * 0.1 - 5.0, f64::from(row) * 0.2];
            Point3::new(x * 1e-3, y * 1e-3, height_m(x))
        });
        Surface { width: 101, points: points.collect() }
    }

    #[test]
    fn a_height_map_shows_heights_in_colour_and_holes_in_grey() {
        let scan = surface(|x| {
            if x > 3.0 {
                f64::NAN
            } else if x > 0.0 {
                2e-3
            } else {
                1e-3
            }
        });
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("map.png");
        save_height_map(&path, "A title", &scan, [1e-3, 2e-3]).unwrap();
        let picture = image::open(&path).unwrap().to_rgb8();
        let count = |color: RGBColor| {
            let wanted = image::Rgb([color.0, color.1, color.2]);
            picture.pixels().filter(|&&pixel| pixel == wanted).count()
        };
        let [low, high] = [1e-3, 2e-3].map(|height| count(color_of(height, [1e-3, 2e-3])));
        // 5 mm of the low, 3 mm of the high step; no point beyond was measured, so the map ends there.
        assert!(low > 100_000 && high * 8 > low * 4 && high < low, "{low} {high}");
        assert!(count(NOT_MEASURED) < 1000);
    }

    #[test]
    fn a_scan_without_points_is_an_error() {
        let nothing = surface(|_| f64::NAN);
        let path = Path::new("/nonexistent/map.png");
        for error in [
            save_height_map(path, "", &nothing, [0.0, 1.0]).unwrap_err(),
            save_profile(path, "", &[Point3::new(f64::NAN, f64::NAN, f64::NAN)], &[0.0])
                .unwrap_err(),
        ] {
            assert!(error.to_string().contains("without points"), "{error}");
        }
        let scan = surface(|x| 1e-3 * x);
        let error = save_height_map(path, "", &scan, [0.0, 1.0]).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/map.png"), "{error}");
    }
}
