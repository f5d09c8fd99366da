//! `laser_profiler calibrate camera`.

use std::io::{self, Write};

use anyhow::Context;
use serde_json::{Map, Value as Json, json};

use super::{
    args::CameraArgs,
    boards::{self, Boards},
    file, rejected, report_charts,
    views::Views,
};
use crate::{
    calibrate::intrinsics::{self, CameraFit, Model},
    cli::{Outcome, output, settings::Settings},
    ros::arguments::RosArguments,
};

/// Corners of a board partly outside the picture that still say something about the lens.
const MIN_CORNERS: usize = 20;

/// Calibrates the camera, writes the file and tells on `out` how well.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for a request that cannot be followed; views that say too little; files that cannot be
/// read or written.
pub(in crate::cli::calibrate) fn run(
    args: &CameraArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let target = boards::target(&args.target)?;
    file::refuse_existing(&args.output)?;
    let settings = Settings::load(&args.settings, ros)?;
    let views = Views::open(&args.inputs, &settings)?;
    let mut boards = boards::find(&views, (target, MIN_CORNERS), |_| Ok(()))?;
    let model = if args.model == "plumb_bob" { Model::PlumbBob } else { Model::RationalPolynomial };
    let [width_px, height_px] = boards.size_px;
    let square_m = target.square_m;
    let seen = intrinsics::Views { boards: &boards.found, width_px, height_px, square_m };
    let fit = intrinsics::fit(&seen, model).with_context(|| boards.told())?;
    for outlier in &fit.outliers {
        let reason = format!(
            "corners lie {:.2} px from where the camera puts them, median of the views {:.2} px: blurred, bent or moving",
            outlier.rms_px, outlier.median_px
        );
        boards.reject(outlier.index, reason);
    }
    let calibration = file::of_camera(&args.camera_name, &fit, boards.rejected.len());
    file::write(&args.output, &calibration.to_yaml())?;
    if let Some(advice) = advice(args, &fit) {
        tracing::warn!("{advice}");
    }
    if let Some(path) = &args.output.report {
        report_charts::camera(path, &boards, &fit)?;
    }
    let printed = if args.output.json {
        writeln!(out, "{}", answer(args, &boards, &fit))
    } else {
        tell(args, &boards, &fit, out)
    };
    output::printed(printed)?;
    Ok(boards.outcome())
}

/// Name and value of every parameter, in the order of the file.
pub(super) fn parameters(fit: &CameraFit) -> Vec<(&'static str, f64)> {
    let camera = &fit.camera;
    let pinhole =
        [("fx", camera.fx_px), ("fy", camera.fy_px), ("cx", camera.cx_px), ("cy", camera.cy_px)];
    let lens = file::coefficients(&camera.distortion).into_iter();
    pinhole.into_iter().chain(file::COEFFICIENTS.into_iter().zip(lens)).collect()
}

/// Terms of the lens that are less well known than they are large: the views do not tell them.
fn undetermined(fit: &CameraFit) -> Vec<&'static str> {
    let is_lost = |(name, value): &(&str, f64)| {
        name.starts_with('k') && fit.uncertainty.sigma(name).is_none_or(|sigma| sigma > value.abs())
    };
    parameters(fit).into_iter().filter(is_lost).map(|(name, _)| name).collect()
}

/// What to do about a lens with more terms than it shows.
fn advice(args: &CameraArgs, fit: &CameraFit) -> Option<String> {
    let lost = undetermined(fit);
    let is_wide = args.model == "rational_polynomial";
    (is_wide && lost.iter().any(|name| ["k4", "k5", "k6"].contains(name))).then(|| {
        format!(
            "the views do not tell {}: they are less well known than they are large, and stand for one another. A lens this \
             narrow needs no rational_polynomial: --model plumb_bob",
            lost.join(", ")
        )
    })
}

fn answer(args: &CameraArgs, boards: &Boards<()>, fit: &CameraFit) -> Json {
    let all = parameters(fit);
    let object = |values: &[(&str, f64)]| {
        values.iter().map(|&(name, value)| (name.to_owned(), json!(value))).collect::<Map<_, _>>()
    };
    let sigmas = all.iter().map(|&(name, _)| (name.to_owned(), json!(fit.uncertainty.sigma(name))));
    let views = fit.used.iter().map(|view| {
        let (rms_px, corners) = (view.pose.rms_px(), view.pose.residuals_px.len());
        json!({"view": boards.names[view.index], "rms_px": rms_px, "corners": corners})
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
        "undetermined": undetermined(fit),
        "view_scatter": fit.uncertainty.view_scatter,
    })
}

fn tell(
    args: &CameraArgs,
    boards: &Boards<()>,
    fit: &CameraFit,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(
        out,
        "{}: {} views, {} corners, residual {:.3} px RMS",
        args.output.output.display(),
        fit.used.len(),
        fit.used.iter().map(|view| view.pose.residuals_px.len()).sum::<usize>(),
        fit.rms_px
    )?;
    for (name, value) in parameters(fit) {
        let sigma = fit.uncertainty.sigma(name).unwrap_or(f64::NAN);
        let unit = if name.starts_with(['f', 'c']) { " px" } else { "" };
        let digits = if unit.is_empty() { 5 } else { 2 };
        writeln!(out, "  {name:2} {value:>10.digits$} ± {sigma:.digits$}{unit}")?;
    }
    writeln!(out, "  ± one standard deviation, the scatter between views included")?;
    if !boards.rejected.is_empty() {
        writeln!(out, "{} views not used:", boards.rejected.len())?;
        write!(out, "{}", rejected::text(&boards.rejected))?;
    }
    Ok(())
}
