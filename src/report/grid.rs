//! Measured points for a page in 16-bit codes, not resampled.

use serde::Serialize;

use super::pack::pack;

/// x, y and z of a point; all NaN if it was not measured.
pub(crate) type Place = [f32; 3];

/// Maximum number of points of a page. Heights of pure noise take 7.5 MB of text, typical ones half of that; x and y take
/// almost nothing along a straight axis.
pub(crate) const MAX_POINTS: usize = 2_800_000;
/// The code of a point that was not measured.
pub(crate) const MISSING: i16 = i16::MIN;
/// Codes of numbers range from `-LAST_CODE` to `LAST_CODE`.
const LAST_CODE: f64 = 32_767.0;
/// Maximum number of heights that determine the colour scale.
const MAX_HEIGHTS: usize = 1 << 16;

/// Size and range of rows of points.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Extent {
    /// Number of rows.
    pub(crate) rows: usize,
    /// Points of the longest row.
    pub(crate) columns: usize,
    /// Measured points.
    pub(crate) num_measured: u64,
    /// Smallest and largest x, y and z.
    pub(crate) ranges: [[f32; 2]; 3],
}

impl Default for Extent {
    fn default() -> Self {
        let ranges = [[f32::INFINITY, f32::NEG_INFINITY]; 3];
        Self { rows: 0, columns: 0, num_measured: 0, ranges }
    }
}

impl Extent {
    /// Adds the next row.
    pub(crate) fn add(&mut self, row: &[Place]) {
        self.rows += 1;
        self.columns = self.columns.max(row.len());
        for place in row.iter().filter(|place| is_measured(place)) {
            self.num_measured += 1;
            for ([low, high], value) in self.ranges.iter_mut().zip(place) {
                (*low, *high) = (low.min(*value), high.max(*value));
            }
        }
    }
}

fn is_measured(place: &Place) -> bool {
    place.iter().all(|value| value.is_finite())
}

/// Conversion of codes to numbers: `offset + step * code`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Scale {
    offset: f64,
    step: f64,
}

impl Scale {
    fn covering([low, high]: [f32; 2]) -> Self {
        let [low, high] = [low, high].map(f64::from);
        // One value only: any step does.
        let step = if high > low { 0.5 * (high - low) / LAST_CODE } else { 1.0 };
        Self { offset: 0.5 * (low + high), step }
    }

    fn code(&self, value: f32) -> i16 {
        let code = ((f64::from(value) - self.offset) / self.step).round();
        code.clamp(-LAST_CODE, LAST_CODE) as i16
    }

    fn value(&self, code: i16) -> f64 {
        self.offset + self.step * f64::from(code)
    }
}

/// Rows of points in codes: all points, or every n-th if there are more than [`MAX_POINTS`].
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    rows: usize,
    columns: usize,
    steps: [usize; 2],
    num_pushed: usize,
    scales: [Scale; 3],
    codes: [Vec<i16>; 3],
}

/// Description of a grid; the codes are stored separately.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct About {
    rows: usize,
    columns: usize,
    /// Every `row_step`-th row and every `column_step`-th point of a row is kept.
    row_step: usize,
    column_step: usize,
    missing: i16,
    /// Scales of x, y and z.
    scales: [Scale; 3],
    /// Ends of the colour scale, in units of z.
    colors: [f64; 2],
}

impl About {
    /// Centres the colour scale at zero.
    #[must_use]
    pub(crate) fn about_zero(self) -> Self {
        let largest = self.colors[0].abs().max(self.colors[1].abs());
        Self { colors: [-largest, largest], ..self }
    }
}

impl Grid {
    /// Creates a grid for rows of this extent.
    #[must_use]
    pub(crate) fn new(extent: &Extent) -> Self {
        let mut steps = [1, 1];
        let count =
            |steps: [usize; 2]| [extent.rows.div_ceil(steps[0]), extent.columns.div_ceil(steps[1])];
        loop {
            let [rows, columns] = count(steps);
            if rows.saturating_mul(columns) <= MAX_POINTS {
                let scales = extent.ranges.map(Scale::covering);
                return Self {
                    rows,
                    columns,
                    steps,
                    num_pushed: 0,
                    scales,
                    codes: Default::default(),
                };
            }
            steps[usize::from(columns > rows)] += 1;
        }
    }

    /// Steps between kept rows, and between kept points of a row.
    #[must_use]
    pub(crate) const fn steps(&self) -> [usize; 2] {
        self.steps
    }

    /// Adds the next row. Ignores rows beyond the extent.
    pub(crate) fn push(&mut self, row: &[Place]) {
        let is_kept = self.num_pushed.is_multiple_of(self.steps[0])
            && self.num_pushed / self.steps[0] < self.rows;
        self.num_pushed += 1;
        if !is_kept {
            return;
        }
        let nothing = [f32::NAN; 3];
        let kept = (0..self.columns).map(|column| row.get(column * self.steps[1]));
        for place in kept.map(|place| place.unwrap_or(&nothing)) {
            for (axis, codes) in self.codes.iter_mut().enumerate() {
                let is_measured = is_measured(place);
                codes.push(if is_measured { self.scales[axis].code(place[axis]) } else { MISSING });
            }
        }
    }

    /// Returns the description and the packed codes of x, y and z. Rows that were not added are missing.
    #[must_use]
    pub(crate) fn finish(mut self) -> (About, String) {
        for codes in &mut self.codes {
            codes.resize(self.rows * self.columns, MISSING);
        }
        let about = About {
            rows: self.rows,
            columns: self.columns,
            row_step: self.steps[0],
            column_step: self.steps[1],
            missing: MISSING,
            scales: self.scales,
            colors: self.colors(),
        };
        let [x, y, z] = &self.codes;
        (about, pack(&[x, y, z], self.columns))
    }

    /// Returns the range of heights without the lowest and highest half per cent.
    fn colors(&self) -> [f64; 2] {
        let z = &self.codes[2];
        let step = (z.len() / MAX_HEIGHTS).max(1);
        // Neither rows nor columns are a multiple of an odd number of places apart for long.
        let mut sample: Vec<i16> =
            z.iter().step_by(step | 1).copied().filter(|code| *code != MISSING).collect();
        sample.sort_unstable();
        let last = sample.len().saturating_sub(1) as f64;
        [0.005, 0.995].map(|share: f64| {
            let code = sample.get((share * last).round() as usize).copied().unwrap_or(0);
            self.scales[2].value(code)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: usize, columns: usize) -> Grid {
        Grid::new(&Extent { rows, columns, ranges: [[0.0, 1.0]; 3], ..Extent::default() })
    }

    #[test]
    fn codes_are_the_heights_to_half_a_step_and_missing_ones_stay_missing() {
        let nan = [f32::NAN; 3];
        let rows = [vec![[0.0, 0.0, -2.0], nan, [2.0, 0.0, 5.0]], vec![[0.0, 1.0, 0.125]]];
        let mut extent = Extent::default();
        for row in &rows {
            extent.add(row);
        }
        assert_eq!((extent.rows, extent.columns, extent.num_measured), (2, 3, 3));
        let mut grid = Grid::new(&extent);
        for row in &rows {
            grid.push(row);
        }
        let z = &grid.codes[2];
        assert_eq!((z[0], z[1], z[2]), (-32_767, MISSING, 32_767));
        let step = 7.0 / 65_534.0;
        assert!((grid.scales[2].value(z[3]) - 0.125).abs() <= 0.5 * step);
        let (about, _) = grid.finish();
        assert!((about.scales[2].step - step).abs() < 1e-12);
    }

    #[test]
    fn too_many_points_are_thinned_evenly_and_never_more_than_allowed() {
        for (rows, columns) in [(1, 10_000_000), (5000, 4096), (1000, 2592), (100_000, 300)] {
            let grid = grid(rows, columns);
            assert!(grid.rows * grid.columns <= MAX_POINTS, "{:?}", grid.steps);
            assert_eq!(grid.steps == [1, 1], rows * columns <= MAX_POINTS, "{rows} x {columns}");
        }
        assert_eq!(grid(5000, 4096).steps, [3, 3]);
    }

    #[test]
    fn absent_rows_are_missing_and_extra_rows_are_ignored() {
        let mut short = grid(3, 2);
        short.push(&[[0.5; 3]; 5]);
        assert_eq!(short.codes[0], [0, 0]);
        assert_eq!(short.finish().0.rows, 3);
        let mut long = grid(1, 2);
        for _ in 0..3 {
            long.push(&[[0.5; 3]; 2]);
        }
        assert_eq!(long.codes[0], [0, 0]);
    }

    #[test]
    fn an_empty_grid_is_valid() {
        let grid = Grid::new(&Extent::default());
        let (about, _) = grid.finish();
        assert!(about.rows == 0 && about.scales.iter().all(|scale| scale.step > 0.0));
    }
}
