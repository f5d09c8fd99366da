//! The map of a report: heights with a calibration, otherwise the position of the stripe in the image.

use anyhow::Context;

use super::color;
use crate::{
    msg::{cdr, convert::results::stripe_direction, laser_profiler_msgs::Centerline},
    report::{
        grid::{Extent, Grid, Place},
        page::{Axis, Map},
    },
    results::{Notes, Results, ResultsRecording, ScanSelection, SelectionError},
    scanner::params::StripeDirection,
};

/// The map of a report, and data for its figures.
pub(crate) struct Measured {
    pub(crate) map: Map,
    pub(crate) extent: Extent,
    /// The scan; `None` if the map shows centrelines.
    pub(crate) results: Option<Results>,
    /// The middle profile, and the middle section along the motion.
    pub(crate) sections: [Vec<Place>; 2],
}

const METRES: [Axis; 3] = [
    Axis { label: "x", unit: "mm", factor: 1e3, digits: 3 },
    Axis { label: "y", unit: "mm", factor: 1e3, digits: 3 },
    Axis { label: "z", unit: "mm", factor: 1e3, digits: 4 },
];
const PIXELS: [Axis; 3] = [
    Axis { label: "column", unit: "px", factor: 1.0, digits: 0 },
    Axis { label: "frame", unit: "", factor: 1.0, digits: 0 },
    Axis { label: "row", unit: "px", factor: 1.0, digits: 3 },
];

/// Reads the map. Reads the recording twice to hold only the map in memory.
///
/// # Errors
/// [`SelectionError`] for a topic or a scan that does not exist.
pub(crate) fn read(
    selection: &ScanSelection,
    recording: &ResultsRecording,
    notes: &mut Notes,
) -> anyhow::Result<Option<Measured>> {
    let is_chosen = selection.topic.is_some() || selection.scan.is_some();
    match open(selection, recording, notes) {
        Ok(results) => heights(results, notes).map(Some),
        Err(error) if error.is::<SelectionError>() && is_chosen => Err(error),
        Err(error) => {
            notes.add(format!("no height map: {error:#}"));
            Ok(centerlines(recording, notes))
        }
    }
}

/// Opens the selected scan; without a selection the first of several, with a note.
fn open(
    selection: &ScanSelection,
    recording: &ResultsRecording,
    notes: &mut Notes,
) -> anyhow::Result<Results> {
    let topic = selection.topic.clone().or_else(|| recording.topic("points"));
    let selection = ScanSelection { topic, ..selection.clone() };
    match Results::open(&selection) {
        Err(error) if error.is::<SelectionError>() && selection.scan.is_none() => {
            let first = Results::open(&ScanSelection { scan: Some(0), ..selection })?;
            notes.add(format!("{error}; scan 0 is shown"));
            Ok(first)
        }
        opened => opened,
    }
}

fn heights(results: Results, notes: &mut Notes) -> anyhow::Result<Measured> {
    let mut row = Vec::new();
    let mut rejected = 0;
    let mut rows = |take: &mut dyn FnMut(&[Place])| {
        let read = results.for_each_profile(|profile| {
            row.clear();
            row.extend(profile.iter().map(|&[x, y, z, _]| [x, y, z]));
            take(&row);
            Ok(())
        });
        rejected = read.map_or(0, |read| read.rejected);
    };
    let Mapped { extent, grid, sections } = mapped(&mut rows).context("the scan is empty")?;
    if rejected > 0 {
        notes.add_loss(format!("{}: {rejected} point clouds could not be read", results.topic()));
    }
    if let Err(reason) = results.check_surface() {
        notes.add(format!("the height map shows no surface: {reason}"));
    }
    let [x, y, _] = extent.ranges.map(|[low, high]| 1e3 * f64::from(high - low));
    let caption = format!(
        "{} profiles of {} points, {} measured; {x:.1} mm by {y:.1} mm.{} Grey: not measured.",
        extent.rows,
        extent.columns,
        extent.num_measured,
        thinned(&grid)
    );
    let map = finished("Height map", caption, METRES, grid);
    Ok(Measured { map, extent, results: Some(results), sections })
}

fn centerlines(recording: &ResultsRecording, notes: &mut Notes) -> Option<Measured> {
    let topic = recording.topic("centerline")?;
    let mut is_upright = false;
    let mut rows = |take: &mut dyn FnMut(&[Place])| {
        let (mut row, mut frame) = (Vec::new(), 0.0_f32);
        recording.for_each_message(&[&topic], notes, |message| {
            let line: Centerline<'_> = cdr::decode(&message.data)?;
            let direction = stripe_direction(&line)?;
            is_upright |= direction == StripeDirection::Vertical;
            lay(&line, direction, frame, &mut row);
            take(&row);
            frame += 1.0;
            Ok(())
        });
    };
    let Mapped { extent, grid, sections } = mapped(&mut rows)?;
    let mut axes = PIXELS;
    if is_upright {
        (axes[0].label, axes[2].label) = ("row", "column");
    }
    let caption = format!(
        "Position of the stripe in the images: {} frames, {} points.{} Grey: no stripe found.",
        extent.rows,
        extent.num_measured,
        thinned(&grid)
    );
    let map = Map { is_metric: false, ..finished("Centrelines", caption, axes, grid) };
    Some(Measured { map, extent, results: None, sections })
}

/// Lays out a centreline as points (position along the stripe, frame, position across it), one per pixel along the stripe.
fn lay(line: &Centerline<'_>, direction: StripeDirection, frame: f32, row: &mut Vec<Place>) {
    let (along, across, length) = match direction {
        StripeDirection::Horizontal => (&line.u, &line.v, line.image_width),
        StripeDirection::Vertical => (&line.v, &line.u, line.image_height),
    };
    row.clear();
    // Limits the memory that a message can claim.
    row.resize(length.min(1 << 16) as usize, [f32::NAN; 3]);
    for (at, across) in along.iter().zip(across.iter()) {
        if let Some(place) = row.get_mut(at.round() as usize).filter(|place| place[0].is_nan()) {
            *place = [*at, frame, *across];
        }
    }
}

type Rows<'a> = dyn FnMut(&mut dyn FnMut(&[Place])) + 'a;

/// Rows on a grid.
pub(super) struct Mapped {
    pub(super) extent: Extent,
    pub(super) grid: Grid,
    /// The middle row, and the middle place of every row that the grid shows.
    pub(super) sections: [Vec<Place>; 2],
}

/// Lays rows on a grid; reads them twice. None if nothing was measured.
pub(super) fn mapped(rows: &mut Rows<'_>) -> Option<Mapped> {
    let mut extent = Extent::default();
    rows(&mut |row| extent.add(row));
    if extent.num_measured == 0 {
        return None;
    }
    let mut grid = Grid::new(&extent);
    let (mut across, mut along) = (Vec::new(), Vec::new());
    let mut number = 0;
    rows(&mut |row| {
        grid.push(row);
        if number == extent.rows / 2 {
            across.extend_from_slice(row);
        }
        if number % grid.steps()[0] == 0 {
            along.push(row.get(extent.columns / 2).copied().unwrap_or([f32::NAN; 3]));
        }
        number += 1;
    });
    Some(Mapped { extent, grid, sections: [across, along] })
}

/// Describes the thinning of a grid; empty if it shows every point.
pub(super) fn thinned(grid: &Grid) -> String {
    let [rows, columns] = grid.steps();
    let every = |step: usize, what: &str| match step {
        1 => format!("every {what}"),
        2 => format!("every 2nd {what}"),
        3 => format!("every 3rd {what}"),
        step => format!("every {step}th {what}"),
    };
    if [rows, columns] == [1, 1] {
        return String::new();
    }
    format!(" Shown: {} and {}.", every(rows, "profile"), every(columns, "point"))
}

fn finished(title: &'static str, caption: String, axes: [Axis; 3], grid: Grid) -> Map {
    let (about, packed) = grid.finish();
    Map {
        title,
        caption,
        sections: [
            "Across the motion: one profile",
            "Along the motion: the same point of every profile",
        ],
        axes,
        is_metric: true,
        colors: color::scale(),
        about,
        packed,
    }
}
