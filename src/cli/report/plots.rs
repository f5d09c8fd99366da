//! The figures of a report as files.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;

use crate::{
    cli::{
        height_picture,
        plots::{Curve, Plot},
    },
    report::{chart::Chart, grid::Place, map::Measured, scan_report::ScanReport},
};

/// Writes the figures, replacing existing files, and returns their paths.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write(directory: &Path, report: &ScanReport<'_>) -> anyhow::Result<Vec<PathBuf>> {
    let ScanReport { charts, overlays, .. } = report;
    let measured = report.measured.as_ref();
    fs::create_dir_all(directory)
        .with_context(|| format!("cannot create {}", directory.display()))?;
    let mut files = Vec::new();
    let plots = charts.iter().map(plot).chain(measured.into_iter().flat_map(sections));
    for plot in plots {
        plot.save(directory)?;
        files.push(directory.join(&plot.file));
    }
    for overlay in overlays {
        let path = directory.join(format!("frame_{}.svg", overlay.frame));
        fs::write(&path, overlay.svg()?)
            .with_context(|| format!("cannot write {}", path.display()))?;
        files.push(path);
    }
    if let Some(results) = measured.and_then(|measured| measured.results.as_ref()) {
        let path = directory.join("height_map.png");
        height_picture::save_scan(&path, results)?;
        files.push(path);
    }
    Ok(files)
}

fn plot(chart: &Chart) -> Plot {
    let curve = |curve: &crate::report::chart::Curve| {
        let points = chart.x.iter().copied().zip(curve.values.iter().copied());
        Curve::plain(&curve.name, points.collect())
    };
    Plot {
        file: format!("{}.svg", chart.id),
        title: chart.title.to_owned(),
        x_label: chart.x_label,
        y_label: chart.y_label,
        is_log: false,
        curves: chart.curves.iter().map(curve).collect(),
    }
}

/// Returns the middle profile and the middle section along the motion; empty without a height map.
fn sections(measured: &Measured) -> Vec<Plot> {
    if measured.results.is_none() {
        return Vec::new();
    }
    let [across, along] = &measured.sections;
    let section = |(name, title, at, x_label): (&str, &str, usize, _), places: &[Place]| {
        let known = places.iter().filter(|place| place[2].is_finite());
        let mm = |value: f32| 1e3 * f64::from(value);
        let points = known.map(|place| (mm(place[at]), mm(place[2]))).collect();
        Plot {
            file: format!("section_{name}.svg"),
            title: title.to_owned(),
            x_label,
            y_label: "z [mm]",
            is_log: false,
            curves: vec![Curve::plain("height", points)],
        }
    };
    vec![
        section(("across", "The middle profile", 0, "x [mm]"), across),
        section(("along", "Along the motion, through the middle", 1, "y [mm]"), along),
    ]
}
