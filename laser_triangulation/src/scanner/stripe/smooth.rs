//! Smoothing along the stripe: trades lateral resolution for less noise and preserves steps.
//!
//! Each point moves to the value, at its own position, of a straight line through its neighbours in the same connected
//! stripe. The fit is least squares weighted by 1/σ², unbiased on any slope. The line through both sides is used if its
//! residuals fit the points' uncertainties (χ² below its 99.9 % quantile). Otherwise the better of the lines through
//! one side is used if it fits, else the point stays as measured. So steps of many σ, and features narrower than one
//! side, such as a groove, are preserved.
//!
//! A line through n points reduces white noise to 1/√n; at the ends of a stripe and beside steps, where only one side
//! is available, to about 2/√((n + 1)/2). On a surface with curvature y'' px⁻¹ the line through both sides has an error
//! of at most y''·h·(h + 1)/6, h = (n − 1)/2. Where that error exceeds the noise, the test fails and the point is not
//! smoothed.

use super::{Centerline, correlation::Correlation};
use crate::scanner::params::{ExtractionParams, StripeDirection};
use crate::statistics::{NORMAL_MEDIAN_MAGNITUDE, median};
use std::ops::Range;

/// Minimum number of differences for an estimate of the scatter.
const MIN_DIFFERENCES: usize = 16;

/// Smooths one centreline after another. Allocates nothing after the longest one.
#[derive(Debug)]
pub(super) struct Smoother {
    direction: StripeDirection,
    /// Points on either side.
    half: i32,
    correlation: Correlation,
    /// Largest χ² of a line, indexed by its number of points.
    limits: Vec<f64>,
    points: Vec<Point>,
    differences: Vec<f64>,
    /// Weight of each point of a window in the value, times that point's σ.
    shares: Vec<f64>,
}

/// A point along (`line`) and across the stripe.
#[derive(Clone, Copy, Debug)]
struct Point {
    line: i32,
    across_px: f64,
    sigma_px: f64,
    /// 1/σ²; 0 for points of unknown uncertainty, which the fit ignores.
    weight: f64,
}

impl Point {
    fn new(line: i32, across_px: f64, sigma_px: f64) -> Self {
        let is_usable = across_px.is_finite() && sigma_px.is_finite() && sigma_px > 0.0;
        if is_usable {
            Self { line, across_px, sigma_px, weight: 1.0 / (sigma_px * sigma_px) }
        } else {
            Self { line, across_px: 0.0, sigma_px: 0.0, weight: 0.0 }
        }
    }

    const fn is_usable(&self) -> bool {
        self.weight > 0.0
    }
}

/// Value of a fitted line at the point being smoothed.
#[derive(Clone, Copy, Debug)]
struct Fit {
    /// Distance from the measured point, pixels.
    offset_px: f64,
    /// χ² of the residuals as a share of its limit.
    misfit: f64,
}

/// Sums of a weighted fit about the point being smoothed.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f64,
    x: f64,
    xx: f64,
    y: f64,
    xy: f64,
    num: usize,
}

impl Sums {
    /// Returns the determinant; 0 if the points do not define a line.
    fn determinant(&self) -> f64 {
        self.weight * self.xx - self.x * self.x
    }
}

impl Smoother {
    /// Creates a smoother over `smoothing_columns` points; 1 changes nothing.
    pub(super) fn new(params: &ExtractionParams, direction: StripeDirection) -> Self {
        let half = params.smoothing_columns.saturating_sub(1) / 2;
        let correlation = Correlation::along_the_stripe(params);
        let limits = (0..=2 * half as usize + 1).map(|num| correlation.chi_square_limit(num));
        Self {
            direction,
            half: half as i32,
            limits: limits.collect(),
            correlation,
            points: Vec::new(),
            differences: Vec::new(),
            shares: vec![0.0; 2 * half as usize + 1],
        }
    }

    /// Smooths positions and reduces their σ accordingly; everything else is unchanged.
    ///
    /// If the points scatter more than their σ (speckle, a rough surface, noise stated too low), all σ are first
    /// increased to match the scatter.
    pub(super) fn smooth(&mut self, centerline: &mut Centerline) {
        if self.half == 0 || centerline.is_empty() {
            return;
        }
        self.load(centerline);
        let scatter = self.scatter(&centerline.stripe_start);
        for point in &mut self.points {
            *point = Point::new(point.line, point.across_px, scatter * point.sigma_px);
        }
        for stripe in 0..centerline.stripe_start.len() {
            self.smooth_stripe(
                range_of(&centerline.stripe_start, stripe, self.points.len()),
                centerline,
            );
        }
    }

    fn load(&mut self, centerline: &Centerline) {
        let (along, across) = centerline.along_and_across(self.direction);
        self.points.clear();
        let places = along.iter().zip(across).zip(&centerline.sigma_px);
        self.points.extend(places.map(|((&along, &across), &sigma)| {
            Point::new(along as i32, f64::from(across), f64::from(sigma))
        }));
    }

    /// Returns the ratio of the scatter of all stripes' points to their σ, at least 1. Uses the median of third
    /// differences, which constant curvature does not affect, over distances at which errors are independent.
    fn scatter(&mut self, stripe_start: &[u32]) -> f64 {
        let Self { points, differences, correlation, .. } = self;
        let apart = correlation.independent_distance();
        differences.clear();
        for stripe in 0..stripe_start.len() {
            let points = &points[range_of(stripe_start, stripe, points.len())];
            for window in points.windows(3 * apart + 1) {
                let four = [0, 1, 2, 3].map(|place| window[place * apart]);
                let is_whole = four[3].line - four[0].line == 3 * apart as i32;
                if is_whole && four.iter().all(Point::is_usable) {
                    let weighted = four.iter().zip([1.0, -3.0, 3.0, -1.0]);
                    let (difference, variance) =
                        weighted.fold((0.0, 0.0), |(difference, variance), (point, weight)| {
                            let sigma_px: f64 = weight * point.sigma_px;
                            (difference + weight * point.across_px, variance + sigma_px * sigma_px)
                        });
                    differences.push(difference.abs() / variance.sqrt());
                }
            }
        }
        let num = differences.len();
        if num < MIN_DIFFERENCES {
            return 1.0;
        }
        let scatter = median(differences).unwrap_or(f64::NAN) / NORMAL_MEDIAN_MAGNITUDE;
        // Ignore an excess that chance alone produces with so few differences.
        if scatter > 1.0 + 4.0 / (num as f64).sqrt() { scatter } else { 1.0 }
    }

    fn smooth_stripe(&mut self, stripe: Range<usize>, centerline: &mut Centerline) {
        let (mut from, mut to) = (stripe.start, stripe.start);
        for at in stripe.clone() {
            let point = self.points[at];
            if !point.is_usable() {
                continue;
            }
            while self.points[from].line < point.line - self.half {
                from += 1;
            }
            while to < stripe.end && self.points[to].line <= point.line + self.half {
                to += 1;
            }
            let (offset_px, sigma_px) = self.smoothed(at, from..to);
            let across = match self.direction {
                StripeDirection::Horizontal => &mut centerline.v_px[at],
                StripeDirection::Vertical => &mut centerline.u_px[at],
            };
            *across = (point.across_px + offset_px) as f32;
            centerline.sigma_px[at] = sigma_px as f32;
        }
    }

    /// Returns the offset of the smoothed point from the measured one, and its σ, pixels; `window` holds the points on
    /// both sides.
    fn smoothed(&mut self, at: usize, window: Range<usize>) -> (f64, f64) {
        let sides = [window.start..at + 1, at..window.end];
        let both = self.fit(at, window.clone()).filter(|fit| fit.misfit <= 1.0);
        let best = both.map(|fit| (fit, window)).or_else(|| {
            let fits = sides.map(|side| Some((self.fit(at, side.clone())?, side)));
            let better = |a: &(Fit, _), b: &(Fit, _)| a.0.misfit.total_cmp(&b.0.misfit);
            fits.into_iter().flatten().min_by(better).filter(|(fit, _)| fit.misfit <= 1.0)
        });
        match best {
            Some((fit, window)) => (fit.offset_px, self.sigma_px(at, window)),
            None => (0.0, self.points[at].sigma_px),
        }
    }

    /// Fits a line through the points of `window`; `None` if there are too few to test the fit.
    fn fit(&self, at: usize, window: Range<usize>) -> Option<Fit> {
        let sums = self.sums(at, window.clone());
        let determinant = sums.determinant();
        if sums.num < 3 || determinant <= 0.0 {
            return None;
        }
        let offset_px = (sums.xx * sums.y - sums.x * sums.xy) / determinant;
        let slope = (sums.weight * sums.xy - sums.x * sums.y) / determinant;
        let centre = self.points[at];
        let residual = |point: &Point| {
            let x = f64::from(point.line - centre.line);
            point.across_px - centre.across_px - offset_px - slope * x
        };
        let points = self.points[window].iter();
        let chi_square: f64 = points.map(|point| point.weight * residual(point).powi(2)).sum();
        Some(Fit { offset_px, misfit: chi_square / self.limits[sums.num] })
    }

    fn sums(&self, at: usize, window: Range<usize>) -> Sums {
        let centre = self.points[at];
        self.points[window].iter().fold(Sums::default(), |sums, point| {
            let weight = point.weight;
            let (x, y) = (f64::from(point.line - centre.line), point.across_px - centre.across_px);
            Sums {
                weight: sums.weight + weight,
                x: sums.x + weight * x,
                xx: sums.xx + weight * x * x,
                y: sums.y + weight * y,
                xy: sums.xy + weight * x * y,
                num: sums.num + usize::from(point.is_usable()),
            }
        })
    }

    /// Returns σ of the fitted value from the weighted errors of all points, which a blur correlates.
    fn sigma_px(&mut self, at: usize, window: Range<usize>) -> f64 {
        let sums = self.sums(at, window.clone());
        let determinant = sums.determinant();
        let first = self.points[at].line - self.half;
        self.shares.fill(0.0);
        for point in &self.points[window] {
            let x = f64::from(point.line - self.points[at].line);
            // Weight times σ.
            let share = (sums.xx - sums.x * x) * point.weight * point.sigma_px / determinant;
            self.shares[(point.line - first) as usize] = share;
        }
        self.correlation.variance(&self.shares).sqrt()
    }
}

/// Returns the range of points of a stripe.
fn range_of(stripe_start: &[u32], stripe: usize, num_points: usize) -> Range<usize> {
    let end = stripe_start.get(stripe + 1).map_or(num_points, |&next| next as usize);
    stripe_start[stripe] as usize..end
}

#[cfg(test)]
mod tests;
