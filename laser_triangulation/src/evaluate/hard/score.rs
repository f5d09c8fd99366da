//! Points of a hard scene against its truth.

use serde::Serialize;

use super::{HardScene, LENGTH_PX};
use crate::{
    scanner::{
        params::ExtractionParams,
        stripe::{Centerline, flag},
    },
    statistics,
};

/// Distance from the truth within which a point is right whatever its standard deviation, pixels.
pub const NEAR_PX: f64 = 1.0;
/// Standard deviations of its own within which a point is right.
const WITHIN_SIGMAS: f64 = 3.0;
/// Flags that put a point in doubt.
pub const DOUBT: u8 =
    flag::MULTIPLE_PEAKS | flag::LOW_CONTRAST | flag::CLIPPED | flag::INTERPOLATED | flag::MISFIT;

/// A wrong point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WrongPoint {
    /// Column (row, for a vertical line), pixels.
    pub along_px: u32,
    /// Measured − true position across the line, pixels.
    pub error_px: f64,
    /// Stated standard deviation, pixels.
    pub sigma_px: f64,
    /// Its flags.
    pub flags: u8,
}

/// Points of one method on one or more scenes.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    columns: u64,
    found: u64,
    points: u64,
    right: u64,
    doubted: u64,
    wrong: u64,
    wrong_unsaturated: u64,
    sound: u64,
    sum_squares_px2: f64,
    sum_sound_squares_px2: f64,
    /// |error| over stated standard deviation of the points without a flag of doubt.
    ratios: Vec<f64>,
    worst: Option<WrongPoint>,
}

/// Quality of the points of a method. Shares are 0 … 1, NaN if there was nothing to count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Columns (rows, for a vertical line); all have a true centre.
    pub columns: u64,
    /// Points found.
    pub points: u64,
    /// Share of the columns without a point.
    pub missing: f64,
    /// Share of the points within [`NEAR_PX`] or three standard deviations of the truth.
    pub right: f64,
    /// Share of the points with a flag of [`DOUBT`].
    pub doubted: f64,
    /// Share of the points that are wrong and show nothing of it.
    pub wrong: f64,
    /// The same if SATURATED counts as a flag of doubt, too.
    pub wrong_unsaturated: f64,
    /// Share of the columns with a point within [`NEAR_PX`] and without a flag of doubt: those that are of use.
    pub sound: f64,
    /// Root mean square error of all points, pixels.
    pub rms_px: f64,
    /// The same of the sound points.
    pub sound_rms_px: f64,
    /// Median of |error| ÷ stated standard deviation over that of a normal distribution, of the points without a flag of
    /// doubt; 1 if the stated values are right.
    pub scatter_over_sigma: f64,
}

impl Tally {
    /// Adds the points of a scene.
    pub(super) fn add(&mut self, scene: &HardScene, line: &Centerline, params: &ExtractionParams) {
        let (along, across) = line.along_and_across(scene.direction);
        let mut found = vec![false; LENGTH_PX as usize];
        self.columns += u64::from(LENGTH_PX);
        for (at, (&along, &across)) in along.iter().zip(across).enumerate() {
            let along_px = along as u32;
            if let Some(found) = found.get_mut(along_px as usize) {
                *found = true;
            }
            let accepted = scene.accepted_px(along_px, params);
            let [first, second] = accepted.map(|truth_px| f64::from(across) - truth_px);
            let error_px = if second.abs() < first.abs() { second } else { first };
            let sigma_px = f64::from(line.sigma_px[at]);
            self.add_point(WrongPoint { along_px, error_px, sigma_px, flags: line.flags[at] });
        }
        self.found += found.iter().filter(|&&found| found).count() as u64;
    }

    fn add_point(&mut self, point: WrongPoint) {
        let WrongPoint { error_px, sigma_px, flags, .. } = point;
        let (size_px, is_doubted) = (error_px.abs(), flags & DOUBT != 0);
        let is_near = size_px <= NEAR_PX;
        let is_right = is_near || size_px <= WITHIN_SIGMAS * sigma_px;
        self.points += 1;
        self.sum_squares_px2 += error_px * error_px;
        self.right += u64::from(is_right);
        self.doubted += u64::from(is_doubted);
        if is_doubted {
            return;
        }
        if sigma_px > 0.0 {
            self.ratios.push(size_px / sigma_px);
        }
        if is_near {
            self.sound += 1;
            self.sum_sound_squares_px2 += error_px * error_px;
        }
        if !is_right {
            self.wrong += 1;
            self.wrong_unsaturated += u64::from(flags & flag::SATURATED == 0);
            if self.worst.is_none_or(|worst| worst.error_px.abs() < size_px) {
                self.worst = Some(point);
            }
        }
    }

    /// Adds the points of another tally.
    pub(super) fn merge(&mut self, other: &Self) {
        self.columns += other.columns;
        self.found += other.found;
        self.points += other.points;
        self.right += other.right;
        self.doubted += other.doubted;
        self.wrong += other.wrong;
        self.wrong_unsaturated += other.wrong_unsaturated;
        self.sound += other.sound;
        self.sum_squares_px2 += other.sum_squares_px2;
        self.sum_sound_squares_px2 += other.sum_sound_squares_px2;
        self.ratios.extend_from_slice(&other.ratios);
    }

    /// Returns the wrong point with the largest error.
    pub(super) const fn worst(&self) -> Option<WrongPoint> {
        self.worst
    }

    /// Returns the figures.
    pub(super) fn figures(&self) -> Figures {
        let share = |part: u64, of: u64| part as f64 / of as f64;
        let ratio = statistics::median(&mut self.ratios.clone());
        Figures {
            columns: self.columns,
            points: self.points,
            missing: share(self.columns - self.found, self.columns),
            right: share(self.right, self.points),
            doubted: share(self.doubted, self.points),
            wrong: share(self.wrong, self.points),
            wrong_unsaturated: share(self.wrong_unsaturated, self.points),
            sound: share(self.sound, self.columns),
            rms_px: (self.sum_squares_px2 / self.points as f64).sqrt(),
            sound_rms_px: (self.sum_sound_squares_px2 / self.sound as f64).sqrt(),
            scatter_over_sigma: ratio.unwrap_or(f64::NAN) * statistics::MAD_TO_SIGMA,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        evaluate::hard::{Second, grid},
        scanner::params::{PeakSelection, StripeDirection},
    };

    /// Points at these distances from the line, with standard deviation and flags.
    fn line(scene: &HardScene, points: &[(f64, f32, u8)]) -> Centerline {
        let at = |(along, point): (u32, &(f64, f32, u8))| (scene.center_px(along) + point.0) as f32;
        Centerline {
            u_px: (0..points.len()).map(|along| along as f32).collect(),
            v_px: (0..).zip(points).map(at).collect(),
            stripe_start: vec![0],
            sigma_px: points.iter().map(|point| point.1).collect(),
            flags: points.iter().map(|point| point.2).collect(),
            ..Centerline::default()
        }
    }

    fn scene(second: Option<Second>) -> HardScene {
        let direction = StripeDirection::Horizontal;
        HardScene { direction, saturation: 2.0, second, ..grid(0)[0] }
    }

    #[test]
    fn points_are_right_in_doubt_or_wrong() {
        let scene = scene(None);
        let points = [
            (0.2, 0.1, 0),
            (-0.9, 0.01, flag::SATURATED),
            (5.0, 2.0, 0),
            (5.0, 0.1, flag::MULTIPLE_PEAKS),
            (5.0, 0.1, flag::SATURATED),
            (-7.0, 0.1, 0),
            (-3.0, f32::NAN, 0),
            (3.0, 0.1, flag::MISFIT),
        ];
        let mut tally = Tally::default();
        tally.add(&scene, &line(&scene, &points), &ExtractionParams::default());
        let worst = tally.worst().unwrap();
        assert_eq!((worst.along_px, worst.error_px.round()), (5, -7.0));
        let mut twice = tally.clone();
        twice.merge(&tally);
        for (figures, times) in [(tally.figures(), 1), (twice.figures(), 2)] {
            assert_eq!((figures.columns, figures.points), (640 * times, 8 * times));
            let shares = [figures.right, figures.doubted, figures.wrong, figures.wrong_unsaturated];
            assert_eq!(shares.map(|share| (share * 8.0) as u32), [3, 2, 3, 2]);
            assert!((figures.missing - 632.0 / 640.0).abs() < 1e-12);
            assert!((figures.sound - 2.0 / 640.0).abs() < 1e-12);
            assert!((figures.sound_rms_px - f64::midpoint(0.04, 0.81).sqrt()).abs() < 1e-4);
        }
    }

    /// Which of the lines counts depends on what the selection can mean.
    #[test]
    fn a_second_line_counts_only_if_the_selection_may_mean_it() {
        let beside = |share| scene(Some(Second { share, distance_px: 20.0 }));
        let wrong = |scene: HardScene, selection, max_stripes| {
            let params = ExtractionParams {
                peak_selection: selection,
                max_stripes,
                ..ExtractionParams::default()
            };
            let mut tally = Tally::default();
            tally.add(&scene, &line(&scene, &[(0.1, 0.1, 0), (20.1, 0.1, 0)]), &params);
            tally.wrong
        };
        let [equal, weaker] = [beside(1.0), beside(0.3)];
        assert_eq!(wrong(equal, PeakSelection::Brightest, 1), 0);
        assert_eq!(wrong(weaker, PeakSelection::Brightest, 1), 1);
        assert_eq!(wrong(weaker, PeakSelection::Brightest, 2), 0);
        // Twice full scale and 1.2 times are the same level in the picture.
        assert_eq!(wrong(beside(0.6), PeakSelection::Brightest, 1), 0);
        assert_eq!(wrong(equal, PeakSelection::First, 1), 1);
        assert_eq!(wrong(equal, PeakSelection::Last, 1), 1);
    }
}
