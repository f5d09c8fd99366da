//! `laser_profiler calibrate plane`.

use std::io::Write;

use anyhow::{Context, bail};

use super::{args::PlaneArgs, boards, file, pictures::Pictures, plane_answer, report, stripes};
use crate::{
    calibrate::{BoardView, LaserLines, calibrate_plane, with_true_centres},
    cli::{
        Outcome, output,
        settings::{Settings, SettingsArgs},
    },
    ros::arguments::RosArguments,
    scanner::calibration::{Calibration, CameraCalibration},
};

/// Fewest corners that determine a board's pose under a known camera.
const MIN_CORNERS: usize = 12;

/// Calibrates the laser plane, writes the file and prints the result to `out`.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an invalid request; boards that do not determine the plane; files that cannot be
/// read or written.
pub(in crate::cli::calibrate) fn run(
    args: &PlaneArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let target = boards::target(&args.target)?;
    file::refuse_existing(&args.output)?;
    let camera = CameraCalibration::from_yaml(&file::read(&args.camera_file)?)
        .with_context(|| args.camera_file.display().to_string())?;
    let chosen = SettingsArgs { params_file: args.params_file.clone(), camera: None };
    let settings = Settings::load(&chosen, ros)?;
    let pictures = Pictures::open(&args.inputs, &settings)?;
    let finder = stripes::finder(&settings, &pictures.params);
    let mut boards = boards::find(&pictures, &target, MIN_CORNERS, |image| {
        finder.find(image).map_err(|error| error.to_string())
    })?;
    let expected = [camera.camera.width_px, camera.camera.height_px];
    if boards.size_px != expected {
        bail!(
            "the pictures have {} x {} pixels, the camera of {} has {} x {}: another camera's, or scaled",
            boards.size_px[0],
            boards.size_px[1],
            args.camera_file.display(),
            expected[0],
            expected[1]
        );
    }
    let found = with_true_centres(&camera.camera, &boards.found, target.unit_m());
    let views = found.iter().zip(&boards.beside);
    let views: Vec<_> = views.map(|(board, stripes)| BoardView { board, stripes }).collect();
    let lines = LaserLines::find(&camera.camera, &views, &target, args.border);
    for rejected in &lines.rejected {
        boards.reject(rejected.index, rejected.reason.to_string());
    }
    let fit = calibrate_plane(&lines, camera.quality.as_ref()).with_context(|| boards.summary())?;
    for outlier in &fit.outliers {
        boards.reject(outlier.index, fit.describe_outlier(outlier));
    }
    let mut geometry = fit.calibration(camera, &args.frame_id);
    geometry.calibrated_at = Some(file::now());
    file::write(&args.output, &Calibration::CameraAndPlane(Box::new(geometry)).to_yaml())?;
    if let Some(bend) = lines.bend {
        let meaning = boards::describe(bend, "plane");
        tracing::warn!("{meaning}, and its uncertainty includes it. A flat, stiff board is better");
    }
    if let Some(path) = &args.output.report {
        report::plane(path, &boards, &fit)?;
    }
    output::printed(plane_answer::print(args, &boards, &lines, &fit, out))?;
    Ok(boards.outcome())
}
