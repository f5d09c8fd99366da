//! `laser_profiler calibrate camera`.

use std::io::{self, Write};

use anyhow::Context;
use serde_json::{Map, Value as Json, json};

use super::{
    args::CameraArgs,
    boards::{self, Boards},
    file,
    pictures::Pictures,
    rejected, report,
};
use crate::{
    calibrate::{CameraFit, CameraViews, LensModel, calibrate_camera},
    cli::{Outcome, output, settings::Settings},
    ros::arguments::RosArguments,
};

/// Fewest corners of a board partly outside the picture that still contribute to the lens model.
const MIN_CORNERS: usize = 20;

/// Calibrates the camera, writes the file and prints the result to `out`.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an invalid request; views that do not determine the camera; files that cannot be
/// read or written.
pub(in crate::cli::calibrate) fn run(
    args: &CameraArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let target = boards::target(&args.target)?;
    file::refuse_existing(&args.output)?;
    let settings = Settings::load(&args.settings, ros)?;
    let pictures = Pictures::open(&args.inputs, &settings)?;
    let mut boards = boards::find(&pictures, &target, MIN_CORNERS, |_| Ok(()))?;
    let model = match args.model.as_str() {
        "plumb_bob" => LensModel::PlumbBob,
        "equidistant" => LensModel::Equidistant,
        _ => LensModel::RationalPolynomial,
    };
    let [width_px, height_px] = boards.size_px;
    let square_m = target.unit_m();
    let seen = CameraViews { boards: &boards.found, width_px, height_px, square_m };
    let fit = calibrate_camera(&seen, model).with_context(|| boards.summary())?;
    for outlier in &fit.outliers {
        boards.reject(outlier.index, outlier.to_string());
    }
    for index in fit.unseen(boards.found.len()) {
        boards.reject(
            index,
            "corners beyond the lens's field of view, 83 degrees from its axis at most",
        );
    }
    let mut calibration = fit.calibration(&args.camera_name, boards.rejected.len());
    calibration.calibrated_at = Some(file::now());
    file::write(&args.output, &calibration.to_yaml())?;
    if let Some(advice) = advice(args, &fit) {
        tracing::warn!("{advice}");
    }
    if let Some(bend) = fit.bend {
        let meaning = boards::describe(bend, "camera");
        tracing::warn!("{meaning}, and the uncertainty includes it. A flat, stiff board is better");
    }
    if let Some(path) = &args.output.report {
        report::camera(path, &boards, &fit)?;
    }
    let printed = if args.output.json {
        writeln!(out, "{}", answer(args, &boards, &fit))
    } else {
        print(args, &boards, &fit, out)
    };
    output::printed(printed)?;
    Ok(boards.outcome())
}

/// Suggests a simpler model if the views do not determine all terms of the lens.
fn advice(args: &CameraArgs, fit: &CameraFit) -> Option<String> {
    let lost = fit.undetermined();
    let is_wide = args.model == "rational_polynomial";
    (is_wide && lost.iter().any(|name| ["k4", "k5", "k6"].contains(name))).then(|| {
        format!(
            "the views do not determine {}: their uncertainty exceeds their value. A lens with this \
             narrow a field of view needs no rational_polynomial: use --model plumb_bob",
            lost.join(", ")
        )
    })
}

fn answer(args: &CameraArgs, boards: &Boards<()>, fit: &CameraFit) -> Json {
    let all = fit.parameters();
    let object = |values: &[(&str, f64)]| {
        values.iter().map(|&(name, value)| (name.to_owned(), json!(value))).collect::<Map<_, _>>()
    };
    let sigmas = all.iter().map(|&(name, _)| (name.to_owned(), json!(fit.uncertainty.sigma(name))));
    let views = fit.used.iter().map(|view| {
        let (rms_px, corners) = (view.pose.rms_px(), view.pose.residuals_px.len());
        let left_out = boards.found[view.index].left_out;
        let name = &boards.names[view.index];
        json!({"view": name, "rms_px": rms_px, "corners": corners, "left_out": left_out})
    });
    json!({
        "output": args.output.output,
        "report": args.output.report,
        "target": args.target,
        "image_size": boards.size_px,
        "rms_px": fit.rms_px,
        "views_used": fit.used.len(),
        "views_rejected": rejected::json(&boards.rejected),
        "views": views.collect::<Vec<_>>(),
        "intrinsics": object(&all[..4]),
        "distortion_model": args.model,
        "distortion": object(&all[4..]),
        "uncertainties": sigmas.collect::<Map<_, _>>(),
        "undetermined": fit.undetermined(),
        "view_scatter": fit.uncertainty.view_scatter,
        "bend": fit.bend.map(boards::bend),
    })
}

fn print(
    args: &CameraArgs,
    boards: &Boards<()>,
    fit: &CameraFit,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(
        out,
        "{}: {}, {} corners, residual {:.3} px RMS",
        args.output.output.display(),
        rejected::views(fit.used.len()),
        fit.used.iter().map(|view| view.pose.residuals_px.len()).sum::<usize>(),
        fit.rms_px
    )?;
    for (name, value) in fit.parameters() {
        let sigma = fit.uncertainty.sigma(name).unwrap_or(f64::NAN);
        let unit = if name.starts_with(['f', 'c']) { " px" } else { "" };
        let digits = if unit.is_empty() { 5 } else { 2 };
        writeln!(out, "  {name:2} {value:>10.digits$} ± {sigma:.digits$}{unit}")?;
    }
    writeln!(out, "  ± one standard deviation, the scatter between views included")?;
    if let Some(bend) = fit.bend {
        writeln!(out, "  {}", boards::describe(bend, "camera"))?;
    }
    write!(out, "{}", boards.left_out())?;
    if !boards.rejected.is_empty() {
        writeln!(out, "{} not used:", rejected::views(boards.rejected.len()))?;
        write!(out, "{}", rejected::text(&boards.rejected))?;
    }
    Ok(())
}
