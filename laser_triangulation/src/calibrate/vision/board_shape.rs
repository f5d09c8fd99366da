//! How a board deviates from flat squares.

use nalgebra::{Point2, Point3};

/// Steps a side on which the bow is looked for: its highest point may lie inside.
const STEPS: u32 = 8;

/// A board that is bent, or whose fields are not square. Its frame is that of the target: x along the columns, y along the
/// rows, z away from the camera.
///
/// A quadratic surface looks the same from any of its points, but for a plane that belongs to the pose: the part of
/// the board that is seen need not be known. It also looks the same after half a turn, as a checkerboard does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BoardShape {
    /// Height of a field divided by its width, minus 1.
    pub(super) stretch: f64,
    /// The surface is `z = a x² + b x y + c y²`: a, b and c, 1/m.
    pub(super) bend_per_m: [f64; 3],
}

/// One unknown of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShapeTerm {
    /// The stretch.
    Stretch,
    /// A coefficient of the bend.
    Bend(usize),
}

/// All coefficients of the bend.
pub(super) const BEND: [ShapeTerm; 3] =
    [ShapeTerm::Bend(0), ShapeTerm::Bend(1), ShapeTerm::Bend(2)];

impl BoardShape {
    /// Returns a point of the board whose place on flat squares is this, relative to any point of the board.
    pub(super) fn point(&self, flat: Point2<f64>) -> Point3<f64> {
        let (x, y) = (flat.x, flat.y * (1.0 + self.stretch));
        Point3::new(x, y, self.height_m(x, y))
    }

    /// Returns z at a point in the target's frame, metres.
    pub(super) fn height_m(&self, x: f64, y: f64) -> f64 {
        let [a, b, c] = self.bend_per_m;
        a * x * x + b * x * y + c * y * y
    }

    /// Returns the difference between the highest and the lowest point of a rectangle of this size, metres.
    pub(super) fn bow_m(&self, size_m: [f64; 2]) -> f64 {
        let at = |step: u32, size_m: f64| (f64::from(step) / f64::from(STEPS) - 0.5) * size_m;
        let places = (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j)));
        let heights = places.map(|(i, j)| self.height_m(at(i, size_m[0]), at(j, size_m[1])));
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        high - low
    }

    /// Returns the value of an unknown.
    pub(super) const fn value_mut(&mut self, term: ShapeTerm) -> &mut f64 {
        match term {
            ShapeTerm::Stretch => &mut self.stretch,
            ShapeTerm::Bend(at) => &mut self.bend_per_m[at],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bow_of_a_parabola_is_its_height() {
        // 1 mm high on 0.2 m.
        let shape = BoardShape { bend_per_m: [0.1, 0.0, 0.0], ..BoardShape::default() };
        assert!((shape.bow_m([0.2, 0.1]) - 1e-3).abs() < 1e-12);
        assert!((shape.point(Point2::new(0.1, 0.05)).z - 1e-3).abs() < 1e-12);
    }
}
