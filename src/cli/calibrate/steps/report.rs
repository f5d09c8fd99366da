//! The result of a calibration from heights, as text and as JSON.

use serde_json::{Value as Json, json};

use super::{args::StepsArgs, gauge::Gauge};
use crate::calibrate::{HeightTerms, PlateauCheck, StepsCalibration, VerticalGeometry};

/// The result and what follows from it.
pub(super) struct Answer<'a> {
    pub(super) result: &'a StepsCalibration,
    /// Formula 6.
    pub(super) geometry: Option<&'a VerticalGeometry>,
    /// Direction in which the stripe moves when the surface rises, if the fit found it.
    pub(super) height_sign: Option<i8>,
    /// Length of a pixel along the stripe at height 0, metres.
    pub(super) lateral_m: Option<f64>,
}

pub(super) fn json(args: &StepsArgs, gauge: &Gauge, answer: &Answer<'_>) -> String {
    let &Answer { result, geometry, height_sign, lateral_m } = answer;
    let heights: Vec<_> = gauge
        .sources
        .iter()
        .zip(&result.checks)
        .map(|(source, check)| row(source, check))
        .collect();
    let model = model_name(result, geometry);
    let geometry = geometry.map(|g| {
        let with = |[value, sigma]: [f64; 2]| json!({"value": value, "sigma": sigma});
        json!({
            "image_distance_m": with(g.image_distance_m),
            "object_distance_m": with(g.object_distance_m),
            "beta_rad": with(g.beta_rad),
            "base_px": with(g.base_px),
            "height_sign": g.height_sign,
        })
    });
    let object = json!({
        "model": model,
        "heights": heights,
        "rms_m": result.rms_m,
        "rms_left_out_m": rms_left_out(&result.checks),
        "linearity": result.linearity,
        "degrees_of_freedom": result.degrees_of_freedom,
        "sigma_m": result.sigma_m,
        "u95_m": result.u95_m,
        "gauge_stated": result.is_stated,
        "excess": result.excess,
        "line_curvature_m": result.bow.curvature_m,
        "line_curvature_significant": result.bow.is_significant,
        "height_sign": height_sign,
        "offsets_m": result.offsets_m,
        "lateral_m_per_px": lateral_m,
        "geometry": geometry,
        "output": args.output,
    });
    format!("{object}\n")
}

fn row(source: &std::path::Path, check: &PlateauCheck) -> Json {
    let plateau = &check.plateau;
    json!({
        "source": source,
        "height_m": plateau.height.height_m,
        "gauge_sigma_m": plateau.height.sigma_m,
        "measured_m": check.measured_m,
        "residual_m": check.measured_m - plateau.height.height_m,
        "left_out_m": check.left_out_m,
        "noise_m": check.noise_m,
        "along_px": plateau.along_px,
        "across_px": plateau.across_px,
        "sigma_px": plateau.sigma_px,
        "points": plateau.num_points,
    })
}

fn model_name(result: &StepsCalibration, geometry: Option<&VerticalGeometry>) -> &'static str {
    match (geometry, result.model.term) {
        (Some(_), _) => "vertical_incidence",
        (None, HeightTerms::Across) => "across",
        (None, HeightTerms::Both) => "both",
    }
}

/// Returns the root mean square error of each plateau's height according to the map of all others; `None` when those
/// are too few.
fn rms_left_out(checks: &[PlateauCheck]) -> Option<f64> {
    let errors = checks.iter().map(|check| Some(check.left_out_m? - check.plateau.height.height_m));
    let errors: Vec<f64> = errors.flatten().collect();
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    (!errors.is_empty()).then(|| (squares / errors.len() as f64).sqrt())
}

pub(super) fn text(args: &StepsArgs, gauge: &Gauge, answer: &Answer<'_>) -> String {
    let &Answer { result, geometry, height_sign, lateral_m } = answer;
    let mut lines = vec![
        "  height [mm]  measured [mm]  residual [µm]  left out [µm]  across [px]  points  source"
            .to_owned(),
    ];
    for (source, check) in gauge.sources.iter().zip(&result.checks) {
        let plateau = &check.plateau;
        let off = |measured_m: f64| format!("{:+.2}", 1e6 * (measured_m - plateau.height.height_m));
        lines.push(format!(
            "{:13.4}{:15.4}{:>15}{:>15}{:13.3}{:8}  {}",
            1e3 * plateau.height.height_m,
            1e3 * check.measured_m,
            off(check.measured_m),
            check.left_out_m.map_or("-".into(), off),
            plateau.across_px,
            plateau.num_points,
            source.display()
        ));
    }
    lines.push(String::new());
    lines.push(quality(result));
    lines.extend(height_sign.map(sign_text));
    lines.extend(offsets(result));
    lines.extend(geometry.map(geometry_text));
    lines.push(match lateral_m {
        Some(metres) => {
            format!("A pixel sees {:.3} µm along the stripe at height 0.", 1e6 * metres)
        }
        None => "The scale along the stripe is unknown: give --lateral, --pitch or --pixel-pitch."
            .into(),
    });
    lines.extend(args.output.as_ref().map(|path| format!("Written: {}", path.display())));
    lines.join("\n") + "\n"
}

fn quality(result: &StepsCalibration) -> String {
    let um = |metres: f64| format!("{:.2} µm", 1e6 * metres);
    let terms = match result.model.term {
        HeightTerms::Across => "three numbers, across the stripe",
        HeightTerms::Both => "five numbers, across and along the stripe",
    };
    let fit = format!(
        "Projective map of {terms}: rms {}, largest residual {:.4} % of the range of heights.",
        um(result.rms_m),
        100.0 * result.linearity
    );
    let left_out = match rms_left_out(&result.checks) {
        Some(metres) => format!("Each height by the map of the others: rms {}.", um(metres)),
        None => "No height is left over to check the others: give four or more.".to_owned(),
    };
    let origin = if result.is_stated { "as stated for the gauge" } else { "from the residuals" };
    let (sigma, u95) = (um(result.sigma_m), um(result.u95_m));
    let uncertainty =
        format!("Uncertainty of a height, {origin}: {sigma} (1 sigma), {u95} (95 %).");
    let bow = &result.bow;
    let by_chance = if bow.is_significant { "" } else { ", which may be noise" };
    let curved = format!("The line of a flat is curved by {}{by_chance}.", um(bow.curvature_m));
    [fit, left_out, curved, uncertainty].join("\n")
}

fn sign_text(sign: i8) -> String {
    let end = if sign < 0 { "smaller" } else { "larger" };
    format!("A higher surface lies at {end} positions in the picture (--height-sign {sign}).")
}

/// Describes the drift of the bed, if it was estimated.
fn offsets(result: &StepsCalibration) -> Option<String> {
    let all: Vec<_> = result.offsets_m.iter().map(|m| format!("{:+.4}", 1e3 * m)).collect();
    (!all.is_empty()).then(|| format!("Zero of the pictures: {} mm.", all.join(", ")))
}

fn geometry_text(geometry: &VerticalGeometry) -> String {
    let [a, b] = [geometry.image_distance_m, geometry.object_distance_m]
        .map(|[value, sigma]| format!("{:.3} mm ± {:.3}", 1e3 * value, 1e3 * sigma));
    let [beta, sigma] = geometry.beta_rad.map(f64::to_degrees);
    format!("Formula 6: a = {a}, b = {b}, beta = {beta:.3} ± {sigma:.3} degrees (1 sigma).")
}
