//! A picture of a height map: colours for heights, shading for slopes, axes and scale.

use std::path::Path;

use plotters::prelude::*;

use super::chart::{
    AXIS, Area, NOT_MEASURED, TICK, TITLE, draw_color_bar, save as save_chart, viridis,
};
use crate::{
    metrology::height_map::RegularHeightMap,
    results::{Placing, Results, color_scale_m},
};

/// Longest side of the map, pixels.
const LONGEST_PX: f64 = 1000.0;
/// The light comes from the upper left, 40 degrees above the surface.
const LIGHT: [f32; 3] = [-0.5, 0.5, 0.7];
/// Brightness of a place that faces the light, and of one that faces away.
const BRIGHT: f32 = 1.15;
const DARK: f32 = 0.45;

/// Draws the map into a PNG: y up, x to the right, a millimetre as long along both.
pub(super) fn save(path: &Path, title: &str, map: &RegularHeightMap) -> anyhow::Result<()> {
    let mut heights: Vec<f32> = map.z_m.iter().copied().filter(|z| z.is_finite()).collect();
    heights.sort_by(f32::total_cmp);
    let scale = color_scale_m(&heights);
    let layout = &map.layout;
    let sides_mm =
        [layout.width, layout.height].map(|cells| 1e3 * f64::from(cells) * layout.cell_m);
    let per_mm = LONGEST_PX / sides_mm[0].max(sides_mm[1]);
    let [width, height] = sides_mm.map(|mm| (mm * per_mm).max(160.0) as u32);
    save_chart(path, (width + 250, height + 120), |root| {
        let root = root.titled(title, TITLE)?;
        let (area, bar) = root.split_horizontally(width + 110);
        draw_map(&area, map, scale)?;
        draw_color_bar(&bar, scale)
    })
}

/// Draws a picture of a whole scan.
///
/// # Errors
/// A scan without points or on one line, a file that cannot be written.
pub(super) fn save_scan(path: &Path, results: &Results) -> anyhow::Result<()> {
    let placing = Placing::default();
    let outline = results.outline(&placing)?;
    let map = results.height_map(&placing, &outline, outline.cell_m()?)?;
    save(path, results.topic(), &map)
}

fn draw_map(area: &Area<'_>, map: &RegularHeightMap, scale: [f32; 2]) -> anyhow::Result<()> {
    let layout = &map.layout;
    let [x0, y0] = layout.origin_m.map(|metres| 1e3 * metres);
    let [x1, y1] = [(x0, layout.width), (y0, layout.height)]
        .map(|(from, cells)| from + 1e3 * f64::from(cells) * layout.cell_m);
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(56)
        .y_label_area_size(76)
        .build_cartesian_2d(x0..x1, y0..y1)?;
    let plot = chart.plotting_area().strip_coord_spec();
    let (width, height) = plot.dim_in_pixel();
    for row in 0..height {
        for column in 0..width {
            let [u, v] = [(column, width, layout.width), (height - 1 - row, height, layout.height)]
                .map(|(at, pixels, cells)| {
                    (u64::from(at) * u64::from(cells) / u64::from(pixels.max(1))) as usize
                });
            plot.draw_pixel((column as i32, row as i32), &color(map, u, v, scale))?;
        }
    }
    chart
        .configure_mesh()
        .disable_mesh()
        .label_style(TICK)
        .axis_desc_style(AXIS)
        .x_desc("x [mm]")
        .y_desc("y [mm]")
        .x_label_formatter(&|mm| label(*mm, x1 - x0))
        .y_label_formatter(&|mm| label(*mm, y1 - y0))
        .draw()?;
    Ok(())
}

/// Formats a tick label with enough digits for its neighbours to differ.
fn label(mm: f64, range_mm: f64) -> String {
    let digits = if range_mm > 20.0 { 0 } else { 2 };
    format!("{mm:.digits$}")
}

fn color(map: &RegularHeightMap, column: usize, row: usize, scale: [f32; 2]) -> RGBColor {
    let (width, height) = (map.layout.width as usize, map.layout.height as usize);
    let z = |column: usize, row: usize| map.z_m[row * width + column];
    let here = z(column, row);
    if !here.is_finite() {
        return NOT_MEASURED;
    }
    // Slope to the next measured cells; zero if there are none.
    let slope = |low: f32, high: f32| match (low.is_finite(), high.is_finite()) {
        (true, true) => 0.5 * (high - low),
        (true, false) => here - low,
        (false, true) => high - here,
        (false, false) => 0.0,
    };
    let cell = map.layout.cell_m as f32;
    let along = slope(z(column.saturating_sub(1), row), z((column + 1).min(width - 1), row)) / cell;
    let across =
        slope(z(column, row.saturating_sub(1)), z(column, (row + 1).min(height - 1))) / cell;
    let norm = (along * along + across * across + 1.0).sqrt();
    let length = LIGHT.iter().map(|part| part * part).sum::<f32>().sqrt();
    let facing = (-along * LIGHT[0] - across * LIGHT[1] + LIGHT[2]) / norm / length;
    let bright = DARK + (BRIGHT - DARK) * facing.max(0.0);
    let RGBColor(red, green, blue) = viridis(here, scale);
    let [red, green, blue] =
        [red, green, blue].map(|part| (f32::from(part) * bright).min(255.0) as u8);
    RGBColor(red, green, blue)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrology::height_map::{CellState, GridLayout};

    #[test]
    fn a_roof_is_bright_on_one_side_and_a_hole_is_grey() {
        let layout = GridLayout { origin_m: [0.0; 2], cell_m: 1e-4, width: 40, height: 20 };
        let z_m: Vec<f32> = (0..800)
            .map(|at| (at % 40, at / 40))
            .map(|(x, y)| if x > 35 && y > 15 { f32::NAN } else { -1e-4 * (x as f32 - 20.0).abs() })
            .collect();
        let map = RegularHeightMap { layout, z_m, states: vec![CellState::Measured; 800] };
        let scale = [-3e-3, 0.0];
        let level = |RGBColor(r, g, b)| u32::from(r) + u32::from(g) + u32::from(b);
        assert!(
            level(color(&map, 10, 10, scale)) > level(color(&map, 30, 10, scale)),
            "lit from the left"
        );
        assert_eq!(color(&map, 38, 18, scale), NOT_MEASURED);
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("roof.png");
        save(&path, "A roof", &map).unwrap();
        let picture = image::open(path).unwrap().to_rgb8();
        let grey = image::Rgb([NOT_MEASURED.0, NOT_MEASURED.1, NOT_MEASURED.2]);
        let num_grey = picture.pixels().filter(|pixel| **pixel == grey).count();
        // 4 x 4 of 40 x 20 cells, in a map 1000 pixels wide.
        assert!((8_000..12_000).contains(&num_grey), "{num_grey}");
    }
}
