//! The colour scale of heights, in pages and pictures.

use plotters::style::{
    RGBColor,
    colors::colormaps::{ColorMap, ViridisRGB},
};

/// Returns the colour of a height on a scale from low to high, metres. Heights beyond get the colour of that end.
pub(crate) fn viridis(height_m: f32, [low, high]: [f32; 2]) -> RGBColor {
    ViridisRGB.get_color_normalized(height_m.clamp(low, high), low, high)
}

/// The scale as 256 colours `#rrggbb`.
pub(super) fn scale() -> Vec<String> {
    let color = |at: u16| viridis(f32::from(at), [0.0, 255.0]);
    let hexadecimal = |color: RGBColor| format!("#{:02x}{:02x}{:02x}", color.0, color.1, color.2);
    (0..256).map(color).map(hexadecimal).collect()
}
