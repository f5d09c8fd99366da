//! How far corners lie from where perspective, a lens and a slightly bent board put them. Needs no calibration.

use nalgebra::{DVector, Matrix3, Point2, Vector2};

use super::{homography, least_squares};
use crate::statistics::median;

/// Rounds of reweighting.
const ROUNDS: usize = 4;
/// Least scale of the robust weights, pixels.
const MIN_SCALE_PX: f64 = 0.1;
/// Median distance of a point from the origin for two normal coordinates of standard deviation 1.
const RAYLEIGH_MEDIAN: f64 = 1.177_41;
/// Entries of a homography whose last one is 1.
const PERSPECTIVE: usize = 8;
/// Centre of the lens, its strength, and its corrections of fourth and sixth order.
const LENS: usize = 5;
/// x², x y, y² for either coordinate.
const BEND: usize = 6;
/// Prior of the lens and the bend, pixels, before the corners say more: one standard deviation, in units of
/// [`NOISE_PX`]. Corners of a small board would leave them open.
const LENS_SIGMA: [f64; LENS] = [0.1, 0.1, 0.3, 0.3, 0.3];
const BEND_SIGMA_PX: f64 = 3.0;
/// Standard deviation of a corner's position that the expectations are weighted against, pixels.
const NOISE_PX: f64 = 0.1;

/// Returns how far each corner lies from where the view and its neighbours put it, pixels. `pairs`: places on a board,
/// squares, and positions in the picture, pixels. `None` for corners of no board: fewer than six, or on one line.
///
/// A fit explains most of it: a homography, a division model of the lens (Fitzgibbon 2001) about the middle of the picture
/// with terms of fourth and sixth order, and a quadratic displacement for a board that is not flat. Cauchy weights keep
/// a few wrong corners from affecting it. What the fit leaves is smooth for a real lens: the median of the eight
/// neighbours is subtracted.
pub(super) fn find(pairs: &[(Point2<f64>, Point2<f64>)], size_px: [u32; 2]) -> Option<Vec<f64>> {
    let sight = Sight::new(pairs, size_px)?;
    let mut unknowns = sight.start()?;
    let mut weights = vec![1.0; pairs.len()];
    let mut off = Vec::new();
    for _ in 0..ROUNDS {
        unknowns = least_squares::minimise(unknowns, |x| sight.residuals(x, &weights))?.unknowns;
        off = sight.deviations(&unknowns)?;
        let off_px: Vec<_> = off.iter().map(Vector2::norm).collect();
        let scale_px = spread_px(&off_px).max(MIN_SCALE_PX);
        weights = off_px.iter().map(|off| 1.0 / (1.0 + (off / scale_px).powi(2)).sqrt()).collect();
    }
    Some((0..pairs.len()).map(|at| from_neighbours(pairs, &off, at)).collect())
}

/// Returns the distance of a corner's deviation from the median of its neighbours', or from none where there are none.
fn from_neighbours(pairs: &[(Point2<f64>, Point2<f64>)], off: &[Vector2<f64>], at: usize) -> f64 {
    let is_beside = |place: &Point2<f64>| {
        let steps = (place - pairs[at].0).amax();
        steps > 0.5 && steps < 1.5
    };
    let beside = || pairs.iter().zip(off).filter(|(pair, _)| is_beside(&pair.0));
    let middle = |axis: usize| {
        median(&mut beside().map(|(_, off)| off[axis]).collect::<Vec<_>>()).unwrap_or(0.0)
    };
    // A median of neighbours on both sides of 0 adds their scatter to the corner's own: the smaller of both counts.
    let local = off[at] - Vector2::new(middle(0), middle(1));
    local.norm().min(off[at].norm())
}

/// Returns the standard deviation of a coordinate by the median of distances, pixels.
pub(super) fn spread_px(off_px: &[f64]) -> f64 {
    median(&mut off_px.to_vec()).unwrap_or(f64::NAN) / RAYLEIGH_MEDIAN
}

/// The corners in coordinates of the order of 1.
struct Sight {
    /// Half the diagonal of the picture, pixels: the unit of its coordinates.
    unit_px: f64,
    pairs: Vec<(Point2<f64>, Point2<f64>)>,
}

impl Sight {
    fn new(pairs: &[(Point2<f64>, Point2<f64>)], [width, height]: [u32; 2]) -> Option<Self> {
        if pairs.len() < 6 {
            return None;
        }
        let half = Vector2::new(f64::from(width), f64::from(height)) / 2.0;
        let (unit_px, middle_px) = (half.norm(), half - Vector2::repeat(0.5));
        let places = pairs.iter().map(|pair| pair.0.coords);
        let low = places.clone().fold(Vector2::repeat(f64::MAX), |low, at| low.inf(&at));
        let high = places.fold(Vector2::repeat(f64::MIN), |high, at| high.sup(&at));
        let (middle, reach) = ((low + high) / 2.0, ((high - low) / 2.0).max());
        let scaled = pairs.iter().map(|(place, seen)| {
            let place = (place.coords - middle) / reach;
            (place.into(), ((seen.coords - middle_px) / unit_px).into())
        });
        Some(Self { unit_px, pairs: scaled.collect() })
    }

    /// The best homography, without lens and bend.
    fn start(&self) -> Option<DVector<f64>> {
        let map = homography::fit(&self.pairs)?;
        let entries = map.transpose() / map[(2, 2)];
        let mut start = DVector::zeros(PERSPECTIVE + LENS + BEND);
        for (to, from) in start.iter_mut().zip(entries.iter().take(PERSPECTIVE)) {
            *to = *from;
        }
        start.iter().all(|value| value.is_finite()).then_some(start)
    }

    /// Returns expected minus observed positions, pixels.
    fn deviations(&self, unknowns: &DVector<f64>) -> Option<Vec<Vector2<f64>>> {
        let (perspective, rest) = unknowns.as_slice().split_at(PERSPECTIVE);
        let (lens, bend) = rest.split_at(LENS);
        let map =
            Matrix3::from_row_iterator(perspective.iter().copied().chain(std::iter::once(1.0)));
        let center = Vector2::new(lens[0], lens[1]);
        let deviation = |(place, seen): &(Point2<f64>, Point2<f64>)| {
            let straight = homography::apply(&map, *place)?.coords - center;
            let (x, y) = (place.x, place.y);
            let terms = [x * x, x * y, y * y];
            let bent = |part: &[f64]| part.iter().zip(terms).map(|(a, b)| a * b).sum::<f64>();
            let bent_px = Vector2::new(bent(&bend[..3]), bent(&bend[3..]));
            let expected = center + distorted(straight, [lens[2], lens[3], lens[4]])?;
            Some((expected - seen.coords) * self.unit_px + bent_px)
        };
        self.pairs.iter().map(deviation).collect()
    }

    fn residuals(&self, unknowns: &DVector<f64>, weights: &[f64]) -> Option<DVector<f64>> {
        let off = self.deviations(unknowns)?;
        let seen =
            off.iter().zip(weights).flat_map(|(off, weight)| [off.x * weight, off.y * weight]);
        let sigmas = LENS_SIGMA.into_iter().chain([BEND_SIGMA_PX; BEND]);
        let open = unknowns.iter().skip(PERSPECTIVE).zip(sigmas);
        let expected = open.map(|(value, sigma)| NOISE_PX * value / sigma);
        let both: Vec<_> = seen.chain(expected).collect();
        Some(DVector::from_vec(both))
    }
}

/// The inverse of the division model: the straight position is `seen / (1 + strength · |seen|²)`; then terms of fourth and
/// sixth order.
fn distorted(straight: Vector2<f64>, [strength, fourth, sixth]: [f64; 3]) -> Option<Vector2<f64>> {
    let root = 1.0 - 4.0 * strength * straight.norm_squared();
    let seen = straight * (2.0 / (1.0 + root.sqrt()));
    let square = seen.norm_squared();
    (root >= 0.0).then(|| seen * (1.0 + square * square * (fourth + sixth * square)))
}
