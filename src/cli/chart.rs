//! Shared parts of PNG charts: fonts, colours, a colour bar, writing the file.

use std::path::Path;

use anyhow::{Context, anyhow};
use plotters::{coord::Shift, prelude::*, style::register_font};

pub(super) use crate::report::color::viridis;

pub(super) type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

const FONT: &str = "sans-serif";
pub(super) const TITLE: (&str, i32) = (FONT, 24);
pub(super) const AXIS: (&str, i32) = (FONT, 19);
pub(super) const TICK: (&str, i32) = (FONT, 17);
pub(super) const NOT_MEASURED: RGBColor = RGBColor(208, 208, 208);

/// Draws the bar that explains the colours of a scale (from, to), metres; labels are in millimetres.
pub(super) fn draw_color_bar(area: &Area<'_>, scale_m: [f32; 2]) -> anyhow::Result<()> {
    let [low, high] = scale_m.map(|metres| 1e3 * metres);
    let mut chart = ChartBuilder::on(area)
        .margin_top(10)
        .margin_bottom(10)
        .margin_left(10)
        .right_y_label_area_size(90)
        .build_cartesian_2d(0.0_f32..1.0, low..high)?;
    let step = (high - low) / 256.0;
    chart.draw_series((0..256_u16).map(|i| {
        let from = low + f32::from(i) * step;
        let color = viridis(f32::from(i), [0.0, 255.0]);
        Rectangle::new([(0.0, from), (1.0, from + step)], color.filled())
    }))?;
    chart
        .configure_mesh()
        .disable_mesh()
        .label_style(TICK)
        .y_label_formatter(&|mm| format!("{mm:.2} mm"))
        .draw()?;
    Ok(())
}

/// Draws on a white background of `width` x `height` pixels and writes a PNG.
///
/// # Errors
/// Those of `draw`; a file that cannot be written.
pub(super) fn save(
    path: &Path,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_invalid| anyhow!("the built-in font is not a font"))?;
    let mut pixels = vec![0; width as usize * height as usize * 3];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        root.fill(&WHITE)?;
        draw(&root)?;
        root.present()?;
    }
    image::save_buffer(path, &pixels, width, height, image::ColorType::Rgb8)
        .with_context(|| format!("cannot write {}", path.display()))
}
