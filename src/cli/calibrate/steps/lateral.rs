//! What a pixel sees along the stripe: heights alone do not tell it.

use crate::{
    metrology::steps::{Model, Plateau},
    scanner::params::StripeDirection,
};

/// A plateau, and its borders along the stripe when both lie between plateaus of one picture, pixels.
pub(super) struct Bordered<'a> {
    pub(super) plateau: &'a Plateau,
    pub(super) borders_px: Option<[f64; 2]>,
}

/// Numerator of x per pixel along the stripe, when a pixel sees `lateral_m` at height 0: a projective map divides by
/// the same denominator as the heights, which is taken where the middle of the picture sees height 0.
pub(super) fn of_pixel(model: &Model, middle_px: f64, lateral_m: f64) -> f64 {
    lateral_m * denominator_at_base(model, middle_px)
}

/// The same from plateaus of one known width.
pub(super) fn of_width<'a>(
    model: &Model,
    plateaus: impl Iterator<Item = Bordered<'a>>,
    width_m: f64,
) -> Option<f64> {
    let [_, w] = model.rows();
    let scales: Vec<f64> = plateaus
        .filter_map(|bordered| {
            let (plateau, borders_px) = (bordered.plateau, bordered.borders_px?);
            // x / scale at both borders, each over its own denominator.
            let [from, to] = borders_px.map(|along| {
                let across = plateau.across_px + plateau.slope * (along - plateau.middle_px());
                along / (w[0] * along + w[1] * across + w[2])
            });
            Some(width_m / (to - from).abs())
        })
        .collect();
    (!scales.is_empty()).then(|| scales.iter().sum::<f64>() / scales.len() as f64)
}

/// What a pixel sees at height 0 in the middle of the picture, metres.
pub(super) fn at_base(model: &Model, middle_px: f64, scale: f64) -> f64 {
    scale / denominator_at_base(model, middle_px)
}

fn denominator_at_base(model: &Model, middle_px: f64) -> f64 {
    let [z, w] = model.rows();
    // Where z is 0: z[0]·u + z[1]·v + z[2] = 0.
    let across = -(z[0] * middle_px + z[2]) / z[1];
    w[0] * middle_px + w[1] * across + w[2]
}

/// The homography from (column, row, 1) to (x, z, 1), row-major, from the map and the numerator of x.
pub(super) fn homography(
    model: &Model,
    direction: StripeDirection,
    middle_px: f64,
    scale: f64,
) -> [f64; 9] {
    let [z, w] = model.rows();
    let rows =
        [[scale, 0.0, -scale * middle_px], z, w].map(|[along, across, one]| match direction {
            StripeDirection::Horizontal => [along, across, one],
            StripeDirection::Vertical => [across, along, one],
        });
    let mut flat = [0.0; 9];
    for (entry, value) in flat.iter_mut().zip(rows.iter().flatten()) {
        *entry = *value;
    }
    flat
}
