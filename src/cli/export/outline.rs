//! What is known of a scan after it was read once: how many points, where, how dense.

use anyhow::ensure;
use nalgebra::{Isometry3, Point3};

use crate::{
    cli::results::{Read, Results},
    metrology::surface::Region,
    scanner::scan::Point,
};

/// Most rows whose distances are kept for the median.
const MAX_ROWS: usize = 1 << 20;
/// Heights that decide on the scale of colours.
const MAX_HEIGHTS: usize = 1 << 18;

/// Which points are taken, and where they are put.
pub(super) struct Placing {
    pub(super) region: Region,
    /// Lowest and highest, metres.
    pub(super) heights_m: [f64; 2],
    pub(super) motion: Option<Isometry3<f64>>,
}

impl Placing {
    /// The place and the intensity of a point that is taken.
    pub(super) fn point(&self, point: &Point) -> Option<(Point3<f64>, f32)> {
        let [x, y, z, intensity] = *point;
        let place = Point3::new(f64::from(x), f64::from(y), f64::from(z));
        let [low, high] = self.heights_m;
        if !(low..=high).contains(&place.z) || !self.region.contains(place.x, place.y) {
            return None;
        }
        Some((self.motion.as_ref().map_or(place, |motion| motion * place), intensity))
    }

    /// The points of a row that are taken, as they are written.
    pub(super) fn points(&self, row: &[Point]) -> impl Iterator<Item = Point> {
        row.iter().filter_map(|point| {
            let (place, intensity) = self.point(point)?;
            Some([place.x as f32, place.y as f32, place.z as f32, intensity])
        })
    }
}

/// The points that are taken, from afar.
pub(super) struct Outline {
    pub(super) num_points: u64,
    pub(super) from_m: [f64; 3],
    pub(super) to_m: [f64; 3],
    /// Typical distance of neighbours in a profile and of neighbouring profiles, metres.
    pub(super) pitch_m: [f64; 2],
    /// Some of the heights, in order.
    heights_m: Vec<f32>,
}

impl Outline {
    /// The smallest region with all points.
    pub(super) fn region(&self) -> Region {
        let corner = |place: [f64; 3]| [place[0], place[1]];
        Region { from_m: corner(self.from_m), to_m: corner(self.to_m) }
    }

    /// The scale of colours: without the lowest and highest half percent.
    pub(super) fn color_scale_m(&self) -> [f32; 2] {
        scale_m(&self.heights_m)
    }
}

/// A scale of colours for heights in ascending order, without the lowest and highest half percent, never empty.
pub(super) fn scale_m(sorted_m: &[f32]) -> [f32; 2] {
    let last = sorted_m.len().saturating_sub(1);
    let at =
        |share: f64| sorted_m.get((share * last as f64).round() as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.005), at(0.995));
    if high > low { [low, high] } else { [low - 0.5e-6, low + 0.5e-6] }
}

/// Reads a scan once.
///
/// # Errors
/// A scan without points that are taken.
pub(super) fn of(results: &Results, placing: &Placing) -> anyhow::Result<(Outline, Read)> {
    let mut outline = Outline {
        num_points: 0,
        from_m: [f64::INFINITY; 3],
        to_m: [f64::NEG_INFINITY; 3],
        pitch_m: [0.0; 2],
        heights_m: Vec::new(),
    };
    let mut distances = [Vec::new(), Vec::new()];
    let (mut before, mut row) = (Vec::<Option<Point3<f64>>>::new(), Vec::new());
    let read = results.profiles(|profile| {
        row.clear();
        row.extend(profile.iter().map(|point| placing.point(point).map(|(place, _)| place)));
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
    ensure!(outline.num_points > 0, "{} has no measured point there", results.topic);
    outline.pitch_m = distances.map(|values| median(values.into_iter()).unwrap_or(0.0));
    if outline.pitch_m.contains(&0.0) {
        outline.pitch_m = [outline.pitch_m[0].max(outline.pitch_m[1]); 2];
    }
    outline.heights_m.sort_by(f32::total_cmp);
    Ok((outline, read))
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
