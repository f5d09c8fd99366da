//! Interpolation of small gaps in a height map, on request.

use super::{CellState, RegularHeightMap};

/// Fills gaps of at most `max_cells` cells along a row or a column by linear interpolation between the measured cells
/// at both ends, in the shorter direction if both are possible. Flags filled cells; keeps gaps at the border. Returns
/// the number of filled cells.
pub fn fill_gaps(map: &mut RegularHeightMap, max_cells: usize) -> usize {
    let (width, height) = (map.layout.width as usize, map.layout.height as usize);
    let mut found: Vec<(usize, usize, f32)> = Vec::new();
    for row in 0..height {
        gaps(map, (row * width, 1, width), max_cells, &mut found);
    }
    for column in 0..width {
        gaps(map, (column, width, height), max_cells, &mut found);
    }
    // Shortest gap first, then grid order, so that the result is deterministic.
    found.sort_by_key(|(length, cell, _)| (*cell, *length));
    found.dedup_by_key(|(_, cell, _)| *cell);
    for &(_, cell, z_m) in &found {
        map.z_m[cell] = z_m;
        map.states[cell] = CellState::Filled;
    }
    found.len()
}

/// Returns the gaps of one line of cells: `(first cell, distance of neighbours, cells)`.
fn gaps(
    map: &RegularHeightMap,
    (first, step, length): (usize, usize, usize),
    max_cells: usize,
    found: &mut Vec<(usize, usize, f32)>,
) {
    let mut last: Option<usize> = None;
    for at in 0..length {
        if !map.z_m[first + at * step].is_finite() {
            continue;
        }
        if let Some(start) = last.filter(|start| (1..=max_cells).contains(&(at - start - 1))) {
            let [from, to] = [start, at].map(|at| map.z_m[first + at * step]);
            for between in start + 1..at {
                let share = (between - start) as f32 / (at - start) as f32;
                found.push((at - start - 1, first + between * step, from + share * (to - from)));
            }
        }
        last = Some(at);
    }
}
