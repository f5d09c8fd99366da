//! Ellipses in a grey picture: the images of dark or light circles.

use nalgebra::{Matrix2, Point2, Vector2};

use super::{components, picture::GrayPicture};

/// Half the sides of the squares around a pixel that define its surroundings: a circle is found by one of at least its
/// diameter.
const RADII: [usize; 4] = [12, 30, 75, 180];
/// Smallest radius, pixels.
const MIN_RADIUS_PX: f64 = 2.5;
/// Least ratio of the radii: a circle seen under 75 degrees.
const MIN_RATIO: f64 = 0.26;
/// Largest standard deviation of the outline from an ellipse: of its radius, and pixels. A square's is 0.1 of its radius.
const MAX_ROUGHNESS: [f64; 2] = [0.03, 0.3];
/// How far beyond the outline grey levels belong to the ellipse, pixels: no farther than halfway to the next one,
const REACH_PX: f64 = 3.0;
/// and at least so far.
const MIN_REACH_PX: f64 = 1.5;
/// Fewest grey levels between an ellipse and the ground.
const MIN_CONTRAST: f64 = 12.0;

/// One ellipse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ellipse {
    /// Centroid, pixels.
    pub(crate) centre: Point2<f64>,
    /// Area, square pixels.
    pub(crate) area: f64,
}

/// Returns the ellipses that are darker than their surroundings.
pub(super) fn dark(picture: &GrayPicture) -> Vec<Ellipse> {
    let mut shapes: Vec<Shape> = Vec::new();
    for radius in RADII {
        for outline in components::dark_outlines_within(picture, radius) {
            let Some(shape) = ellipse(picture, &outline) else { continue };
            let is_same =
                |other: &Shape| (other.centre - shape.centre).norm() < 0.5 * shape.small_px;
            if !shapes.iter().any(is_same) {
                shapes.push(shape);
            }
        }
    }
    let weighed = |(index, shape): (usize, &Shape)| {
        let others = shapes.iter().enumerate().filter(|(other, _)| *other != index);
        let gap_px = others.map(|(_, other)| shape.gap_px(other)).fold(f64::MAX, f64::min);
        weighed(picture, shape, REACH_PX.min(0.5 * gap_px))
    };
    shapes.iter().enumerate().filter_map(weighed).collect()
}

/// Returns the picture with black and white exchanged.
pub(super) fn negative(picture: &GrayPicture) -> GrayPicture {
    let levels = picture.levels.iter().map(|level| 255 - level).collect();
    GrayPicture { levels, ..*picture }
}

/// An ellipse from its outline.
struct Shape {
    centre: Point2<f64>,
    /// The matrix whose quadratic form is 1 on the outline.
    inverse: Matrix2<f64>,
    small_px: f64,
}

impl Shape {
    /// Returns the distance from the centre, radii.
    fn radius(&self, at: Point2<f64>) -> f64 {
        let off = at - self.centre;
        off.dot(&(self.inverse * off)).sqrt()
    }

    /// Returns the distance between two outlines on the line between the centres, pixels.
    fn gap_px(&self, other: &Self) -> f64 {
        let apart_px = (other.centre - self.centre).norm();
        apart_px * (1.0 - 1.0 / self.radius(other.centre) - 1.0 / other.radius(self.centre))
    }
}

/// Returns the shape of an outline that is an ellipse inside the picture.
fn ellipse(picture: &GrayPicture, outline: &[Point2<f64>]) -> Option<Shape> {
    let shape = shape(outline)?;
    let (width, height) = (f64::from(picture.width), f64::from(picture.height));
    let is_cut =
        |p: &Point2<f64>| p.x < 2.0 || p.y < 2.0 || p.x > width - 3.0 || p.y > height - 3.0;
    if outline.iter().any(is_cut) {
        return None;
    }
    let radii: Vec<_> = outline.iter().map(|&point| shape.radius(point)).collect();
    let mean = radii.iter().sum::<f64>() / radii.len() as f64;
    let squares = radii.iter().map(|radius| (radius - mean).powi(2)).sum::<f64>();
    let roughness = (squares / radii.len() as f64).sqrt();
    (roughness <= MAX_ROUGHNESS[0] + MAX_ROUGHNESS[1] / shape.small_px).then_some(shape)
}

/// Returns the ellipse with the moments of the region inside an outline, given as both ends of each row.
fn shape(outline: &[Point2<f64>]) -> Option<Shape> {
    let rows = || outline.chunks_exact(2).map(|ends| (ends[0].x, ends[1].x, ends[0].y));
    let count: f64 = rows().map(|(a, b, _)| b - a + 1.0).sum();
    let sum = rows().fold(Vector2::zeros(), |sum, (a, b, y)| {
        sum + Vector2::new(0.5 * (a + b), y) * (b - a + 1.0)
    });
    let centre = Point2::from(sum / count);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (a, b, y) in rows() {
        let (length, x, y) = (b - a + 1.0, 0.5 * (a + b) - centre.x, y - centre.y);
        xx += length * (x * x + length * length / 12.0);
        xy += length * x * y;
        yy += length * (y * y + 1.0 / 12.0);
    }
    // A filled ellipse has a quarter of its squared radii as second moments.
    let square = Matrix2::new(xx, xy, xy, yy) * (4.0 / count);
    let radii = square.symmetric_eigenvalues().map(f64::sqrt);
    let (small_px, large_px) = (radii.min(), radii.max());
    let is_round = small_px >= MIN_RADIUS_PX && small_px >= MIN_RATIO * large_px;
    // A ring or a bent region covers less than its ellipse.
    let fills = count / (std::f64::consts::PI * small_px * large_px);
    if !is_round || !(0.85..1.15).contains(&fills) {
        return None;
    }
    Some(Shape { centre, inverse: square.try_inverse()?, small_px })
}

/// Returns centroid and area weighed by the grey levels: that of the ground weighs 0, that of the middle 1.
fn weighed(picture: &GrayPicture, shape: &Shape, reach_px: f64) -> Option<Ellipse> {
    if reach_px < MIN_REACH_PX {
        return None;
    }
    let edge = reach_px / shape.small_px;
    let mut inside = Vec::new();
    let mut ground = Vec::new();
    let mut pixels = Vec::new();
    let reach = shape.inverse.try_inverse()?.diagonal().map(f64::sqrt) * (1.0 + edge);
    let range = |middle: f64, reach: f64, size: u32| {
        let low = (middle - reach).floor().max(0.0) as usize;
        low..((middle + reach).ceil() as usize + 1).min(size as usize)
    };
    for y in range(shape.centre.y, reach.y, picture.height) {
        for x in range(shape.centre.x, reach.x, picture.width) {
            let level = picture.levels[y * picture.width as usize + x];
            let at = Point2::new(x as f64, y as f64);
            let radius = shape.radius(at);
            if radius < 1.0 - 0.5 * edge || radius < 0.3 {
                inside.push(level);
            } else if (1.0 + 0.6 * edge..1.0 + edge).contains(&radius) {
                ground.push(level);
            }
            if radius < 1.0 + edge {
                pixels.push((at.coords, f64::from(level)));
            }
        }
    }
    // Close to the outline, its blur and the next circle's darken the ground.
    let share = if reach_px < REACH_PX { 0.8 } else { 0.5 };
    let (dark, light) = (quantile(&mut inside, 0.5)?, quantile(&mut ground, share)?);
    if light - dark < MIN_CONTRAST {
        return None;
    }
    // Not clamped: noise on both sides of the ground's level cancels.
    let weight = |level: f64| (light - level) / (light - dark);
    let area: f64 = pixels.iter().map(|(_, level)| weight(*level)).sum();
    let sum: Vector2<f64> = pixels.iter().map(|(at, level)| at * weight(*level)).sum();
    Some(Ellipse { centre: Point2::from(sum / area), area })
}

fn quantile(levels: &mut [u8], share: f64) -> Option<f64> {
    levels.sort_unstable();
    levels.get((share * levels.len() as f64) as usize).map(|level| f64::from(*level))
}
