//! `laser_profiler calibrate axis`.

use std::io::Write;

use anyhow::{Context, bail};

use super::{args::AxisArgs, axis_answer, axis_pictures, boards, file, pictures::Pictures, report};
use crate::{
    calibrate::{AxisTarget, calibrate_axis},
    cli::{
        Outcome, output,
        settings::{self, Settings, SettingsArgs},
    },
    ros::arguments::RosArguments,
    scanner::calibration::Calibration,
};

/// Calibrates the axis, writes the file and prints the result to `out`.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an invalid request; pictures that do not determine the axis; files that cannot be read
/// or written.
pub(in crate::cli::calibrate) fn run(
    args: &AxisArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let target = match (&args.markers, &args.target) {
        (Some(markers), _) => AxisTarget::Markers(markers.parse().map_err(settings::usage)?),
        (None, board) => AxisTarget::Board(boards::target(board.as_deref().unwrap_or_default())?),
    };
    file::refuse_existing(&args.output)?;
    let path = || args.calibration.display().to_string();
    let mut geometry = match Calibration::from_yaml(&file::read(&args.calibration)?) {
        Ok(Calibration::CameraAndPlane(geometry)) => *geometry,
        Ok(_) => bail!("{}: an axis needs a calibration of type camera_and_plane", path()),
        Err(error) => return Err(error).with_context(path),
    };
    let chosen = SettingsArgs { params_file: args.params_file.clone(), camera: None };
    let settings = Settings::load(&chosen, ros)?;
    let pictures = Pictures::open(&args.inputs, &settings)?;
    let found = axis_pictures::find(args, &pictures, &settings, &target)?;
    let fit = calibrate_axis(&geometry, &target, &found.views).with_context(|| found.summary())?;
    fit.apply_to(&mut geometry);
    geometry.calibrated_at = Some(file::now());
    file::write(&args.output, &Calibration::CameraAndPlane(Box::new(geometry)).to_yaml())?;
    if let Some(bend) = fit.bend {
        tracing::warn!("{}. A flat, stiff board is better", boards::describe(bend, "axis"));
    }
    if let Some(path) = &args.output.report {
        report::axis(path, &found, &fit)?;
    }
    output::printed(axis_answer::print(args, &found, &fit, out))?;
    Ok(if found.is_lossy { Outcome::DataLost } else { Outcome::Done })
}
