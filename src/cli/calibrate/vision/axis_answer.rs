//! Output of `calibrate axis`.

use std::io::{self, Write};

use serde_json::{Value as Json, json};

use super::{args::AxisArgs, axis_pictures::AxisPictures, boards, rejected};
pub(crate) use crate::{calibrate::AxisFit, scanner::axis::AxisKind};

/// Prints the result as text or as JSON.
///
/// # Errors
/// The output cannot be written.
pub(super) fn print(
    args: &AxisArgs,
    pictures: &AxisPictures,
    fit: &AxisFit,
    out: &mut dyn Write,
) -> io::Result<()> {
    if args.output.json {
        return writeln!(out, "{}", json(args, pictures, fit));
    }
    let (axis, quality, agreement) = (&fit.axis, &fit.quality, &fit.agreement);
    let (d, p) = (axis.direction, axis.point_m);
    let (output, count) = (args.output.output.display(), pictures.names.len());
    let rms = match (quality.rms_px, quality.rms_m) {
        (Some(px), _) => format!("{px:.2} px"),
        (_, meters) => format!("{:.3} mm", 1e3 * meters.unwrap_or(f64::NAN)),
    };
    writeln!(out, "{output}: {} axis from {count} pictures, {rms} RMS", kind(axis.kind))?;
    let sigma_deg = quality.direction_sigma_rad.unwrap_or(f64::NAN).to_degrees();
    writeln!(out, "  direction ({:.4}, {:.4}, {:.4}) ± {sigma_deg:.3}°", d.x, d.y, d.z)?;
    if let Some(sigma_m) = quality.point_sigma_m {
        let [x, y, z] = [p.x, p.y, p.z].map(|meters| 1e3 * meters);
        writeln!(out, "  point     ({x:.2}, {y:.2}, {z:.2}) ± {:.2} mm", 1e3 * sigma_m)?;
    }
    if let Some(circles) = &fit.circles {
        let distance = circles.distance;
        writeln!(
            out,
            "  table     {:.2} mm away, from {} (spread {:.2} mm)",
            1e3 * distance.distance_m,
            distance.source,
            1e3 * distance.spread_m
        )?;
    }
    writeln!(
        out,
        "  position  {:.5} ± {:.5} {} per stated unit, written as {}; pictures scatter by {}",
        agreement.scale.abs(),
        agreement.scale_sigma,
        if axis.kind == AxisKind::Revolute { "rad" } else { "m" },
        axis.scale,
        in_words(axis.kind, agreement.sigma)
    )?;
    if (axis.scale - 1.0).abs() > f64::EPSILON {
        let unit = if axis.kind == AxisKind::Revolute { "radians" } else { "metres" };
        writeln!(
            out,
            "  the stated positions are not in {unit}: counts of an encoder, for example. If they should be, --step or the \
             target's size is wrong"
        )?;
    }
    let of_camera = match quality.camera_response {
        Some(_) => "which `measure` adds from the file",
        None => "which is unknown",
    };
    writeln!(out, "  ± one standard deviation, without the share of the camera, {of_camera}")?;
    if let Some(bend) = fit.bend {
        writeln!(out, "  {}", boards::describe(bend, "axis"))?;
    }
    if !agreement.suspicious.is_empty() {
        writeln!(out, "pictures that deviate from their stated position:")?;
        for &at in &agreement.suspicious {
            let off = agreement.off[at] * agreement.scale.signum();
            writeln!(out, "  {}: {}", pictures.names[at], in_words(axis.kind, off))?;
        }
    }
    if !pictures.rejected.is_empty() {
        writeln!(out, "pictures not used: {}", pictures.rejected.len())?;
        write!(out, "{}", rejected::text(&pictures.rejected))?;
    }
    Ok(())
}

const fn kind(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Prismatic => "prismatic",
        AxisKind::Revolute => "revolute",
    }
}

fn in_words(kind: AxisKind, off: f64) -> String {
    match kind {
        AxisKind::Prismatic => format!("{:.3} mm", 1e3 * off),
        AxisKind::Revolute => format!("{:.3}°", off.to_degrees()),
    }
}

fn json(args: &AxisArgs, pictures: &AxisPictures, fit: &AxisFit) -> Json {
    let (axis, quality, agreement) = (&fit.axis, &fit.quality, &fit.agreement);
    let sense = agreement.scale.signum();
    let suspicious =
        agreement.suspicious.iter().map(|&at| (&pictures.names[at], sense * agreement.off[at]));
    let suspicious = suspicious.map(|(view, off)| json!({"view": view, "off": off}));
    let views = pictures.names.iter().zip(&pictures.views).zip(&fit.shown);
    let views = views.map(
        |((name, view), shown)| json!({"view": name, "stated": view.stated, "shown": sense * shown}),
    );
    let steps = fit.shown.windows(2).map(|pair| sense * (pair[1] - pair[0]));
    let circles = fit.circles.as_ref().map(|circles| {
        json!({
            "markers": circles.ids,
            "radii_m": circles.radii_m,
            "table_distance_m": circles.distance.distance_m,
            "table_spread_m": circles.distance.spread_m,
            "distance_from": circles.distance.source.to_string(),
        })
    });
    json!({
        "output": args.output.output,
        "report": args.output.report,
        "kind": kind(axis.kind),
        "unit": if axis.kind == AxisKind::Revolute { "rad" } else { "m" },
        "direction": axis.direction.as_slice(),
        "point_m": axis.point_m.coords.as_slice(),
        "scale": axis.scale,
        "rms_px": quality.rms_px,
        "rms_m": quality.rms_m,
        "views_used": pictures.names.len(),
        "views_rejected": rejected::json(&pictures.rejected),
        "views": views.collect::<Vec<_>>(),
        "steps": steps.collect::<Vec<_>>(),
        "suspicious": suspicious.collect::<Vec<_>>(),
        "measured_scale": agreement.scale.abs(),
        "positions_sigma": agreement.sigma,
        "circles": circles,
        "bend": fit.bend.map(boards::bend),
        "camera_response_known": quality.camera_response.is_some(),
        "uncertainties": {
            "direction_rad": quality.direction_sigma_rad,
            "point_m": quality.point_sigma_m,
            "scale": quality.scale_sigma,
        },
    })
}
