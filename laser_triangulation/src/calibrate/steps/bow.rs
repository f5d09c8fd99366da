//! How the line of a flat is curved.
//!
//! A projective map takes straight lines to straight lines; a lens does not. The residuals along each plateau show it. Radial
//! distortion, and a lens off the axis, bend each line to a parabola whose height is linear in that of the flat. What the fit
//! to the heights absorbs of it is subtracted; the rest is the error of measured heights.

use nalgebra::{DVector, Matrix2, Matrix3, Point2, Vector2, Vector3};

use super::{CHANCE, HeightModel, Plateau, fit};
use crate::scanner::{
    calibration::{Bow, Projective, VerticalIncidence, axes, range},
    params::StripeDirection,
};

/// Smallest noise of a line's curvature, pixels: rounding errors of lines without noise.
const LEAST_PX: f64 = 1e-9;
/// Share of the range of heights from which on a curved line is worth a warning.
const HARMFUL: f64 = 2e-4;

/// How the lines of flats are curved.
#[derive(Clone, Debug)]
pub struct LineBow {
    /// Largest distance of the middle of a flat's line from the straight line through its ends, over the whole used width,
    /// metres of height.
    pub curvature_m: f64,
    /// True if chance alone would curve the lines as much in less than 1 of 100 cases. The curvature then widens all
    /// uncertainties.
    pub is_significant: bool,
    /// True if it is significant and more than 0.02 % of the range of heights: the camera needs a calibration with a board.
    pub is_harmful: bool,
    frame: Frame,
    /// Independent deviations, each one standard deviation.
    parts: Vec<Part>,
    model: HeightModel,
}

/// The places and heights of all plateaus.
#[derive(Clone, Copy, Debug)]
struct Frame {
    along_px: [f64; 2],
    heights_m: [f64; 2],
}

/// One way in which the lines may be curved.
#[derive(Clone, Debug)]
struct Part {
    /// Curvature at the middle height, and its change up to the highest one, metres.
    curvatures_m: Vector2<f64>,
    /// The part that the fit absorbs: the change of the map's values.
    absorbed: DVector<f64>,
}

/// The curvature of all lines.
struct Estimate {
    curvatures_m: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// Returns a value's place in a range: -1 at its start, 1 at its end.
fn within([from, to]: [f64; 2], value: f64) -> f64 {
    (2.0 * value - from - to) / (to - from)
}

impl Frame {
    /// Returns the factors of the curvatures at a height.
    fn row(&self, height_m: f64) -> Vector2<f64> {
        Vector2::new(1.0, within(self.heights_m, height_m))
    }

    /// Returns the factors of the curvatures in the height that is seen at a place along the stripe.
    fn parabola(&self, along_px: f64, height_m: f64) -> Vector2<f64> {
        self.row(height_m) * within(self.along_px, along_px).powi(2)
    }

    /// Fits to the curvature of all plateaus. Where these scatter beyond their noise, as flats that are not flat do, the
    /// covariance is enlarged. `None` if they do not determine it.
    fn estimate(&self, fit: &fit::Fit, plateaus: &[Plateau]) -> Option<Estimate> {
        let mut normal = Matrix2::zeros();
        let mut right = Vector2::zeros();
        let mut equations = Vec::with_capacity(plateaus.len());
        for plateau in plateaus {
            let slope = fit.model.slope_m_per_px([plateau.middle_px(), plateau.across_px])?;
            let [bow_px, sigma_px] = plateau.bow_px;
            let [from, to] = plateau.along_px.map(|px| within(self.along_px, px));
            // A parabola over the whole width has this share in the second Legendre polynomial of the plateau.
            let share = (to - from).powi(2) / 6.0;
            let row = share * self.row(plateau.height.height_m + fit.offset_m(plateau.picture));
            let weight = (slope * sigma_px.hypot(LEAST_PX)).powi(-2);
            normal += weight * row * row.transpose();
            right += weight * slope * bow_px * row;
            equations.push((row, slope * bow_px, weight));
        }
        let inverse = normal.try_inverse()?;
        let curvatures_m = inverse * right;
        let rest = equations
            .iter()
            .map(|(row, bow_m, weight)| weight * (bow_m - row.dot(&curvatures_m)).powi(2));
        let freedom = plateaus.len().saturating_sub(2).max(1) as f64;
        let scatter = (rest.sum::<f64>() / freedom).max(1.0);
        Some(Estimate { curvatures_m, covariance: inverse * scatter })
    }

    /// Returns what the fit absorbs of lines that are curved.
    fn absorbed(
        &self,
        fit: &fit::Fit,
        plateaus: &[Plateau],
        curvatures_m: &Vector2<f64>,
    ) -> Option<DVector<f64>> {
        let places = fit::places(plateaus, fit.model.term);
        let (jacobian, _) = fit.linearised(&places)?;
        let each = places.len() / plateaus.len();
        let seen = plateaus.iter().flat_map(|plateau| {
            let height_m = plateau.height.height_m + fit.offset_m(plateau.picture);
            let of_place =
                |[along_px, _]: [f64; 2]| self.parabola(along_px, height_m).dot(curvatures_m);
            let both = plateau.places().map(of_place);
            let mean = 0.5 * (both[0] + both[1]);
            if each == 1 { vec![mean] } else { both.to_vec() }
        });
        let seen_m = DVector::from_iterator(places.len(), seen);
        let num = fit.model.values().len();
        Some((fit::solver(&jacobian)? * seen_m).rows(0, num).into_owned())
    }
}

impl LineBow {
    /// Judges the lines of all plateaus; `None` if they do not determine the curvature.
    pub(super) fn new(fit: &fit::Fit, plateaus: &[Plateau]) -> Option<Self> {
        let height_m = |plateau: &Plateau| plateau.height.height_m + fit.offset_m(plateau.picture);
        let frame = Frame {
            along_px: range(plateaus.iter().flat_map(|plateau| plateau.along_px))?,
            heights_m: range(plateaus.iter().map(height_m))?,
        };
        let Estimate { curvatures_m, covariance } = frame.estimate(fit, plateaus)?;
        let of_height = frame.heights_m.map(|z| frame.row(z).dot(&curvatures_m).abs());
        let curvature_m = of_height[0].max(of_height[1]);
        let chi_square = curvatures_m.dot(&(covariance.try_inverse()? * curvatures_m));
        // The quantile of chi square has a closed form for two parameters.
        let is_significant = chi_square > -2.0 * CHANCE.ln();
        let [lowest_m, highest_m] = frame.heights_m;
        let mut bow = Self {
            curvature_m,
            is_significant,
            is_harmful: is_significant && curvature_m > HARMFUL * (highest_m - lowest_m),
            frame,
            parts: Vec::new(),
            model: fit.model.clone(),
        };
        if is_significant {
            // The curvature counts as one standard deviation, with its noise.
            let both = curvatures_m * curvatures_m.transpose() + covariance;
            for axis in axes(2, both.as_slice()) {
                let curvatures_m = Vector2::new(axis[0], axis[1]);
                let absorbed = frame.absorbed(fit, plateaus, &curvatures_m)?;
                bow.parts.push(Part { curvatures_m, absorbed });
            }
        }
        Some(bow)
    }

    /// Leaves the curvature out.
    #[cfg(test)]
    pub(super) fn straighten(&mut self) {
        self.parts.clear();
    }

    /// Returns the error of the height measured at a place along the stripe, on a flat of that height, metres.
    fn error_m(&self, part: &Part, along_px: f64, height_m: f64) -> Option<f64> {
        let across_px = self.model.across_px(along_px, height_m)?;
        let gradient = self.model.gradient([along_px, across_px])?;
        let seen_m = self.frame.parabola(along_px, height_m).dot(&part.curvatures_m);
        Some(seen_m - gradient.dot(&part.absorbed))
    }

    /// Returns the root mean square of the errors of heights between the ends of the lines, metres; 0 if the curvature is
    /// not significant.
    pub(super) fn rms_m(&self) -> f64 {
        let [along_px, heights_m] = [self.frame.along_px, self.frame.heights_m].map(nodes);
        let places = heights_m.iter().flat_map(|z| along_px.map(|along| (along, *z)));
        let squares = self.parts.iter().flat_map(|part| {
            let errors = places.clone().filter_map(|(along, z)| self.error_m(part, along, z));
            errors.map(|error_m| error_m.powi(2) / 9.0)
        });
        squares.sum::<f64>().sqrt()
    }

    /// Returns the errors over x and z of the profiles of a homography.
    pub(super) fn of_projective(
        &self,
        map: &Projective,
        direction: StripeDirection,
    ) -> Option<Bow> {
        let to_metres = Matrix3::from_row_slice(&map.homography);
        let to_pixels = to_metres.try_inverse()?;
        let swapped = |pixel: Point2<f64>| match direction {
            StripeDirection::Horizontal => pixel,
            StripeDirection::Vertical => Point2::new(pixel.y, pixel.x),
        };
        let through = |map: &Matrix3<f64>, at: Point2<f64>| {
            Point2::from_homogeneous(map * Vector3::new(at.x, at.y, 1.0))
        };
        let x_m = |along_px, height_m| {
            let across_px = self.model.across_px(along_px, height_m)?;
            Some(through(&to_metres, swapped(Point2::new(along_px, across_px)))?.x)
        };
        self.over_x(x_m, |x_m, z_m| Some(swapped(through(&to_pixels, Point2::new(x_m, z_m))?).x))
    }

    /// Returns the errors over x and z of the profiles of formula 6.
    pub(super) fn of_vertical_incidence(&self, geometry: &VerticalIncidence) -> Option<Bow> {
        let x_m = |along_px, height_m| Some(geometry.lateral(along_px, height_m));
        self.over_x(x_m, |x_m, z_m| Some(geometry.project(x_m, z_m)?.0))
    }

    /// Returns the errors over x and z of the profiles; `None` if they are not curved, or at the horizon. `x_m` and
    /// `along_px` convert (along in pixels, z) to x and (x, z) to the place along the stripe.
    fn over_x(
        &self,
        x_m: impl Fn(f64, f64) -> Option<f64>,
        along_px: impl Fn(f64, f64) -> Option<f64>,
    ) -> Option<Bow> {
        if self.parts.is_empty() {
            return None;
        }
        let Frame { along_px: ends_px, heights_m: z_m } = self.frame;
        let corners = z_m.iter().flat_map(|z| ends_px.map(|along| x_m(along, *z)));
        let x_m = range(corners.collect::<Option<Vec<f64>>>()?)?;
        let [xs, zs] = [x_m, z_m].map(nodes);
        let of_part = |part: &Part| {
            let mut nodes_m = [0.0; 9];
            for (at, deviation) in nodes_m.iter_mut().enumerate() {
                let (x, z) = (xs[at % 3], zs[at / 3]);
                *deviation = self.error_m(part, along_px(x, z)?, z)?;
            }
            Some(nodes_m)
        };
        let deviations_m = self.parts.iter().map(of_part).collect::<Option<_>>()?;
        Some(Bow { x_m, z_m, deviations_m })
    }
}

/// Returns start, middle and end of a range.
fn nodes([from, to]: [f64; 2]) -> [f64; 3] {
    [from, 0.5 * (from + to), to]
}
