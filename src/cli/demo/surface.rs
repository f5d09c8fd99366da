//! The measured surface of a scan: its slices laid one behind the other.

use anyhow::{Result, ensure};

use crate::{msg::sensor_msgs::PointCloud2, scanner::scan::Point};

/// Bytes of x, y, z and intensity.
const POINT_BYTES: usize = size_of::<Point>();

/// Measured points, one row a profile. NaN in all four numbers: not measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Points of a profile.
    pub width: usize,
    /// Profiles times `width` points: x along the stripe, y along the motion, z up, metres; then brightness.
    pub points: Vec<Point>,
}

impl Surface {
    /// Lays a slice behind those before it.
    ///
    /// # Errors
    /// A cloud that is not organised as the node does, or of another width.
    pub fn append(&mut self, slice: &PointCloud2<'_>) -> Result<()> {
        let width = slice.width as usize;
        ensure!(
            slice.point_step as usize == POINT_BYTES && !slice.is_bigendian,
            "points of {} bytes are not x, y, z, intensity in little endian",
            slice.point_step,
        );
        ensure!(
            self.points.is_empty() || self.width == width,
            "a slice {width} points wide does not fit behind one of {}",
            self.width,
        );
        self.width = width;
        self.points.extend(slice.data.chunks_exact(POINT_BYTES).map(|bytes| {
            let mut numbers =
                bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            [(); 4].map(|()| numbers.next().unwrap_or(f32::NAN))
        }));
        Ok(())
    }

    /// Profiles in the order of their frames.
    pub fn profiles(&self) -> impl DoubleEndedIterator<Item = &[Point]> {
        self.points.chunks_exact(self.width.max(1))
    }

    /// Points that were measured.
    pub fn measured(&self) -> impl Iterator<Item = &Point> {
        self.points.iter().filter(|point| is_measured(point))
    }

    /// Typical distance of neighbours along the stripe and along the motion, metres.
    pub fn pitch_m(&self) -> [f32; 2] {
        let along_x = self
            .profiles()
            .flat_map(|profile| profile.windows(2).map(|pair| pair[1][0] - pair[0][0]));
        let positions: Vec<f32> = self.profiles().filter_map(position_m).collect();
        let along_y = positions.windows(2).map(|pair| pair[1] - pair[0]);
        [median_magnitude(along_x), median_magnitude(along_y)]
    }

    /// Whether each point is on the part: measured, and nearer to the scan's top than to height 0.
    pub fn on_part(&self) -> Vec<bool> {
        let top_m = self.extent_m(2).map_or(f32::INFINITY, |[_, top]| top);
        self.points.iter().map(|point| point[2] > 0.5 * top_m).collect()
    }

    /// The surface without the table and without points less than `reach` columns from anything but the part, which
    /// the blur mixes with what lies beside it.
    #[must_use]
    pub fn inside_part(&self, reach: usize) -> Self {
        let on_part = self.on_part();
        let is_inside = |at: usize| {
            let column = at % self.width;
            let (first, last) = (column.saturating_sub(reach), column + reach);
            let row = &on_part[at - column..at - column + self.width];
            row[first..=last.min(self.width - 1)].iter().all(|on_part| *on_part)
        };
        let points = self.points.iter().enumerate();
        let points = points.map(|(at, point)| if is_inside(at) { *point } else { [f32::NAN; 4] });
        Self { width: self.width, points: points.collect() }
    }

    /// Smallest and largest value of a coordinate (0: x, 1: y, 2: z) of the measured points, metres; none if there are none.
    pub fn extent_m(&self, coordinate: usize) -> Option<[f32; 2]> {
        self.measured().map(|point| point[coordinate]).fold(None, |extent, value| {
            let [low, high] = extent.unwrap_or([value, value]);
            Some([low.min(value), high.max(value)])
        })
    }
}

/// Whether a point has a place.
pub fn is_measured(point: &Point) -> bool {
    point[2].is_finite()
}

/// Where a profile lies along the motion, metres; none without a measured point.
pub fn position_m(profile: &[Point]) -> Option<f32> {
    profile.iter().find(|point| is_measured(point)).map(|point| point[1])
}

/// Median of the magnitudes of all finite values; 0 without any.
fn median_magnitude(values: impl Iterator<Item = f32>) -> f32 {
    let mut magnitudes: Vec<f32> = values.filter(|v| v.is_finite()).map(f32::abs).collect();
    magnitudes.sort_by(f32::total_cmp);
    magnitudes.get(magnitudes.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// 101 x 81 points 0.1 x 0.2 mm apart, 10 x 16 mm, from a height in metres over (x, y) in millimetres.
    pub(in crate::cli::demo) fn surface(height_m: impl Fn(f32, f32) -> f32) -> Surface {
        let mut surface = Surface { width: 101, points: Vec::new() };
        for row in 0..81_u8 {
            for column in 0..101_u8 {
                let (x, y) = (f32::from(column) * 0.1 - 5.0, f32::from(row) * 0.2);
                let z = height_m(x, y);
                let point = [x * 1e-3, y * 1e-3, z, 0.5];
                surface.points.push(if z.is_nan() { [f32::NAN; 4] } else { point });
            }
        }
        surface
    }

    #[test]
    fn slices_of_one_width_lie_behind_one_another() {
        let data: Vec<u8> = (0..16_u8).flat_map(|n| f32::from(n).to_le_bytes()).collect();
        let slice = |width, data| PointCloud2 {
            width,
            height: 2,
            point_step: 16,
            data,
            ..PointCloud2::default()
        };
        let mut surface = Surface::default();
        surface.append(&slice(2, &data)).unwrap();
        surface.append(&slice(2, &data[..32])).unwrap();
        assert_eq!((surface.width, surface.points.len()), (2, 6));
        for at in [1, 5] {
            let numbers = surface.points[at].map(|number| number as u8);
            assert_eq!(numbers, [4, 5, 6, 7], "point {at}");
        }
        assert!(surface.append(&slice(1, &data)).is_err());
        let other = PointCloud2 { point_step: 20, ..slice(2, &data) };
        assert!(surface.append(&other).is_err());
    }

    #[test]
    fn the_inside_of_the_part_keeps_off_its_edges_and_holes() {
        // The part reaches from x = -3 to 4 mm, that is from column 20 to 90, and has a hole at column 50.
        let on_part = |column: i32| (20..=90).contains(&column) && column != 50;
        let scan = surface(|x, _| {
            let column = ((x + 5.0) / 0.1).round() as i32;
            if column == 50 {
                f32::NAN
            } else if on_part(column) {
                1e-3
            } else {
                1e-5
            }
        });
        let inside = scan.inside_part(3);
        for (at, point) in inside.points.iter().enumerate() {
            let column = (at % 101) as i32;
            let expected = (column - 3..=column + 3).all(on_part);
            assert_eq!(is_measured(point), expected, "column {column}");
        }
    }

    #[test]
    fn pitch_and_extent_ignore_what_is_missing() {
        let holes = surface(|x, y| if x < -4.05 || (y - 3.0).abs() < 0.05 { f32::NAN } else { y });
        let [along_x, along_y] = holes.pitch_m();
        assert!((along_x - 1e-4).abs() < 1e-7 && (along_y - 2e-4).abs() < 1e-7);
        let [low, high] = holes.extent_m(0).unwrap();
        assert!((low + 4e-3).abs() < 1e-7 && (high - 5e-3).abs() < 1e-7);
        assert_eq!(surface(|_, _| f32::NAN).extent_m(0), None);
        assert!(surface(|_, _| f32::NAN).pitch_m().iter().all(|pitch| pitch.abs() < 1e-9));
    }
}
