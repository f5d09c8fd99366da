//! Step 4 of Yao et al. 2023: finds connected regions of the blurred image above the threshold and keeps those large
//! enough to be stripe.
//!
//! Time and memory grow with the runs, not with the pixels. In the worst case there is a run every two pixels of a row
//! and a region every four pixels: 11 bytes a pixel, far more than occurs after a blur.

/// Consecutive samples of one row above the threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// Row.
    pub(crate) row: u32,
    /// First column.
    pub(crate) start: u32,
    /// Column behind the last one.
    pub(crate) end: u32,
    /// Provisional label of the region: look it up with [`Regions::area`].
    label: u32,
}

/// Runs of an image in row order, joined into regions of 8-connected pixels.
#[derive(Debug, Default)]
pub(super) struct Regions {
    runs: Vec<Run>,
    /// Union-find forest over labels; a label's parent is never larger than itself.
    parent: Vec<u32>,
    /// Pixels of a region, stored at its root.
    area: Vec<u64>,
    /// Index of the first run of the previous and of the current row.
    previous: usize,
    current: usize,
}

impl Regions {
    /// Removes all runs, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.runs.clear();
        self.parent.clear();
        self.area.clear();
        self.previous = 0;
        self.current = 0;
    }

    /// Starts the next row. Call it for every row in order, including rows without runs.
    pub(super) fn start_row(&mut self) {
        self.previous = self.current;
        self.current = self.runs.len();
    }

    /// Adds a run of the current row, to the right of the row's earlier ones.
    pub(super) fn push(&mut self, row: u32, start: u32, end: u32) {
        // Runs above that end to the left of this one cannot touch this or any later run of the row.
        while self.previous < self.current && self.runs[self.previous].end < start {
            self.previous += 1;
        }
        let mut label = None;
        for at in self.previous..self.current {
            let above = self.runs[at];
            if above.start > end {
                break;
            }
            let root = self.root(above.label);
            label = Some(label.map_or(root, |label| self.join(label, root)));
        }
        let label = label.unwrap_or_else(|| {
            self.parent.push(self.parent.len() as u32);
            self.area.push(0);
            self.parent.len() as u32 - 1
        });
        self.area[label as usize] += u64::from(end - start);
        self.runs.push(Run { row, start, end, label });
    }

    /// Returns the runs of regions with more than `min_area` pixels, row by row, left to right.
    pub(super) fn larger_than(&mut self, min_area: u32) -> impl Iterator<Item = Run> + '_ {
        for label in 0..self.parent.len() as u32 {
            let root = self.root(label);
            self.parent[label as usize] = root;
        }
        let (parent, area) = (&self.parent, &self.area);
        let region_area = move |run: &Run| area[parent[run.label as usize] as usize];
        self.runs.iter().filter(move |run| region_area(run) > u64::from(min_area)).copied()
    }

    fn root(&mut self, mut label: u32) -> u32 {
        while self.parent[label as usize] != label {
            let grandparent = self.parent[self.parent[label as usize] as usize];
            self.parent[label as usize] = grandparent;
            label = grandparent;
        }
        label
    }

    fn join(&mut self, a: u32, b: u32) -> u32 {
        let (low, high) = (a.min(b), a.max(b));
        if low != high {
            self.parent[high as usize] = low;
            self.area[low as usize] += std::mem::take(&mut self.area[high as usize]);
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of `#` and `.`; the answer marks kept pixels with `#`.
    fn keep(picture: &[&str], min_area: u32) -> Vec<String> {
        let mut regions = Regions::default();
        for (y, row) in picture.iter().enumerate() {
            regions.start_row();
            let mut start = None;
            for (x, c) in row.chars().chain(['.']).enumerate() {
                match (c, start) {
                    ('#', None) => start = Some(x),
                    ('.', Some(begun)) => {
                        regions.push(y as u32, begun as u32, x as u32);
                        start = None;
                    }
                    _ => {}
                }
            }
        }
        let mut kept: Vec<Vec<char>> = picture.iter().map(|row| vec!['.'; row.len()]).collect();
        for run in regions.larger_than(min_area) {
            kept[run.row as usize][run.start as usize..run.end as usize].fill('#');
        }
        kept.into_iter().map(|row| row.into_iter().collect()).collect()
    }

    #[test]
    fn small_regions_are_noise() {
        let picture = ["##...#", "##....", "....##"];
        assert_eq!(keep(&picture, 3), ["##....", "##....", "......"]);
        assert_eq!(keep(&picture, 4), ["......"; 3], "an area must be larger than the minimum");
    }

    #[test]
    fn corners_connect() {
        assert_eq!(
            keep(&["#....", ".#...", "..#..", "....#"], 2),
            ["#....", ".#...", "..#..", "....."]
        );
    }

    #[test]
    fn branches_that_meet_later_are_one_region() {
        let picture = ["#.#.#", "#.#.#", "###.#", "..###"];
        assert_eq!(keep(&picture, 12), picture.map(str::to_owned));
        assert_eq!(keep(&picture, 13), ["....."; 4]);
    }

    #[test]
    fn a_row_without_runs_separates() {
        assert_eq!(keep(&["##", "..", "##"], 2), [".."; 3]);
    }
}
