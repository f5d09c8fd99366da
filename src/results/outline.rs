//! Number, extent and density of a scan's points.

use anyhow::ensure;
use nalgebra::{Isometry3, Point3};

use super::{ReadCounts, Results, SelectionError, no_surface::ScanIsNoSurface};
use crate::{
    metrology::{
        height_map::{GridLayout, RegularHeightMap, Resampler},
        no_surface::NoSurface,
        surface::Region,
    },
    scanner::scan::Point,
};

/// Maximum number of rows whose distances are kept for the median.
const MAX_ROWS: usize = 1 << 20;
/// Maximum number of heights that are kept for the colour scale.
const MAX_HEIGHTS: usize = 1 << 18;

/// Selection of points, and a motion that is applied to them afterwards.
#[derive(Clone, Debug)]
pub(crate) struct Placing {
    /// Region in x and y.
    pub(crate) region: Region,
    /// Lowest and highest height, metres.
    pub(crate) heights_m: [f64; 2],
    /// Motion of the selected points; `None`: they stay in place.
    pub(crate) motion: Option<Isometry3<f64>>,
}

impl Default for Placing {
    /// All points, without motion.
    fn default() -> Self {
        Self { region: Region::ALL, heights_m: super::ANY_HEIGHT_M, motion: None }
    }
}

/// A point after its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Placed {
    place_m: Point3<f64>,
    intensity: f32,
}

impl Placing {
    fn placed(&self, point: &Point) -> Option<Placed> {
        let [x, y, z, intensity] = *point;
        let place = Point3::new(f64::from(x), f64::from(y), f64::from(z));
        let [low, high] = self.heights_m;
        if !(low..=high).contains(&place.z) || !self.region.contains(place.x, place.y) {
            return None;
        }
        let place_m = self.motion.as_ref().map_or(place, |motion| motion * place);
        Some(Placed { place_m, intensity })
    }

    /// Returns the position of a point after its motion, metres; `None` if the point is not selected.
    fn place_m(&self, point: &Point) -> Option<Point3<f64>> {
        Some(self.placed(point)?.place_m)
    }

    /// Returns the selected points of a profile after their motion, metres and intensity.
    pub(crate) fn points(&self, profile: &[Point]) -> impl Iterator<Item = Point> {
        profile.iter().filter_map(|point| {
            let Placed { place_m: place, intensity } = self.placed(point)?;
            Some([place.x as f32, place.y as f32, place.z as f32, intensity])
        })
    }
}

/// Number, extent and density of the selected points.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    /// Number of points.
    pub(crate) num_points: u64,
    /// Smallest x, y and z, metres.
    pub(crate) from_m: [f64; 3],
    /// Largest x, y and z, metres.
    pub(crate) to_m: [f64; 3],
    /// Typical distance of neighbours in a profile, and of neighbouring profiles, metres.
    pub(crate) pitch_m: [f64; 2],
    /// Profiles and clouds read.
    pub(crate) counts: ReadCounts,
    /// Typical distance of neighbours in a profile, metres; 0 if there are none.
    in_profile_m: f64,
    /// A sample of the heights in ascending order.
    heights_m: Vec<f32>,
}

impl Outline {
    /// Returns the smallest region that contains all points.
    #[must_use]
    pub(crate) fn region(&self) -> Region {
        let corner = |place: [f64; 3]| [place[0], place[1]];
        Region { from_m: corner(self.from_m), to_m: corner(self.to_m) }
    }

    /// Returns the colour scale of the heights, metres; see [`color_scale_m`].
    #[must_use]
    pub(crate) fn color_scale_m(&self) -> [f32; 2] {
        color_scale_m(&self.heights_m)
    }

    /// Checks that the selected points extend further across the stripe than half the distance of neighbouring points in a profile.
    fn check(&self, results: &Results) -> Result<(), ScanIsNoSurface> {
        let narrow_m =
            (0..2).map(|axis| self.to_m[axis] - self.from_m[axis]).fold(f64::INFINITY, f64::min);
        if narrow_m < 0.5 * self.in_profile_m {
            let profiles = self.counts.profiles as usize;
            return Err(results.no_surface(NoSurface::OnePlace { profiles }));
        }
        Ok(())
    }

    /// Returns a side of square cells that suits the density of the points, metres.
    ///
    /// # Errors
    /// All points lie on one line.
    pub(crate) fn cell_m(&self) -> Result<f64, SelectionError> {
        let cell_m = (self.pitch_m[0] * self.pitch_m[1]).sqrt();
        if cell_m > 0.0 {
            return Ok(cell_m);
        }
        Err(SelectionError(
            "the points lie on one line: --cell must state the size of a cell".into(),
        ))
    }
}

/// Returns a colour scale for heights in ascending order: without the lowest and highest half percent, never empty.
#[must_use]
pub(crate) fn color_scale_m(sorted_m: &[f32]) -> [f32; 2] {
    let last = sorted_m.len().saturating_sub(1);
    let at =
        |share: f64| sorted_m.get((share * last as f64).round() as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.005), at(0.995));
    if high > low { [low, high] } else { [low - 0.5e-6, low + 0.5e-6] }
}

impl Results {
    /// Reads the scan once and returns the outline of the selected points.
    ///
    /// # Errors
    /// A scan without selected points.
    pub(crate) fn outline(&self, placing: &Placing) -> anyhow::Result<Outline> {
        outline(self, placing)
    }

    /// Reads the scan again and returns its height map over the outline, with square cells of side `cell_m`, metres.
    ///
    /// # Errors
    /// The scan is no surface, or more cells than allowed in memory.
    pub(crate) fn height_map(
        &self,
        placing: &Placing,
        outline: &Outline,
        cell_m: f64,
    ) -> anyhow::Result<RegularHeightMap> {
        self.check_surface()?;
        outline.check(self)?;
        let layout = GridLayout::covering(&outline.region(), cell_m)?;
        let mut resampler = Resampler::new(layout, outline.pitch_m);
        let not_measured = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let mut row = Vec::new();
        self.for_each_profile(|profile| {
            row.clear();
            row.extend(profile.iter().map(|point| placing.place_m(point).unwrap_or(not_measured)));
            resampler.push(&row);
            Ok(())
        })?;
        Ok(resampler.finish())
    }
}

fn outline(results: &Results, placing: &Placing) -> anyhow::Result<Outline> {
    let mut outline = Outline {
        num_points: 0,
        from_m: [f64::INFINITY; 3],
        to_m: [f64::NEG_INFINITY; 3],
        pitch_m: [0.0; 2],
        counts: ReadCounts::default(),
        in_profile_m: 0.0,
        heights_m: Vec::new(),
    };
    let mut distances = [Vec::new(), Vec::new()];
    let (mut before, mut row) = (Vec::<Option<Point3<f64>>>::new(), Vec::new());
    let counts = results.for_each_profile(|profile| {
        row.clear();
        row.extend(profile.iter().map(|point| placing.place_m(point)));
        for place in row.iter().flatten() {
            for axis in 0..3 {
                outline.from_m[axis] = outline.from_m[axis].min(place[axis]);
                outline.to_m[axis] = outline.to_m[axis].max(place[axis]);
            }
            // Every 64th point stands for its neighbours.
            if outline.num_points.is_multiple_of(64) && outline.heights_m.len() < MAX_HEIGHTS {
                outline.heights_m.push(place.z as f32);
            }
            outline.num_points += 1;
        }
        if distances[0].len() < MAX_ROWS {
            let far = |a: &Option<Point3<f64>>, b: &Option<Point3<f64>>| {
                Some((a.as_ref()?.xy() - b.as_ref()?.xy()).norm())
            };
            distances[0].extend(median(row.windows(2).filter_map(|pair| far(&pair[0], &pair[1]))));
            distances[1].extend(median(row.iter().zip(&before).filter_map(|(a, b)| far(a, b))));
        }
        std::mem::swap(&mut before, &mut row);
        Ok(())
    })?;
    outline.counts = counts;
    ensure!(outline.num_points > 0, "{} has no measured point in the selection", results.topic());
    outline.pitch_m = distances.map(|values| median(values.into_iter()).unwrap_or(0.0));
    outline.in_profile_m = outline.pitch_m[0];
    if outline.pitch_m.contains(&0.0) {
        outline.pitch_m = [outline.pitch_m[0].max(outline.pitch_m[1]); 2];
    }
    outline.heights_m.sort_by(f32::total_cmp);
    Ok(outline)
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
