//! Lattice points under a flat triangle.

/// Calls `take(column, row, z)` for every lattice point with its centre in the triangle; lattice points lie at half
/// integers, `size` of them along x and y. A point on a border belongs to the triangle of which it is the left or upper
/// border, so that two triangles never share a point.
pub(super) fn sample(
    corners: &[[f64; 3]; 3],
    size: [usize; 2],
    mut take: impl FnMut(usize, usize, f64),
) {
    let doubled = cross(corners[0], corners[1], [corners[2][0], corners[2][1]]);
    if doubled.is_nan() || doubled.abs() <= f64::MIN_POSITIVE {
        return;
    }
    // Counter-clockwise, so that the inside is left of every border.
    let [a, b, c] = if doubled > 0.0 { *corners } else { [corners[0], corners[2], corners[1]] };
    let bounds = [0, 1].map(|axis| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        let first = (low - 0.5).ceil().max(0.0) as usize;
        let end = ((high - 0.5).floor() + 1.0).clamp(0.0, size[axis] as f64) as usize;
        first..end
    });
    for row in bounds[1].clone() {
        for column in bounds[0].clone() {
            let at = [column as f64 + 0.5, row as f64 + 0.5];
            let weights =
                [(b, c), (c, a), (a, b)].map(|(from, to)| (from, to, cross(from, to, at)));
            let inside = weights.iter().all(|(from, to, weight)| {
                *weight > 0.0 || (*weight >= 0.0 && is_own_border(*from, *to))
            });
            if inside {
                let [(.., wa), (.., wb), (.., wc)] = weights;
                take(column, row, (wa * a[2] + wb * b[2] + wc * c[2]) / (wa + wb + wc));
            }
        }
    }
}

/// Returns twice the area of the triangle from a border to a point, positive to its left. Both triangles at a border
/// get the same number except for its sign, because it is always computed in the same direction.
fn cross(from: [f64; 3], to: [f64; 3], at: [f64; 2]) -> f64 {
    let area = |from: [f64; 3], to: [f64; 3]| {
        (to[0] - from[0]) * (at[1] - from[1]) - (to[1] - from[1]) * (at[0] - from[0])
    };
    if (from[0], from[1]) <= (to[0], to[1]) { area(from, to) } else { -area(to, from) }
}

/// Returns true for exactly one of the two triangles at a border, which traverse it in opposite directions.
fn is_own_border(from: [f64; 3], to: [f64; 3]) -> bool {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    dy < 0.0 || (dy <= 0.0 && dx > 0.0)
}
