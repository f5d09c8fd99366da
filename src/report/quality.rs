//! Quality of the centrelines, per frame and in total.

use super::{
    chart::{Chart, Curve},
    series::{Merge, Series},
};
use crate::{
    msg::{
        convert::results::{UnknownDirection, stripe_direction},
        laser_profiler_msgs::Centerline,
    },
    scanner::{params::StripeDirection, stripe::flag},
};

/// Bits of a point's flags and their names.
pub(crate) const FLAGS: [(u8, &str); 6] = [
    (flag::SATURATED, "saturated"),
    (flag::MULTIPLE_PEAKS, "several candidates"),
    (flag::CLIPPED, "cut by the border"),
    (flag::LOW_CONTRAST, "low contrast"),
    (flag::INTERPOLATED, "filled in"),
    (flag::MISFIT, "not the shape of a stripe"),
];

// Places in a frame's figures.
const SIGMA: usize = 0;
const SIGMA_95: usize = 1;
const WIDTH: usize = 2;
const MISSING: usize = 3;
const FLAGGED: usize = 4;
const LOST: usize = FLAGGED + FLAGS.len();
const GAPS: usize = LOST + 1;
const NUM: usize = GAPS + 1;

/// Quality of the centrelines over a recording.
#[derive(Clone, Debug)]
pub(crate) struct Quality {
    series: Series<NUM>,
    found: Vec<u32>,
    numbers: Vec<f32>,
    /// Frames.
    pub(crate) num_frames: u64,
    /// Points of all frames.
    pub(crate) num_points: u64,
    /// Cross-sections searched in all frames.
    pub(crate) num_sections: u64,
    /// Cross-sections in which a stripe was found.
    pub(crate) num_found: u64,
    /// Points with each of [`FLAGS`].
    pub(crate) num_flagged: [u64; FLAGS.len()],
    /// Frames known to be missing between them.
    pub(crate) num_lost: u64,
}

impl Default for Quality {
    fn default() -> Self {
        let mut merges = [Merge::Mean; NUM];
        (merges[SIGMA_95], merges[LOST]) = (Merge::Max, Merge::Sum);
        Self {
            series: Series::new(merges),
            found: Vec::new(),
            numbers: Vec::new(),
            num_frames: 0,
            num_points: 0,
            num_sections: 0,
            num_found: 0,
            num_flagged: [0; FLAGS.len()],
            num_lost: 0,
        }
    }
}

impl Quality {
    /// Adds the next frame.
    ///
    /// # Errors
    /// A centreline that does not state the direction of the stripe; it is not added.
    pub(crate) fn add(&mut self, line: &Centerline<'_>) -> Result<(), UnknownDirection> {
        let [sections, found] = self.sections(line, stripe_direction(line)?);
        let num_points = line.u.len() as u64;
        let mut figures = [f64::NAN; NUM];
        [figures[SIGMA], figures[SIGMA_95]] = self.quantiles(&line.sigma, [0.5, 0.95]);
        [figures[WIDTH]] = self.quantiles(&line.width, [0.5]);
        figures[MISSING] = share(sections - found, sections);
        for (at, (bit, _)) in FLAGS.iter().enumerate() {
            let num = line.flags.iter().filter(|flags| **flags & bit != 0).count() as u64;
            self.num_flagged[at] += num;
            figures[FLAGGED + at] = share(num, num_points);
        }
        figures[LOST] = f64::from(line.trace.frames_missing);
        figures[GAPS] = line.stripe_start.len().saturating_sub(1) as f64;
        self.series.push(figures);
        self.num_frames += 1;
        self.num_points += num_points;
        self.num_sections += sections;
        self.num_found += found;
        self.num_lost += u64::from(line.trace.frames_missing);
        Ok(())
    }

    /// Returns the number of searched cross-sections, and of those with a point.
    fn sections(&mut self, line: &Centerline<'_>, direction: StripeDirection) -> [u64; 2] {
        let roi = &line.roi;
        let (along, offset, length) = match direction {
            StripeDirection::Horizontal => (&line.u, roi.x_offset, roi.width.min(line.image_width)),
            StripeDirection::Vertical => (&line.v, roi.y_offset, roi.height.min(line.image_height)),
        };
        // No more memory than the points take, whatever size the message states.
        self.found.clear();
        let inside = along.iter().map(|at| at.round() - offset as f32);
        self.found
            .extend(inside.filter(|at| (0.0..length as f32).contains(at)).map(|at| at as u32));
        self.found.sort_unstable();
        self.found.dedup();
        let found = self.found.len() as u64;
        [u64::from(length), found]
    }

    fn quantiles<const N: usize>(&mut self, numbers: &[f32], shares: [f64; N]) -> [f64; N] {
        self.numbers.clear();
        self.numbers.extend(numbers.iter().filter(|number| number.is_finite()));
        self.numbers.sort_unstable_by(f32::total_cmp);
        let last = self.numbers.len().saturating_sub(1) as f64;
        shares.map(|share| {
            let at = (share * last).round() as usize;
            self.numbers.get(at).map_or(f64::NAN, |number| f64::from(*number))
        })
    }

    /// Median over all frames of their median uncertainty, pixels; NaN if none is stated.
    #[must_use]
    pub(crate) fn sigma_px(&self) -> f64 {
        median(self.series.figure(SIGMA))
    }

    /// Median over all frames of the median stripe width, pixels; NaN if none is stated.
    #[must_use]
    pub(crate) fn width_px(&self) -> f64 {
        median(self.series.figure(WIDTH))
    }

    /// Fraction of searched cross-sections without a point; NaN without cross-sections.
    #[must_use]
    pub(crate) fn missing(&self) -> f64 {
        share(self.num_sections - self.num_found, self.num_sections)
    }

    /// Returns the charts over the frames.
    #[must_use]
    pub(crate) fn charts(&self) -> Vec<Chart> {
        if self.num_frames == 0 {
            return Vec::new();
        }
        let curve = |name: &str, at: usize| Curve::new(name, self.series.figure(at));
        let percent = |name: &str, at: usize| {
            let shares = self.series.figure(at);
            Curve::new(name, shares.into_iter().map(|share| 100.0 * share).collect())
        };
        let flagged = FLAGS.iter().enumerate();
        let flagged = flagged.filter(|(at, _)| self.num_flagged[*at] > 0);
        let shares = std::iter::once(percent("no stripe found", MISSING))
            .chain(flagged.map(|(at, (_, name))| percent(name, FLAGGED + at)));
        let chart = |id, title, y_label, curves| Chart {
            id,
            title,
            x_label: "frame",
            y_label,
            x: self.series.frames(),
            curves,
        };
        vec![
            chart(
                "sigma",
                "Uncertainty of the centre, one standard deviation",
                "σ [px]",
                vec![curve("median", SIGMA), curve("95 % of the points below", SIGMA_95)],
            ),
            chart(
                "width",
                "Width of the stripe, full width at half maximum",
                "width [px]",
                vec![curve("median", WIDTH)],
            ),
            chart(
                "shares",
                "Cross-sections without a stripe, and points with flags",
                "share [%]",
                shares.collect(),
            ),
            chart("gaps", "Gaps in the stripe", "gaps a frame", vec![curve("gaps", GAPS)]),
            chart(
                "lost",
                "Frames missing before a frame",
                "frames",
                vec![curve("missing frames", LOST)],
            ),
        ]
    }
}

fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { f64::NAN } else { part as f64 / whole as f64 }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|value| value.is_finite());
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "small integers and their halves")]
mod tests {
    use super::*;
    use crate::msg::sensor_msgs::RegionOfInterest;

    fn line() -> Centerline<'static> {
        Centerline {
            image_width: 20,
            image_height: 10,
            stripe_direction: Centerline::STRIPE_HORIZONTAL,
            roi: RegionOfInterest { x_offset: 10, width: 8, height: 10, ..Default::default() },
            // Two points in column 11, none in 10, 13, 15, 16 and 17.
            u: vec![11.0, 12.0, 14.0, 11.0].into(),
            v: vec![3.5, 3.25, 4.5, 8.5].into(),
            stripe_start: vec![0, 2, 3].into(),
            sigma: vec![0.5, 0.25, 1.0, f32::NAN].into(),
            width: vec![3.0, f32::NAN, 4.0, 5.0].into(),
            flags: vec![flag::SATURATED, 0, flag::SATURATED | flag::CLIPPED, 0].into(),
            ..Centerline::default()
        }
    }

    #[test]
    fn a_frame_is_counted_by_its_cross_sections() {
        let mut quality = Quality::default();
        quality.add(&line()).unwrap();
        assert_eq!((quality.num_sections, quality.num_found, quality.num_points), (8, 3, 4));
        assert_eq!(quality.num_flagged, [2, 0, 1, 0, 0, 0]);
        assert_eq!((quality.sigma_px(), quality.width_px()), (0.5, 4.0));
        assert_eq!(quality.missing(), 5.0 / 8.0);
        let charts = quality.charts();
        let shares = charts.iter().find(|chart| chart.id == "shares").unwrap();
        let names: Vec<_> = shares.curves.iter().map(|curve| curve.name.as_str()).collect();
        assert_eq!(names, ["no stripe found", "saturated", "cut by the border"]);
        assert_eq!(shares.curves[1].values, [50.0]);
    }

    #[test]
    fn a_vertical_stripe_is_counted_by_rows() {
        let line = line();
        let vertical = Centerline {
            stripe_direction: Centerline::STRIPE_VERTICAL,
            u: line.v.clone(),
            v: line.u.clone(),
            ..line
        };
        let mut quality = Quality::default();
        quality.add(&vertical).unwrap();
        // Rows 0 to 9 are searched; those of the points lie beyond.
        assert_eq!((quality.num_sections, quality.num_found), (10, 0));
    }

    #[test]
    fn a_frame_of_an_older_version_is_rejected() {
        let old = Centerline { stripe_direction: Centerline::STRIPE_UNKNOWN, ..line() };
        let mut quality = Quality::default();
        let error = quality.add(&old).unwrap_err();
        assert!(error.to_string().contains("older version") && quality.num_frames == 0, "{error}");
    }

    #[test]
    fn without_points_there_are_no_charts_and_no_figures() {
        let quality = Quality::default();
        assert!(quality.charts().is_empty() && quality.sigma_px().is_nan());
        assert!(quality.missing().is_nan());
    }
}
