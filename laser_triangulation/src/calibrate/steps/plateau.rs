//! Flat pieces of a gauge in the image.

use std::ops::Range;

use crate::metrology::{
    PlateauError,
    correlation::inflation,
    plateaus,
    robust::{self, Equation},
};

/// The height of a flat piece of a gauge, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaugeHeight {
    /// Height, metres.
    pub height_m: f64,
    /// One standard deviation of it, metres: half of the expanded uncertainty (k = 2) of a certificate. `None`: unknown.
    pub sigma_m: Option<f64>,
}

impl GaugeHeight {
    /// A height of unknown uncertainty, metres.
    #[must_use]
    pub const fn of(height_m: f64) -> Self {
        Self { height_m, sigma_m: None }
    }
}

/// A flat piece of a gauge in the image: a straight line.
#[derive(Clone, Debug, PartialEq)]
pub struct Plateau {
    /// Known height.
    pub height: GaugeHeight,
    /// Index of its picture, from 0.
    pub picture: usize,
    /// Ends of the piece along the stripe, pixels.
    pub along_px: [f64; 2],
    /// Position across the stripe at its middle, pixels.
    pub across_px: f64,
    /// Slope of the position across over the position along the stripe, pixels per pixel.
    pub slope: f64,
    /// One standard deviation of `across_px` from the scatter along the line, pixels.
    pub sigma_px: f64,
    /// Curvature of the line, and one standard deviation of it: the coefficient of the second Legendre polynomial, 1 at both
    /// ends and -1/2 in the middle, pixels.
    pub bow_px: [f64; 2],
    /// Points that lie on the line.
    pub num_points: usize,
}

impl Plateau {
    /// Fits a line to a piece of a stripe, `points` being (along, across) in pixels: a straight one, and how a lens curves it.
    /// Outliers do not bend it; the uncertainty accounts for correlated neighbours. `None` if the piece has too few points.
    #[must_use]
    pub(crate) fn fit(
        points: &[[f64; 2]],
        piece: &Range<usize>,
        height: GaugeHeight,
    ) -> Option<Self> {
        let points = points.get(piece.clone())?;
        let along_px = [points.first()?[0], points.last()?[0]];
        let middle = 0.5 * (along_px[0] + along_px[1]);
        let half = 0.5 * (along_px[1] - along_px[0]);
        let row = |from: f64| [1.0, from, 1.5 * (from / half).powi(2) - 0.5].into();
        let equations: Vec<Equation<3>> = points
            .iter()
            .map(|[along, across]| Equation { row: row(along - middle), value: *across })
            .collect();
        let fit = robust::solve(&equations)?;
        let kept: Vec<f64> = fit
            .residuals
            .iter()
            .zip(&fit.weights)
            .map(|(residual, weight)| if *weight > 0.0 { *residual } else { f64::NAN })
            .collect();
        let correlated = inflation(&kept, kept.len())[0];
        Some(Self {
            height,
            picture: 0,
            along_px,
            across_px: fit.x[0],
            slope: fit.x[1],
            sigma_px: (correlated * fit.covariance[(0, 0)]).sqrt(),
            bow_px: [fit.x[2], (correlated * fit.covariance[(2, 2)]).sqrt()],
            num_points: fit.weights.iter().filter(|weight| **weight > 0.0).count(),
        })
    }

    /// Returns two positions that represent the line: a straight line through both has the mean and the inclination of
    /// the whole piece (Gauss-Legendre points).
    pub(super) fn places(&self) -> [[f64; 2]; 2] {
        let half = 0.5 * (self.along_px[1] - self.along_px[0]) / 3.0_f64.sqrt();
        let middle = self.middle_px();
        [-half, half].map(|from| [middle + from, self.across_px + self.slope * from])
    }

    /// Returns both ends of the line, (along, across) in pixels.
    pub(super) fn ends(&self) -> [[f64; 2]; 2] {
        let middle = self.middle_px();
        self.along_px.map(|along| [along, self.across_px + self.slope * (along - middle)])
    }

    /// Returns the middle along the stripe, pixels.
    #[must_use]
    pub(crate) fn middle_px(&self) -> f64 {
        0.5 * (self.along_px[0] + self.along_px[1])
    }
}

/// A plateau, and its borders if it has neighbours on both sides in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct GaugePlateau {
    /// The plateau.
    pub plateau: Plateau,
    /// Borders along the stripe, half way to the neighbours' nearest points, pixels; `None` for the outermost plateaus.
    pub borders_px: Option<[f64; 2]>,
}

/// Finds one plateau for each height, in their order along the stripe. `points` are (along, across) in pixels, ascending
/// along the stripe. All plateaus are of picture 0.
///
/// # Errors
/// Too few points, or a number of plateaus other than the number of heights.
pub fn find_plateaus(
    points: &[[f64; 2]],
    heights: &[GaugeHeight],
) -> Result<Vec<GaugePlateau>, PlateauError> {
    let pieces = plateaus::cut(points, heights.len())?;
    let between = |at: usize| 0.5 * (points[at - 1][0] + points[at][0]);
    let found = pieces.iter().zip(heights).enumerate().map(|(at, (piece, &height))| {
        let plateau = Plateau::fit(points, &piece.inner, height)
            .ok_or(PlateauError::TooFewPoints { plateau: at })?;
        let is_between = at > 0 && at + 1 < pieces.len();
        let borders_px = is_between.then(|| [between(piece.whole.start), between(piece.whole.end)]);
        Ok(GaugePlateau { plateau, borders_px })
    });
    found.collect()
}
