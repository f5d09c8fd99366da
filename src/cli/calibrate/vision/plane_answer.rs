//! Output of `calibrate plane`.

use std::io::{self, Write};

use serde_json::{Value as Json, json};

use super::{
    args::PlaneArgs,
    boards::{self, Boards},
    rejected,
};
use crate::calibrate::{BoardResidual, LaserLines, LaserPlaneFit, LitCenterline};

type PlaneBoards = Boards<Vec<LitCenterline>>;

/// Prints the result as text or as JSON.
///
/// # Errors
/// The output cannot be written.
pub(super) fn print(
    args: &PlaneArgs,
    boards: &PlaneBoards,
    lines: &LaserLines,
    fit: &LaserPlaneFit,
    out: &mut dyn Write,
) -> io::Result<()> {
    if args.output.json {
        return writeln!(out, "{}", json(args, boards, lines, fit));
    }
    let sigmas = fit.sigmas();
    let normal = fit.plane.normal;
    writeln!(
        out,
        "{}: {} boards, {} points, {:.3} mm RMS from the plane",
        args.output.output.display(),
        fit.used.len(),
        fit.used.iter().map(|board| board.points).sum::<usize>(),
        1e3 * fit.rms_m
    )?;
    writeln!(
        out,
        "  normal   ({:.4}, {:.4}, {:.4}) ± {:.3}°, {:.3}°",
        normal.x,
        normal.y,
        normal.z,
        sigmas[0].to_degrees(),
        sigmas[1].to_degrees()
    )?;
    let distance_m = fit.plane.distance_m;
    writeln!(out, "  distance {:.3} ± {:.3} mm", 1e3 * distance_m, 1e3 * sigmas[2])?;
    let of_camera = match fit.camera_covariance() {
        Some(_) => "and of the camera",
        None => "without the camera's: its file states no covariance",
    };
    writeln!(out, "  ± one standard deviation, from leaving out one board at a time, {of_camera}")?;
    writeln!(out, "  the laser was found in {}", lines.light.name())?;
    if let Some(bend) = lines.bend {
        writeln!(out, "  {}", boards::describe(bend, "plane"))?;
    }
    write!(out, "{}", boards.left_out())?;
    if !boards.rejected.is_empty() {
        writeln!(out, "{} not used:", rejected::views(boards.rejected.len()))?;
        write!(out, "{}", rejected::text(&boards.rejected))?;
    }
    Ok(())
}

fn json(args: &PlaneArgs, boards: &PlaneBoards, lines: &LaserLines, fit: &LaserPlaneFit) -> Json {
    let normal = fit.plane.normal;
    let sigmas = fit.sigmas();
    let method = match fit.camera_covariance() {
        Some(_) => "jackknife over boards, and the camera's covariance",
        None => "jackknife over boards, camera held fixed",
    };
    let board = |board: &BoardResidual| {
        let line = lines.lines.iter().find(|line| line.index == board.index);
        let line_rms_px = line.map(|line| line.line.rms_px);
        json!({
            "view": boards.names[board.index],
            "points": board.points,
            "mean_m": board.mean_m,
            "rms_m": board.rms_m,
            "line_rms_px": line_rms_px,
            "corners_left_out": boards.found[board.index].left_out,
        })
    };
    json!({
        "output": args.output.output,
        "report": args.output.report,
        "target": args.target,
        "camera": args.camera_file,
        "plane_rms_m": fit.rms_m,
        "normal": [normal.x, normal.y, normal.z],
        "distance_m": fit.plane.distance_m,
        "boards_used": fit.used.len(),
        "views_used": fit.used.len(),
        "views_rejected": rejected::json(&boards.rejected),
        "boards": fit.used.iter().map(board).collect::<Vec<_>>(),
        "board_rms_px": lines.board_rms_px,
        "light": lines.light.name(),
        "bend": lines.bend.map(boards::bend),
        "uncertainties": {
            "tilts_rad": [sigmas[0], sigmas[1]],
            "distance_m": sigmas[2],
            "method": method,
        },
    })
}
