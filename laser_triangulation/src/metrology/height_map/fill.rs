//! Interpolation of small gaps in a height map, on request.

use super::{CellState, RegularHeightMap};

/// Fills gaps of at most `max_cells` cells along a row or a column by linear interpolation between the measured cells
/// at both ends, in the shorter direction if both are possible. Flags filled cells; keeps gaps at the border. Returns
/// the number of filled cells.
pub fn fill_gaps(map: &mut RegularHeightMap, max_cells: usize) -> usize {
    let (width, height) = (map.layout.width as usize, map.layout.height as usize);
    let mut found: Vec<FilledCell> = Vec::new();
    for row in 0..height {
        gaps(map, CellLine { first: row * width, step: 1, length: width }, max_cells, &mut found);
    }
    for column in 0..width {
        let line = CellLine { first: column, step: width, length: height };
        gaps(map, line, max_cells, &mut found);
    }
    // Shortest gap first, then grid order, so that the result is deterministic.
    found.sort_by_key(|cell| (cell.index, cell.gap));
    found.dedup_by_key(|cell| cell.index);
    for cell in &found {
        map.z_m[cell.index] = cell.z_m;
        map.states[cell.index] = CellState::Filled;
    }
    found.len()
}

/// A row or a column of the map, as indices of its cells.
#[derive(Clone, Copy)]
struct CellLine {
    first: usize,
    /// Distance between neighbours.
    step: usize,
    length: usize,
}

/// An interpolated cell.
struct FilledCell {
    index: usize,
    z_m: f32,
    /// Number of cells of its gap.
    gap: usize,
}

/// Adds the interpolated cells of one line to `found`.
fn gaps(map: &RegularHeightMap, line: CellLine, max_cells: usize, found: &mut Vec<FilledCell>) {
    let CellLine { first, step, length } = line;
    let mut last: Option<usize> = None;
    for at in 0..length {
        if !map.z_m[first + at * step].is_finite() {
            continue;
        }
        if let Some(start) = last.filter(|start| (1..=max_cells).contains(&(at - start - 1))) {
            let [from, to] = [start, at].map(|at| map.z_m[first + at * step]);
            for between in start + 1..at {
                let share = (between - start) as f32 / (at - start) as f32;
                found.push(FilledCell {
                    index: first + between * step,
                    z_m: from + share * (to - from),
                    gap: at - start - 1,
                });
            }
        }
        last = Some(at);
    }
}
