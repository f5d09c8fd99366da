//! The map of a report: heights where there is a calibration, else where the stripe was in the image.

use anyhow::Context;

use super::ReportArgs;
use crate::{
    cli::chart::viridis,
    msg::{cdr, convert::results::stripe_direction, laser_profiler_msgs::Centerline},
    report::{
        grid::{Extent, Grid, Place},
        page::{Axis, Map},
    },
    results::{Notes, Results, ResultsRecording, ScanSelection, SelectionError},
    scanner::params::StripeDirection,
};

/// What the files of a report need beside the page's map.
pub(super) struct Measured {
    pub(super) map: Map,
    pub(super) size: Extent,
    /// The scan; none where the map shows centrelines.
    pub(super) results: Option<Results>,
    /// The middle profile, and the line along the motion through the middle.
    pub(super) sections: [Vec<Place>; 2],
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

/// Reads what there is to map: twice, so that nothing but the map is held.
///
/// # Errors
/// [`SelectionError`] for a topic or a scan that is not there.
pub(super) fn read(
    args: &ReportArgs,
    source: &ResultsRecording,
    notes: &mut Notes,
) -> anyhow::Result<Option<Measured>> {
    let is_chosen = args.results.topic.is_some() || args.results.scan.is_some();
    match open(&args.results.selection(), source, notes) {
        Ok(results) => heights(results, notes).map(Some),
        Err(error) if error.is::<SelectionError>() && is_chosen => Err(error),
        Err(error) => {
            notes.add(format!("no height map: {error:#}"));
            Ok(centerlines(source, notes))
        }
    }
}

/// The scan that is meant; of several the first, which is told.
fn open(
    selection: &ScanSelection,
    source: &ResultsRecording,
    notes: &mut Notes,
) -> anyhow::Result<Results> {
    let topic = selection.topic.clone().or_else(|| source.topic("points"));
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
    let (size, grid, sections) = laid_out(&mut rows).context("the scan is empty")?;
    if rejected > 0 {
        notes.add_loss(format!("{}: {rejected} point clouds could not be read", results.topic()));
    }
    let [x, y, _] = size.ranges.map(|[low, high]| 1e3 * f64::from(high - low));
    let caption = format!(
        "{} profiles of {} points, {} measured; {x:.1} mm by {y:.1} mm.{} Grey: not measured.",
        size.rows,
        size.columns,
        size.num_measured,
        thinned(&grid)
    );
    let map = finished("Height map", caption, METRES, grid);
    Ok(Measured { map, size, results: Some(results), sections })
}

fn centerlines(source: &ResultsRecording, notes: &mut Notes) -> Option<Measured> {
    let topic = source.topic("centerline")?;
    let mut is_upright = false;
    let mut rows = |take: &mut dyn FnMut(&[Place])| {
        let (mut row, mut frame) = (Vec::new(), 0.0_f32);
        source.for_each_message(&[&topic], notes, |message| {
            let line: Centerline<'_> = cdr::decode(&message.data)?;
            let direction = stripe_direction(&line)?;
            is_upright |= direction == StripeDirection::Vertical;
            lay(&line, direction, frame, &mut row);
            take(&row);
            frame += 1.0;
            Ok(())
        });
    };
    let (size, grid, sections) = laid_out(&mut rows)?;
    let mut axes = PIXELS;
    if is_upright {
        (axes[0].label, axes[2].label) = ("row", "column");
    }
    let caption = format!(
        "Where the stripe was in the images: {} frames, {} points.{} Grey: no stripe found.",
        size.rows,
        size.num_measured,
        thinned(&grid)
    );
    let map = Map { is_metric: false, ..finished("Centrelines", caption, axes, grid) };
    Some(Measured { map, size, results: None, sections })
}

/// A centreline as places (position along the stripe, frame, position across it), one a pixel along the stripe.
fn lay(line: &Centerline<'_>, direction: StripeDirection, frame: f32, row: &mut Vec<Place>) {
    let (along, across, length) = match direction {
        StripeDirection::Horizontal => (&line.u, &line.v, line.image_width),
        StripeDirection::Vertical => (&line.v, &line.u, line.image_height),
    };
    row.clear();
    // No message makes a row longer than its images can be.
    row.resize(length.min(1 << 16) as usize, [f32::NAN; 3]);
    for (at, across) in along.iter().zip(across.iter()) {
        if let Some(place) = row.get_mut(at.round() as usize).filter(|place| place[0].is_nan()) {
            *place = [*at, frame, *across];
        }
    }
}

type Rows<'a> = dyn FnMut(&mut dyn FnMut(&[Place])) + 'a;

/// The places of rows that can be read twice; none where nothing was measured.
pub(in crate::cli) fn laid_out(rows: &mut Rows<'_>) -> Option<(Extent, Grid, [Vec<Place>; 2])> {
    let mut size = Extent::default();
    rows(&mut |row| size.add(row));
    if size.num_measured == 0 {
        return None;
    }
    let mut grid = Grid::new(&size);
    let (mut across, mut along) = (Vec::new(), Vec::new());
    let mut number = 0;
    rows(&mut |row| {
        grid.push(row);
        if number == size.rows / 2 {
            across.extend_from_slice(row);
        }
        if number % grid.steps()[0] == 0 {
            along.push(row.get(size.columns / 2).copied().unwrap_or([f32::NAN; 3]));
        }
        number += 1;
    });
    Some((size, grid, [across, along]))
}

/// What is to be said of a grid that does not show every point.
pub(in crate::cli) fn thinned(grid: &Grid) -> String {
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
        colors: colors(),
        about,
        packed,
    }
}

/// The scale of colours of the program's pictures.
pub(in crate::cli) fn colors() -> Vec<String> {
    let color = |at: u16| viridis(f32::from(at), [0.0, 255.0]);
    (0..256)
        .map(color)
        .map(|color| format!("#{:02x}{:02x}{:02x}", color.0, color.1, color.2))
        .collect()
}
