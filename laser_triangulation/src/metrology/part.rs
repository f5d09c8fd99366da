//! The part on the table: the points of a scan that belong to it.

use nalgebra::Point3;

use super::surface::Surface;

/// Returns, for every point in order, true if it lies on the part: it was measured, and it is nearer to the highest
/// point of the scan than to height 0, the table.
#[must_use]
pub(crate) fn on_part(surface: &Surface) -> Vec<bool> {
    let top_m = surface.measured().map(|(_, point)| point.z).reduce(f64::max);
    let limit_m = top_m.map_or(f64::INFINITY, |top_m| 0.5 * top_m);
    surface.points.iter().map(|point| point.z > limit_m).collect()
}

/// Returns the surface without points near the edge of the part: a point is NaN unless all points within `reach` columns of
/// its row lie on the part. A filter of that reach along the stripe mixes such a point with its surroundings.
#[must_use]
pub fn inside_part(surface: &Surface, reach: usize) -> Surface {
    let (width, on_part) = (surface.width, on_part(surface));
    let is_inside = |at: usize| {
        let column = at % width;
        let (first, last) = (column.saturating_sub(reach), (column + reach).min(width - 1));
        on_part[at - column..][first..=last].iter().all(|on_part| *on_part)
    };
    let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
    let points = surface.points.iter().enumerate();
    let points = points.map(|(at, point)| if is_inside(at) { *point } else { nowhere });
    Surface { width, points: points.collect() }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{deviation::tests::surface, surface::is_measured},
        *,
    };

    #[test]
    fn the_inside_of_the_part_excludes_its_edges_and_holes() {
        // The part reaches from x = -3 to 4 mm, that is from column 20 to 90, and has a hole at column 50.
        let on_part = |column: i32| (20..=90).contains(&column) && column != 50;
        let scan = surface(|x, _| {
            let column = ((x + 5.0) / 0.1).round() as i32;
            if column == 50 {
                f64::NAN
            } else if on_part(column) {
                1e-3
            } else {
                1e-5
            }
        });
        let inside = inside_part(&scan, 3);
        for (at, point) in inside.points.iter().enumerate() {
            let column = (at % 101) as i32;
            let expected = (column - 3..=column + 3).all(on_part);
            assert_eq!(is_measured(point), expected, "column {column}");
        }
    }

    #[test]
    fn nothing_is_on_the_part_if_nothing_was_measured() {
        assert!(!on_part(&surface(|_, _| f64::NAN)).contains(&true));
    }
}
