//! The charts of a camera, a plane and an axis.

use std::{f64::consts::PI, path::Path};

use super::{
    axis_pictures::AxisPictures,
    boards::Boards,
    charts::{self, Chart, Marks, padded, places},
    rejected,
};
use crate::{
    calibrate::{AxisFit, AxisView, CameraFit, LaserPlaneFit},
    scanner::axis::AxisKind,
};

/// Magnification of the residuals.
const ENLARGED: f64 = 100.0;

/// Draws the corners, their residuals, and the residual of each view.
///
/// # Errors
/// The file cannot be written.
pub(super) fn camera(path: &Path, boards: &Boards<()>, fit: &CameraFit) -> anyhow::Result<()> {
    let seen = |index: usize| boards.found[index].corners.iter().map(|corner| corner.seen);
    let dots = fit.used.iter().flat_map(|view| seen(view.index)).map(|at| (at.x, at.y)).collect();
    let arrows = fit.used.iter().flat_map(|view| {
        let pairs = seen(view.index).zip(&view.pose.residuals_px);
        pairs.map(|(at, (u, v))| [(at.x, at.y), (at.x + ENLARGED * u, at.y + ENLARGED * v)])
    });
    let [width, height] = boards.size_px.map(f64::from);
    let image = || [-0.5..width - 0.5, height - 0.5..-0.5];
    let labels = ["column [px]", "row [px]"];
    let bars: Vec<_> = fit.used.iter().map(|view| view.pose.rms_px()).collect();
    let residuals = || fit.used.iter().flat_map(|view| view.pose.residuals_px.iter().copied());
    let both = padded(residuals().flat_map(|(u, v)| [u, v]));
    let charts = [
        Chart {
            title: format!("corners of {}", rejected::views(fit.used.len())),
            labels,
            ranges: image(),
            marks: Marks::Dots(dots),
        },
        Chart {
            title: format!("residuals, {ENLARGED:.0} times enlarged"),
            labels,
            ranges: image(),
            marks: Marks::Arrows(arrows.collect()),
        },
        Chart {
            title: format!("RMS of each view; of all: {:.3} px", fit.rms_px),
            labels: ["view", "RMS [px]"],
            ranges: [places(bars.len()), 0.0..padded(bars.iter().copied()).end],
            marks: Marks::Bars(bars),
        },
        Chart {
            title: "residuals".to_owned(),
            labels: ["across columns [px]", "across rows [px]"],
            ranges: [both.clone(), both],
            marks: Marks::Dots(residuals().collect()),
        },
    ];
    charts::save(path, &charts)
}

/// Draws the residual of each board's line and the positions of the corners.
///
/// # Errors
/// The file cannot be written.
pub(super) fn plane<T>(path: &Path, boards: &Boards<T>, fit: &LaserPlaneFit) -> anyhow::Result<()> {
    let scatter = |mean: f64, rms: f64| (rms * rms - mean * mean).max(0.0).sqrt();
    let spans =
        fit.used.iter().map(|board| (1e3 * board.mean_m, 1e3 * scatter(board.mean_m, board.rms_m)));
    let spans: Vec<_> = spans.collect();
    let ends = spans.iter().flat_map(|(middle, half)| [middle - half, middle + half]);
    let corners = fit.used.iter().flat_map(|board| &boards.found[board.index].corners);
    let [width, height] = boards.size_px.map(f64::from);
    let charts = [
        Chart {
            title: format!("the line on each board off the plane; RMS {:.3} mm", 1e3 * fit.rms_m),
            labels: ["board", "mean, and standard deviation on the board [mm]"],
            ranges: [places(spans.len()), padded(ends)],
            marks: Marks::Spans(spans),
        },
        Chart {
            title: format!("corners of {} boards", fit.used.len()),
            labels: ["column [px]", "row [px]"],
            ranges: [-0.5..width - 0.5, height - 0.5..-0.5],
            marks: Marks::Dots(corners.map(|corner| (corner.seen.x, corner.seen.y)).collect()),
        },
    ];
    charts::save(path, &charts)
}

/// Draws the deviation of each picture from its stated position and the positions of the corners.
///
/// # Errors
/// The file cannot be written.
pub(super) fn axis(path: &Path, pictures: &AxisPictures, fit: &AxisFit) -> anyhow::Result<()> {
    let (unit, factor) = match fit.axis.kind {
        AxisKind::Revolute => ("off [°]", 180.0 / PI),
        AxisKind::Prismatic => ("off [mm]", 1e3),
    };
    let sense = fit.agreement.scale.signum();
    let off: Vec<_> = fit.agreement.off.iter().map(|off| sense * factor * off).collect();
    let markers = pictures.views.iter().flat_map(AxisView::markers).flat_map(|m| m.corners);
    let boards = pictures.views.iter().filter_map(AxisView::board);
    let corners = boards.flat_map(|board| board.corners.iter().map(|corner| corner.seen));
    let seen: Vec<_> = markers.chain(corners).map(|at| (at.x, at.y)).collect();
    let rows = padded(seen.iter().map(|at| at.1));
    let charts = [
        Chart {
            title: "each picture off its stated position".to_owned(),
            labels: ["picture", unit],
            ranges: [places(off.len()), padded(off.iter().copied().chain([0.0]))],
            marks: Marks::Bars(off),
        },
        Chart {
            title: "corners seen".to_owned(),
            labels: ["column [px]", "row [px]"],
            ranges: [padded(seen.iter().map(|at| at.0)), rows.end..rows.start],
            marks: Marks::Dots(seen),
        },
    ];
    charts::save(path, &charts)
}
