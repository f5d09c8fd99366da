//! The projective map between a plane and its picture.

use nalgebra::{DMatrix, Matrix3, Point2, Vector3};

/// The map that takes points of a plane onto their pictures best, in the sense of the direct linear transform with
/// normalised coordinates (Hartley and Zisserman 2004, algorithm 4.2). `None` for fewer than four pairs, or for points
/// that do not determine it: all on one line.
pub(super) fn fit(pairs: &[(Point2<f64>, Point2<f64>)]) -> Option<Matrix3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let from_plane = normaliser(pairs.iter().map(|pair| pair.0))?;
    let from_image = normaliser(pairs.iter().map(|pair| pair.1))?;
    // nalgebra returns only as many singular vectors as the matrix has rows: padding to a square matrix keeps all.
    let mut equations = DMatrix::zeros((2 * pairs.len()).max(9), 9);
    for (i, (plane, image)) in pairs.iter().enumerate() {
        let p = apply(&from_plane, *plane)?;
        let q = apply(&from_image, *image)?;
        let rows = [
            [-p.x, -p.y, -1.0, 0.0, 0.0, 0.0, q.x * p.x, q.x * p.y, q.x],
            [0.0, 0.0, 0.0, -p.x, -p.y, -1.0, q.y * p.x, q.y * p.y, q.y],
        ];
        for (k, row) in rows.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                equations[(2 * i + k, j)] = *value;
            }
        }
    }
    let eigen = (equations.transpose() * equations).symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // Two solutions: the points lie on a line.
    if eigen.eigenvalues[order[1]] < 1e-12 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let found = eigen.eigenvectors.column(order[0]);
    let normalised = Matrix3::from_row_iterator(found.iter().copied());
    let map = from_image.try_inverse()? * normalised * from_plane;
    let scale = map[(2, 2)];
    let scaled = if scale.abs() > 1e-12 * map.norm() { map / scale } else { map / map.norm() };
    scaled.iter().all(|value| value.is_finite()).then_some(scaled)
}

/// Maps a point; `None` at infinity.
pub(super) fn apply(map: &Matrix3<f64>, point: Point2<f64>) -> Option<Point2<f64>> {
    let mapped = map * Vector3::new(point.x, point.y, 1.0);
    let found = Point2::new(mapped.x / mapped.z, mapped.y / mapped.z);
    (found.x.is_finite() && found.y.is_finite()).then_some(found)
}

/// Moves points to their centroid and scales their mean distance from it to √2.
fn normaliser(points: impl Iterator<Item = Point2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let sum = points.clone().fold((0.0, 0.0), |sum, p| (sum.0 + p.x, sum.1 + p.y));
    let (x, y) = (sum.0 / count, sum.1 / count);
    let spread = points.map(|p| (p.x - x).hypot(p.y - y)).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / spread;
    scale
        .is_finite()
        .then(|| Matrix3::new(scale, 0.0, -scale * x, 0.0, scale, -scale * y, 0.0, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_map_is_recovered() {
        let truth = Matrix3::new(300.0, 20.0, 320.0, -15.0, 280.0, 240.0, 0.2, -0.4, 1.0);
        let grid = (0..12).map(|i| Point2::new(f64::from(i % 4) * 0.04, f64::from(i / 4) * 0.04));
        let pairs: Vec<_> = grid.map(|p| (p, apply(&truth, p).unwrap())).collect();
        let found = fit(&pairs).unwrap();
        assert!((found - truth).norm() < 1e-6, "{found}");
        assert!((fit(&pairs[..4]).is_none()), "the first four lie on a line");
        let corners = [pairs[0], pairs[3], pairs[8], pairs[11]];
        assert!((fit(&corners).unwrap() - truth).norm() < 1e-6);
    }

    #[test]
    fn points_in_one_place_have_no_map() {
        let same = [(Point2::new(1.0, 1.0), Point2::new(2.0, 2.0)); 6];
        assert_eq!(fit(&same), None);
        assert_eq!(fit(&[]), None);
    }
}
