//! Differences between two centrelines or profiles of one image: B minus A, for points in both.

use super::{
    quality::FLAGS,
    series::{Merge, Series},
    spread::Spread,
};
use crate::{
    msg::laser_profiler_msgs::Centerline, results::FramePair, scanner::params::StripeDirection,
};

/// Width of a bin of differences in the image, pixels: 1/4096.
const BIN_PX: f64 = 1.0 / 4096.0;
/// Width of a bin of differences of heights, micrometres.
const BIN_UM: f64 = 1.0 / 16.0;
/// Maximum number of cross-sections with figures of their own.
const MAX_SECTIONS: usize = 1 << 16;
/// Number of listed worst frames and cross-sections.
const WORST: usize = 10;

/// Two points of one cross-section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Matched {
    /// Column, or row of a vertical stripe.
    pub(crate) section: usize,
    /// B minus A across the stripe, pixels.
    pub(crate) difference_px: f64,
    flags: [u8; 2],
}

/// One frame's differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameDifference {
    /// Number among the frames of A, from 0.
    pub(crate) frame: u64,
    /// Its stamp, nanoseconds.
    pub(crate) stamp_ns: i64,
    /// Points in both.
    pub(crate) num: u64,
    /// Points only in A, and only in B.
    pub(crate) only: [u64; 2],
    /// Mean difference, pixels.
    pub(crate) bias_px: f64,
    /// Root mean square, pixels.
    pub(crate) rms_px: f64,
    /// Largest magnitude, pixels.
    pub(crate) largest_px: f64,
    /// Cross-section of the largest difference.
    pub(crate) worst_section: usize,
}

/// One cross-section's differences over all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SectionDifference {
    num: u64,
    sum: f64,
    squares: f64,
    /// Points only in A, and only in B.
    pub(crate) only: [u64; 2],
}

impl SectionDifference {
    /// Number of points in both, mean and root mean square of their differences.
    #[must_use]
    pub(crate) fn figures(&self) -> SectionFigures {
        let num = self.num as f64;
        SectionFigures {
            num: self.num,
            bias_px: self.sum / num,
            rms_px: (self.squares / num).sqrt(),
        }
    }
}

/// Figures of one cross-section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SectionFigures {
    /// Points in both.
    pub(crate) num: u64,
    /// Mean difference, pixels; NaN without points.
    pub(crate) bias_px: f64,
    /// Root mean square difference, pixels; NaN without points.
    pub(crate) rms_px: f64,
}

/// Figures over the frames, possibly several frames an entry.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FrameSeries {
    /// First frame of every entry.
    pub(crate) frames: Vec<f64>,
    /// Mean difference, pixels.
    pub(crate) bias_px: Vec<f64>,
    /// Root mean square difference, pixels.
    pub(crate) rms_px: Vec<f64>,
    /// Points only in A, and only in B.
    pub(crate) only: [Vec<f64>; 2],
}

/// Accumulated differences of two results.
#[derive(Clone, Debug)]
pub(crate) struct Differences {
    /// Across the stripe, pixels.
    pub(crate) pixels: Spread,
    /// Heights, micrometres.
    pub(crate) heights: Spread,
    /// Frames in both; only in A; only in B.
    pub(crate) num_frames: [u64; 3],
    /// Points in both; only in A; only in B.
    pub(crate) num_points: [u64; 3],
    /// For points in both: numbers with a flag only in A, and only in B.
    pub(crate) num_flagged: [[u64; 2]; FLAGS.len()],
    /// By cross-section.
    pub(crate) sections: Vec<SectionDifference>,
    /// The frames that differ most, the worst first.
    pub(crate) worst: Vec<FrameDifference>,
    series: Series<4>,
    matched: Vec<Matched>,
}

impl Default for Differences {
    fn default() -> Self {
        Self {
            pixels: Spread::new(BIN_PX),
            heights: Spread::new(BIN_UM),
            num_frames: [0; 3],
            num_points: [0; 3],
            num_flagged: [[0; 2]; FLAGS.len()],
            sections: Vec::new(),
            worst: Vec::new(),
            series: Series::new([Merge::Mean, Merge::Max, Merge::Sum, Merge::Sum]),
            matched: Vec::new(),
        }
    }
}

impl Differences {
    /// Adds a frame that both have and returns its matched points.
    pub(crate) fn add(&mut self, pair: &FramePair<'_>) -> &[Matched] {
        let mut only = [0; 2];
        let mut matched = std::mem::take(&mut self.matched);
        matched.clear();
        let sections = [0, 1].map(|which| sorted(pair.lines[which], pair.directions[which]));
        for_each_section(&sections, |section, points| {
            let before = matched.len();
            match_points(section, points, &mut matched);
            let num = matched.len() - before;
            let alone = points.map(|points| (points.len() - num) as u64);
            if section < MAX_SECTIONS {
                self.sections
                    .resize(self.sections.len().max(section + 1), SectionDifference::default());
                let found = &mut self.sections[section];
                (found.only[0], found.only[1]) =
                    (found.only[0] + alone[0], found.only[1] + alone[1]);
            }
            (only[0], only[1]) = (only[0] + alone[0], only[1] + alone[1]);
        });
        self.take_points(&matched);
        self.take_frame(pair, &matched, only);
        self.take_heights(pair);
        self.matched = matched;
        &self.matched
    }

    fn take_points(&mut self, matched: &[Matched]) {
        for point in matched {
            self.pixels.add(point.difference_px);
            if let Some(section) = self.sections.get_mut(point.section) {
                section.num += 1;
                section.sum += point.difference_px;
                section.squares += point.difference_px * point.difference_px;
            }
            let [a, b] = point.flags;
            for ((bit, _), num) in FLAGS.iter().zip(&mut self.num_flagged) {
                num[0] += u64::from(a & !b & bit != 0);
                num[1] += u64::from(b & !a & bit != 0);
            }
        }
    }

    fn take_frame(&mut self, pair: &FramePair<'_>, matched: &[Matched], only: [u64; 2]) {
        let num = matched.len() as f64;
        let all = || matched.iter().map(|point| point.difference_px);
        let worst =
            matched.iter().max_by(|a, b| a.difference_px.abs().total_cmp(&b.difference_px.abs()));
        let found = FrameDifference {
            frame: pair.frame,
            stamp_ns: pair.lines[0].header.stamp.to_ns(),
            num: matched.len() as u64,
            only,
            bias_px: all().sum::<f64>() / num,
            rms_px: (all().map(|d| d * d).sum::<f64>() / num).sqrt(),
            largest_px: worst.map_or(f64::NAN, |point| point.difference_px.abs()),
            worst_section: worst.map_or(0, |point| point.section),
        };
        self.num_frames[0] += 1;
        self.num_points[0] += found.num;
        (self.num_points[1], self.num_points[2]) =
            (self.num_points[1] + only[0], self.num_points[2] + only[1]);
        self.series.push([found.bias_px, found.rms_px, only[0] as f64, only[1] as f64]);
        // A frame without common points has no figures.
        if found.rms_px > 0.0 {
            let at = self.worst.partition_point(|other| other.rms_px >= found.rms_px);
            self.worst.insert(at, found);
            self.worst.truncate(WORST);
        }
    }

    fn take_heights(&mut self, pair: &FramePair<'_>) {
        let Some(profiles) = pair.profiles else { return };
        let offsets = [0, 1].map(|which| {
            let roi = &pair.lines[which].roi;
            match pair.directions[which] {
                StripeDirection::Horizontal => roi.x_offset,
                StripeDirection::Vertical => roi.y_offset,
            }
        });
        let first = offsets[0].max(offsets[1]);
        let from = offsets.map(|offset| (first - offset) as usize);
        let [a, b] = [0, 1].map(|which| profiles[which].z.get(from[which]..).unwrap_or(&[]));
        for (a, b) in a.iter().zip(b) {
            self.heights.add(1e6 * (f64::from(*b) - f64::from(*a)));
        }
    }

    /// Returns the cross-sections that differ most, the worst first.
    #[must_use]
    pub(crate) fn worst_sections(&self) -> Vec<usize> {
        let rms = |at: usize| self.sections[at].figures().rms_px;
        let mut differing: Vec<usize> =
            (0..self.sections.len()).filter(|at| rms(*at) > 0.0).collect();
        differing.sort_by(|a, b| rms(*b).total_cmp(&rms(*a)));
        differing.truncate(WORST);
        differing
    }

    /// Figures over the frames.
    #[must_use]
    pub(crate) fn series(&self) -> FrameSeries {
        let figure = |at| self.series.figure(at);
        FrameSeries {
            frames: self.series.frames(),
            bias_px: figure(0),
            rms_px: figure(1),
            only: [figure(2), figure(3)],
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Point {
    section: i64,
    across_px: f32,
    flags: u8,
}

fn sorted(line: &Centerline<'_>, direction: StripeDirection) -> Vec<Point> {
    let (along, across) = match direction {
        StripeDirection::Horizontal => (&line.u, &line.v),
        StripeDirection::Vertical => (&line.v, &line.u),
    };
    let points = along.iter().zip(across.iter()).enumerate();
    let mut points: Vec<Point> = points
        .filter(|(_, (along, across))| **along >= 0.0 && across.is_finite())
        .map(|(at, (along, across))| Point {
            section: along.round() as i64,
            across_px: *across,
            flags: line.flags.get(at).copied().unwrap_or(0),
        })
        .collect();
    points.sort_by(|a, b| a.section.cmp(&b.section).then(a.across_px.total_cmp(&b.across_px)));
    points
}

/// Calls `take` with the points of every cross-section.
fn for_each_section(lines: &[Vec<Point>; 2], mut take: impl FnMut(usize, [&[Point]; 2])) {
    let [mut a, mut b] = [0, 1].map(|which| lines[which].as_slice());
    while let Some(section) =
        a.first().into_iter().chain(b.first()).map(|point| point.section).min()
    {
        let split =
            |points: &[Point]| points.iter().take_while(|point| point.section == section).count();
        let (now_a, rest_a) = a.split_at(split(a));
        let (now_b, rest_b) = b.split_at(split(b));
        take(section as usize, [now_a, now_b]);
        (a, b) = (rest_a, rest_b);
    }
}

/// Matches the points of a cross-section: each point of the shorter list with the nearest free point of the longer list.
fn match_points(section: usize, [a, b]: [&[Point]; 2], matched: &mut Vec<Matched>) {
    let sign = if a.len() <= b.len() { 1.0 } else { -1.0 };
    let (few, many) = if a.len() <= b.len() { (a, b) } else { (b, a) };
    let mut from = 0;
    for (at, point) in few.iter().enumerate() {
        // Keeps the order across the stripe, and leaves a partner for every following point.
        let last = many.len() - (few.len() - at);
        let distance = |other: usize| (many[other].across_px - point.across_px).abs();
        let Some(best) = (from..=last).min_by(|p, q| distance(*p).total_cmp(&distance(*q))) else {
            return;
        };
        from = best + 1;
        let difference = f64::from(many[best].across_px) - f64::from(point.across_px);
        let flags = if sign > 0.0 {
            [point.flags, many[best].flags]
        } else {
            [many[best].flags, point.flags]
        };
        matched.push(Matched { section, difference_px: sign * difference, flags });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{msg::laser_profiler_msgs::Profile, scanner::stripe::flag};

    fn line(points: &[(f32, f32)]) -> Centerline<'static> {
        Centerline {
            u: points.iter().map(|point| point.0).collect::<Vec<_>>().into(),
            v: points.iter().map(|point| point.1).collect::<Vec<_>>().into(),
            flags: vec![0; points.len()].into(),
            ..Centerline::default()
        }
    }

    fn pair<'a>(a: &'a Centerline<'a>, b: &'a Centerline<'a>) -> FramePair<'a> {
        let directions = [StripeDirection::Horizontal; 2];
        FramePair { frame: 0, lines: [a, b], directions, profiles: None }
    }

    #[test]
    fn points_are_joined_by_cross_section_and_the_rest_is_counted() {
        let a = line(&[(1.0, 10.0), (2.0, 10.0), (4.0, 10.5)]);
        let b = line(&[(2.0, 10.25), (1.0, 9.5), (3.0, 10.0), (5.0, 1.5)]);
        let mut differences = Differences::default();
        let matched = differences.add(&pair(&a, &b)).to_vec();
        let all: Vec<_> = matched.iter().map(|m| (m.section, m.difference_px)).collect();
        assert_eq!(all, [(1, -0.5), (2, 0.25)]);
        assert_eq!(differences.num_points, [2, 1, 2]);
        assert_eq!(differences.sections[4].only, [1, 0]);
        assert_eq!(differences.worst_sections(), [1, 2]);
        let worst = differences.worst[0];
        assert_eq!((worst.bias_px, worst.largest_px, worst.worst_section), (-0.125, 0.5, 1));
    }

    #[test]
    fn several_points_of_a_cross_section_find_the_nearest() {
        let a = line(&[(7.0, 10.0), (7.0, 50.0)]);
        let b = line(&[(7.0, 49.5), (7.0, 30.0), (7.0, 10.25)]);
        for (first, second, expected) in [(&a, &b, [0.25, -0.5]), (&b, &a, [-0.25, 0.5])] {
            let mut differences = Differences::default();
            let matched = differences.add(&pair(first, second));
            let found: Vec<_> = matched.iter().map(|point| point.difference_px).collect();
            assert_eq!(found, expected);
            assert_eq!(differences.num_points[1] + differences.num_points[2], 1);
        }
    }

    #[test]
    fn flags_and_heights_are_compared_where_both_have_them() {
        let mut a = line(&[(3.0, 1.5), (4.0, 1.5)]);
        let b = line(&[(3.0, 1.5), (4.0, 1.5)]);
        a.flags = vec![flag::SATURATED, flag::CLIPPED].into();
        a.roi.x_offset = 3;
        let heights = |z: &[f32]| Profile { z: z.to_vec().into(), ..Profile::default() };
        // A begins with column 3, B with column 0.
        let [first, second] =
            [heights(&[1.0, f32::NAN]), heights(&[9.0, 9.0, 9.0, 1.0 + 0.000_25, 2.0])];
        let mut differences = Differences::default();
        let profiles = Some([&first, &second]);
        differences.add(&FramePair { profiles, ..pair(&a, &b) });
        assert_eq!(differences.num_flagged[0], [1, 0]);
        assert_eq!(differences.num_flagged[2], [1, 0]);
        let figures = differences.heights.figures();
        assert_eq!(figures.num, 1);
        assert!((figures.bias - 250.0).abs() < 0.1, "{figures:?}");
        assert!(differences.worst.is_empty(), "no difference across the stripe");
    }
}
