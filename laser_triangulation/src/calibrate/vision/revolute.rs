//! A rotary axis from markers that turn with the part: each moves on a circle about it.

use std::f64::consts::TAU;

use nalgebra::{DVector, Point2, Point3, Unit, UnitQuaternion, Vector3};
use thiserror::Error;

use super::least_squares::{self, Solution};
use crate::scanner::{
    camera::{Camera, DistortedPixel},
    pose::perpendicular_basis,
};

/// Fewest pictures.
const MIN_FRAMES: usize = 5;
/// Smallest total rotation of the markers, radians.
const MIN_TURN: f64 = 0.5;
/// Number of initial normals to try, spread over about half the sphere.
const TRIED: usize = 1500;
/// Number of the best of them from which least squares starts.
const STARTS: usize = 3;

/// The centre of a marker in one picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting {
    /// Index of the picture, from 0 without gaps.
    pub(crate) frame: usize,
    /// Index of the marker, from 0 without gaps.
    pub(crate) marker: usize,
    /// Its centre, pixels.
    pub(crate) seen: DistortedPixel,
}

/// An axis of unknown distance: all lengths are in units of the distance from the lens to the markers' plane.
#[derive(Clone, Debug)]
pub(super) struct RevoluteFit {
    /// Direction of the axis, away from the lens; angles grow by the right-hand rule about it.
    pub(crate) direction: Unit<Vector3<f64>>,
    /// Intersection of the axis and the plane of the first marker, in units.
    pub(crate) point: Point3<f64>,
    /// Angle of every picture relative to the first, radians, without jumps.
    pub(crate) angles: Vec<f64>,
    /// Radius of each marker's circle, in units.
    pub(crate) radii: Vec<f64>,
    /// Root mean square distance between observed and projected centres, pixels.
    pub(crate) rms_px: f64,
    /// One standard deviation of the direction, radians, and of the point, in units.
    pub(crate) sigma: [f64; 2],
}

/// The reason why markers determine no axis.
#[derive(Debug, Error, PartialEq)]
pub enum RevoluteError {
    /// Too few pictures.
    #[error(
        "pictures with markers at a known position: {frames}, at least {MIN_FRAMES} are needed"
    )]
    Few {
        /// Pictures with markers.
        frames: usize,
    },
    /// The markers do not turn.
    #[error(
        "the markers turn by only {turned_deg:.1} degrees, which determines no axis: turn the table farther, once round is \
         best"
    )]
    Still {
        /// Angle from first to last picture, degrees.
        turned_deg: f64,
    },
    /// The markers do not move on circles.
    #[error("the markers go round no common axis: {0}")]
    NoAxis(String),
}

/// Fits the axis about which all markers move on circles. `near` is its direction, if it is known roughly: from there one
/// start suffices.
///
/// # Errors
/// Too few pictures, too small an angle, or no common axis.
pub(super) fn fit(
    camera: &Camera,
    sightings: &[Sighting],
    near: Option<Unit<Vector3<f64>>>,
) -> Result<RevoluteFit, RevoluteError> {
    let frames = sightings.iter().map(|s| s.frame + 1).max().unwrap_or(0);
    let markers = sightings.iter().map(|s| s.marker + 1).max().unwrap_or(0);
    if frames < MIN_FRAMES {
        return Err(RevoluteError::Few { frames });
    }
    let rays: Option<Vec<_>> = sightings.iter().map(|s| camera.ray(s.seen)).collect();
    let rays = rays.ok_or_else(|| {
        RevoluteError::NoAxis("a marker lies where the lens is not known".to_owned())
    })?;
    let problem = Problem { camera, sightings, rays: &rays, frames, markers };
    // Away from the lens.
    let away = |near: Unit<Vector3<f64>>| vec![near.into_inner() * near.z.signum()];
    let tried = near.map_or_else(|| half_sphere().collect(), away).into_iter();
    let mut starts: Vec<_> = tried.filter_map(|n| Some((problem.guess(n)?, n))).collect();
    starts.sort_by(|a, b| a.0.0.total_cmp(&b.0.0));
    let found = starts.into_iter().take(STARTS).filter_map(|((_, start), normal)| {
        let solved = least_squares::minimise(start, |x| problem.residuals(normal, x))?;
        Some((normal, solved))
    });
    let best = found.min_by(|a, b| a.1.rms().total_cmp(&b.1.rms()));
    let (normal, solution) =
        best.ok_or_else(|| RevoluteError::NoAxis("no starting point converges".to_owned()))?;
    problem.result(normal, &solution)
}

/// The sightings. The unknowns are, in this order: two tilts of the normal, two coordinates of the centre in the plane,
/// the angle of every picture but the first, and each marker's radius, phase and height except the first one's height.
struct Problem<'a> {
    camera: &'a Camera,
    sightings: &'a [Sighting],
    rays: &'a [Vector3<f64>],
    frames: usize,
    markers: usize,
}

impl Problem<'_> {
    /// Returns points of the plane with this normal at distance 1, in coordinates of the plane.
    fn in_plane(&self, normal: Vector3<f64>) -> Option<Vec<Point2<f64>>> {
        let [e1, e2] = perpendicular_basis(&normal);
        let point = |ray: &Vector3<f64>| {
            let depth = normal.dot(ray);
            (depth > 0.05 * ray.norm())
                .then(|| Point2::new(e1.dot(ray) / depth, e2.dot(ray) / depth))
        };
        self.rays.iter().map(point).collect()
    }

    /// Returns the misfit of circles about one point for a normal, and the unknowns that fit best.
    fn guess(&self, normal: Vector3<f64>) -> Option<(f64, DVector<f64>)> {
        let points = self.in_plane(normal)?;
        let center = common_center(&points, self.sightings, self.markers)?;
        let off = |at: usize| points[at] - center;
        let radii: Vec<f64> = (0..self.markers)
            .map(|marker| {
                let own =
                    || self.sightings.iter().enumerate().filter(move |(_, s)| s.marker == marker);
                own().map(|(at, _)| off(at).norm()).sum::<f64>() / own().count() as f64
            })
            .collect();
        let misfit = self.sightings.iter().enumerate();
        let misfit = misfit.map(|(at, s)| (off(at).norm() / radii[s.marker] - 1.0).powi(2));
        let cost = misfit.sum::<f64>();
        let mut unknowns = DVector::zeros(self.unknowns());
        (unknowns[2], unknowns[3]) = (center.x, center.y);
        let mut phases: Vec<Option<f64>> = vec![None; self.markers];
        let mut last = 0.0;
        for frame in 0..self.frames {
            let seen = || self.sightings.iter().enumerate().filter(move |(_, s)| s.frame == frame);
            let angle = |at: usize| off(at).y.atan2(off(at).x);
            let turned = seen().find_map(|(at, s)| Some(angle(at) - phases[s.marker]?));
            // No jumps of a whole turn between two pictures.
            let turned = turned.map_or(last, |turned| last + wrapped(turned - last));
            last = turned;
            if frame > 0 {
                unknowns[4 + frame - 1] = turned;
            }
            for (at, s) in seen() {
                phases[s.marker].get_or_insert(angle(at) - turned);
            }
        }
        for marker in 0..self.markers {
            let at = self.first_of(marker);
            (unknowns[at], unknowns[at + 1]) = (radii[marker], phases[marker]?);
        }
        cost.is_finite().then_some((cost, unknowns))
    }

    fn unknowns(&self) -> usize {
        4 + self.frames - 1 + 3 * self.markers - 1
    }

    /// Returns the index of a marker's radius, followed by its phase and height; the first marker has no height.
    fn first_of(&self, marker: usize) -> usize {
        4 + self.frames - 1 + 3 * marker - usize::from(marker > 0)
    }

    fn normal(start: Vector3<f64>, x: &DVector<f64>) -> Vector3<f64> {
        let [e1, e2] = perpendicular_basis(&start);
        (start + e1 * x[0] + e2 * x[1]).normalize()
    }

    /// Returns projected minus observed positions, pixels.
    fn residuals(&self, start: Vector3<f64>, x: &DVector<f64>) -> Option<DVector<f64>> {
        let normal = Self::normal(start, x);
        let [e1, e2] = perpendicular_basis(&normal);
        let center = normal + e1 * x[2] + e2 * x[3];
        let mut residuals = DVector::zeros(2 * self.sightings.len());
        for (at, sighting) in self.sightings.iter().enumerate() {
            let first = self.first_of(sighting.marker);
            let turned = if sighting.frame == 0 { 0.0 } else { x[4 + sighting.frame - 1] };
            let height = if sighting.marker == 0 { 0.0 } else { x[first + 2] };
            let (sin, cos) = (x[first + 1] + turned).sin_cos();
            let point = center + (e1 * cos + e2 * sin) * x[first] + normal * height;
            let DistortedPixel(seen) = self.camera.project(point.into())?;
            residuals[2 * at] = seen.x - sighting.seen.0.x;
            residuals[2 * at + 1] = seen.y - sighting.seen.0.y;
        }
        Some(residuals)
    }

    fn result(&self, start: Vector3<f64>, found: &Solution) -> Result<RevoluteFit, RevoluteError> {
        let x = &found.unknowns;
        let normal = Self::normal(start, x);
        let [e1, e2] = perpendicular_basis(&normal);
        let angles: Vec<f64> =
            (0..self.frames).map(|frame| if frame == 0 { 0.0 } else { x[4 + frame - 1] }).collect();
        let ends =
            angles.iter().fold((0.0, 0.0), |(low, high): (f64, f64), &a| (low.min(a), high.max(a)));
        if ends.1 - ends.0 < MIN_TURN {
            return Err(RevoluteError::Still { turned_deg: (ends.1 - ends.0).to_degrees() });
        }
        let Some(covariance) = &found.unit_covariance else {
            return Err(RevoluteError::NoAxis("the pictures do not determine it".to_owned()));
        };
        let degrees = (2 * self.sightings.len()).saturating_sub(self.unknowns()).max(1);
        let variance = found.residuals.norm_squared() / degrees as f64;
        let sigma =
            |a: usize| (variance * (covariance[(a, a)] + covariance[(a + 1, a + 1)])).sqrt();
        let distances = found.residuals.as_slice().chunks_exact(2);
        let squares: f64 = distances.map(|pair| pair[0].powi(2) + pair[1].powi(2)).sum();
        Ok(RevoluteFit {
            direction: Unit::new_normalize(normal),
            point: (normal + e1 * x[2] + e2 * x[3]).into(),
            angles,
            radii: (0..self.markers).map(|marker| x[self.first_of(marker)].abs()).collect(),
            rms_px: (squares / self.sightings.len() as f64).sqrt(),
            sigma: [sigma(0), sigma(2)],
        })
    }
}

/// Returns the point equidistant from each marker's positions: `|p - c|² = r²`, linear in c and r² - |c|².
fn common_center(points: &[Point2<f64>], seen: &[Sighting], markers: usize) -> Option<Point2<f64>> {
    let size = 2 + markers;
    let mut normal = nalgebra::DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    for (point, sighting) in points.iter().zip(seen) {
        let mut row = DVector::zeros(size);
        (row[0], row[1], row[2 + sighting.marker]) = (2.0 * point.x, 2.0 * point.y, 1.0);
        normal += &row * row.transpose();
        right += row * point.coords.norm_squared();
    }
    let found = normal.cholesky()?.solve(&right);
    Some(Point2::new(found[0], found[1]))
}

/// Returns directions spread evenly over the half of the sphere that faces away from the lens (Fibonacci lattice).
fn half_sphere() -> impl Iterator<Item = Vector3<f64>> {
    let golden = TAU * (1.0 - 1.0 / 1.618_033_988_749_895);
    (0..TRIED).map(move |i| {
        let z = (i as f64 + 0.5) / TRIED as f64;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), golden * i as f64);
        turn * Vector3::new((1.0 - z * z).sqrt(), 0.0, z)
    })
}

/// Wraps an angle to half a turn either way.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}
