//! `laser_profiler calibrate plane`.

use std::io::Write;

use anyhow::{Context, bail};

use super::{
    args::PlaneArgs,
    boards::{self, Boards},
    file, plane_answer, report_charts,
    stripes::{Light, Stripes},
    views::Views,
};
use crate::statistics::median;
use crate::{
    calibrate::{
        plane::{self, BoardLine, PlaneFit},
        pose::{self, BoardPose},
        stripe_line::{self, LineRejected, Placed, StripeLine},
    },
    cli::{
        Outcome, output,
        settings::{Settings, SettingsArgs},
    },
    ros::arguments::RosArguments,
    scanner::{
        calibration::{Calibration, CameraAndPlane, CameraCalibration, PlaneQuality},
        camera::Camera,
        stripe::Centerline,
    },
};

/// Corners that give a board's pose under a known camera.
const MIN_CORNERS: usize = 12;

/// The centreline of a picture, in each grey level that was tried.
pub(super) type Stripe = Vec<(Light, Centerline)>;

/// A board whose corners lie this many times farther from their projections than the median board's is not used.
const OUTLIER_FACTOR: f64 = 4.0;

/// Boards with a line that can be used, and where they lie.
pub(super) struct Lines {
    /// Index of each board.
    pub(super) indices: Vec<usize>,
    /// The lines.
    pub(super) found: Vec<StripeLine>,
    /// Grey level in which they were found.
    pub(super) light: Light,
    /// Root mean square residual of the boards' corners, pixels.
    pub(super) board_rms_px: f64,
}

/// Calibrates the laser plane, writes the file and tells on `out` how well.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for a request that cannot be followed; boards that say too little; files that cannot be
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
    let views = Views::open(&args.inputs, &settings)?;
    let stripes = Stripes::new(&settings, &views.params);
    let mut boards = boards::find(&views, (target, MIN_CORNERS), |image| stripes.extract(image))?;
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
    let lines = lines(&camera.camera, &mut boards, (target.square_m, args.border))?;
    let given = lines.indices.iter().zip(&lines.found);
    let given: Vec<_> =
        given.map(|(&index, line)| BoardLine { index, points: &line.points }).collect();
    let fit = plane::fit(&given).with_context(|| boards.told())?;
    for outlier in &fit.outliers {
        let reason = format!(
            "the line lies {:.2} mm from the other boards' plane, all others {:.2} mm: the board moved or bends",
            1e3 * outlier.rms_m,
            1e3 * fit.rms_m
        );
        boards.reject(outlier.index, reason);
    }
    let geometry = geometry(args, camera, &fit);
    file::write(&args.output, &Calibration::CameraAndPlane(Box::new(geometry)).to_yaml())?;
    if let Some(path) = &args.output.report {
        report_charts::plane(path, &boards, &fit)?;
    }
    output::printed(plane_answer::print(args, &boards, &lines, &fit, out))?;
    Ok(boards.outcome())
}

/// The lines of all boards that have one; of the others it is told why not.
fn lines(
    camera: &Camera,
    boards: &mut Boards<Stripe>,
    (square_m, border): (f64, f64),
) -> anyhow::Result<Lines> {
    let poses = poses(camera, boards, square_m);
    let mut lights: Vec<Light> = Vec::new();
    for (light, _) in boards.beside.iter().flatten() {
        if !lights.contains(light) {
            lights.push(*light);
        }
    }
    let find = |wanted: Light| {
        let lines = poses.iter().map(|(index, pose)| {
            let stripe = boards.beside[*index].iter().find(|(light, _)| *light == wanted);
            let placed = Placed { board: &boards.found[*index], pose, square_m, border };
            let line = stripe.ok_or(LineRejected::None);
            let line = line.and_then(|(_, stripe)| stripe_line::find(camera, &placed, stripe));
            (*index, line)
        });
        (wanted, lines.collect::<Vec<_>>())
    };
    // The laser has one colour in all pictures.
    let count = |found: &[(usize, Result<StripeLine, LineRejected>)]| {
        found.iter().filter(|(_, line)| line.is_ok()).count()
    };
    let best = lights.into_iter().map(find);
    let best = best.reduce(|best, next| if count(&next.1) > count(&best.1) { next } else { best });
    let Some((light, found)) = best else { bail!("no board in any picture\n{}", boards.told()) };
    let squares = poses.iter().map(|(_, pose)| pose.rms_px().powi(2)).sum::<f64>();
    let board_rms_px = (squares / poses.len() as f64).sqrt();
    let mut lines = Lines { indices: Vec::new(), found: Vec::new(), light, board_rms_px };
    for (index, line) in found {
        match line {
            Ok(line) => {
                lines.indices.push(index);
                lines.found.push(line);
            }
            Err(reason) => boards.reject(index, reason.to_string()),
        }
    }
    Ok(lines)
}

/// The boards' poses, from their corners alone. Those that do not fit the camera are rejected.
fn poses(camera: &Camera, boards: &mut Boards<Stripe>, square_m: f64) -> Vec<(usize, BoardPose)> {
    let found: Vec<_> =
        boards.found.iter().map(|board| pose::fit(camera, &board.pairs(square_m))).collect();
    let mut all_px: Vec<_> = found.iter().flatten().map(BoardPose::rms_px).collect();
    let median_px = median(&mut all_px).unwrap_or(f64::NAN);
    let mut poses = Vec::new();
    for (index, pose) in found.into_iter().enumerate() {
        match pose {
            None => boards.reject(index, "the camera cannot see a board there"),
            Some(pose) if pose.rms_px() > OUTLIER_FACTOR * median_px => {
                let told = format!(
                    "corners lie {:.2} px from a flat board, median of the views {median_px:.2} px: blurred, bent or moving",
                    pose.rms_px()
                );
                boards.reject(index, told);
            }
            Some(pose) => poses.push((index, pose)),
        }
    }
    poses
}

fn geometry(args: &PlaneArgs, camera: CameraCalibration, fit: &PlaneFit) -> CameraAndPlane {
    let covariance = std::array::from_fn(|i| fit.covariance[(i / 3, i % 3)]);
    CameraAndPlane {
        frame_id: args.frame_id.clone(),
        camera_name: camera.camera_name,
        camera: camera.camera,
        camera_quality: camera.quality,
        plane: fit.plane,
        plane_quality: Some(PlaneQuality {
            rms_m: fit.rms_m,
            boards_used: fit.used.len() as u32,
            covariance: Some(covariance),
        }),
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: Some(file::now()),
    }
}
