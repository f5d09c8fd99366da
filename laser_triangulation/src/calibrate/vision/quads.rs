//! Dark quadrilaterals in a grey picture: the outlines of square markers on a light ground.

use nalgebra::{Point2, Vector2};

use super::{components, picture::GrayPicture};

/// Smallest side of a quadrilateral, pixels: two per cell of a marker of six cells.
const MIN_SIDE_PX: f64 = 12.0;
/// A region is rejected if its hull covers less than this share of the quadrilateral.
const MIN_SHARE: f64 = 0.85;
/// Most hull corners that are examined.
const MAX_HULL: usize = 120;
/// Search range for an edge across a side, pixels.
const REACH_PX: i32 = 3;

/// Four corners in order round the quadrilateral, pixels.
pub type Quad = [Point2<f64>; 4];

/// Returns every dark quadrilateral, with its sides fitted to the steepest gradients.
pub(super) fn find(picture: &GrayPicture) -> Vec<Quad> {
    let regions = components::dark_outlines(picture);
    regions.iter().filter_map(|outline| refine(picture, &quad_of(outline)?)).collect()
}

/// Returns the largest quadrilateral in the hull of an outline, if it covers most of the region.
fn quad_of(outline: &[Point2<f64>]) -> Option<Quad> {
    let hull = hull(outline);
    if hull.len() < 4 || hull.len() > MAX_HULL {
        return None;
    }
    let area = |a: Point2<f64>, b: Point2<f64>, c: Point2<f64>| 0.5 * (b - a).perp(&(c - a));
    let whole: f64 = (1..hull.len() - 1).map(|i| area(hull[0], hull[i], hull[i + 1])).sum();
    let mut best: Option<(f64, Quad)> = None;
    for i in 0..hull.len() {
        for j in i + 2..hull.len() {
            // The farthest corner on either side of the diagonal.
            let far = |corners: &mut dyn Iterator<Item = usize>| {
                let of = |k: usize| area(hull[i], hull[j], hull[k]).abs();
                corners.map(|k| (of(k), k)).max_by(|a, b| a.0.total_cmp(&b.0))
            };
            let one = far(&mut (i + 1..j));
            let other = far(&mut (j + 1..i + hull.len()).map(|k| k % hull.len()));
            let (Some((area_one, k)), Some((area_other, l))) = (one, other) else { continue };
            let found = area_one + area_other;
            if best.as_ref().is_none_or(|(most, _)| found > *most) {
                best = Some((found, [hull[i], hull[k], hull[j], hull[l]]));
            }
        }
    }
    let (area, quad) = best?;
    let is_large = (0..4).all(|i| (quad[(i + 1) % 4] - quad[i]).norm() >= MIN_SIDE_PX);
    (is_large && area > MIN_SHARE * whole.abs()).then_some(quad)
}

/// Computes the hull by Andrew's monotone chain, without collinear points; turns to the right in image coordinates.
fn hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = &Point2<f64>>| {
        let mut chain: Vec<Point2<f64>> = Vec::new();
        for &point in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp(&(point - a)) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter());
    hull.extend(chain(&mut sorted.iter().rev()));
    hull
}

/// Returns the quadrilateral between the lines through the steepest gradients across each side.
fn refine(picture: &GrayPicture, quad: &Quad) -> Option<Quad> {
    let mut sides = Vec::with_capacity(4);
    for i in 0..4 {
        sides.push(side(picture, quad[i], quad[(i + 1) % 4])?);
    }
    let mut refined = *quad;
    for (i, corner) in refined.iter_mut().enumerate() {
        let found = cross(&sides[(i + 3) % 4], &sides[i])?;
        if (found - *corner).norm() > 2.0 * f64::from(REACH_PX) {
            return None;
        }
        *corner = found;
    }
    Some(refined)
}

/// A point of a line and its direction.
type Line = (Point2<f64>, Vector2<f64>);

/// Fits the line through the steepest gradients across a side, without its ends.
fn side(picture: &GrayPicture, from: Point2<f64>, to: Point2<f64>) -> Option<Line> {
    let length = (to - from).norm();
    let along = (to - from) / length;
    let across = Vector2::new(-along.y, along.x);
    let steps = (0.8 * length) as usize;
    let edges: Vec<_> = (0..=steps)
        .filter_map(|step| {
            let at = from + along * (0.1 * length + step as f64);
            Some(at + across * steepest(picture, at, across)?)
        })
        .collect();
    if edges.len() < steps / 2 || edges.len() < 4 {
        return None;
    }
    // Two rounds: the second one ignores points far from the first line.
    let first = through(&edges);
    let close: Vec<_> = edges.into_iter().filter(|edge| off(&first, *edge) < 0.7).collect();
    (close.len() >= 4).then(|| through(&close))
}

fn off(line: &Line, point: Point2<f64>) -> f64 {
    line.1.perp(&(point - line.0)).abs()
}

/// Returns the sub-pixel position along `across` at which the grey level changes fastest.
fn steepest(picture: &GrayPicture, at: Point2<f64>, across: Vector2<f64>) -> Option<f64> {
    let step = 0.5;
    let count = (f64::from(REACH_PX) / step) as i32;
    let slope = |i: i32| {
        let at = at + across * (f64::from(i) * step);
        Some((level(picture, at + across * step)? - level(picture, at - across * step)?).abs())
    };
    let slopes: Option<Vec<_>> = (-count..=count).map(slope).collect();
    let slopes = slopes?;
    let top = (1..slopes.len() - 1).max_by(|&a, &b| slopes[a].total_cmp(&slopes[b]))?;
    let (a, b, c) = (slopes[top - 1], slopes[top], slopes[top + 1]);
    let bend = a - 2.0 * b + c;
    let shift = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-1.0, 1.0) } else { 0.0 };
    (b > 4.0).then(|| (top as f64 + shift - f64::from(count)) * step)
}

/// Returns the grey level between pixels, bilinear; `None` outside.
pub(super) fn level(picture: &GrayPicture, at: Point2<f64>) -> Option<f64> {
    let (x, y) = (at.x.floor(), at.y.floor());
    let (width, height) = (picture.width as usize, picture.height as usize);
    if x < 0.0 || y < 0.0 || x + 1.0 >= width as f64 || y + 1.0 >= height as f64 {
        return None;
    }
    let (column, row) = (x as usize, y as usize);
    let (right, down) = (at.x - x, at.y - y);
    let of = |column: usize, row: usize| f64::from(picture.levels[row * width + column]);
    let above = of(column, row) * (1.0 - right) + of(column + 1, row) * right;
    let below = of(column, row + 1) * (1.0 - right) + of(column + 1, row + 1) * right;
    Some(above * (1.0 - down) + below * down)
}

fn through(points: &[Point2<f64>]) -> Line {
    let count = points.len() as f64;
    let middle = points.iter().map(|point| point.coords).sum::<Vector2<f64>>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let off = point.coords - middle;
        (xx, xy, yy) = (xx + off.x * off.x, xy + off.x * off.y, yy + off.y * off.y);
    }
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    (middle.into(), Vector2::new(angle.cos(), angle.sin()))
}

fn cross(one: &Line, other: &Line) -> Option<Point2<f64>> {
    let turn = one.1.perp(&other.1);
    (turn.abs() > 0.1).then(|| one.0 + one.1 * (other.0 - one.0).perp(&other.1) / turn)
}
