//! Slices as point clouds, scans as height images.

use std::borrow::Cow;

use crate::{
    msg::{
        builtin_interfaces::Time,
        cdr,
        sensor_msgs::{Image, PointCloud2, PointField},
        std_msgs::Header,
    },
    scanner::{
        height_map::HeightMap,
        scan::{Point, Slice},
    },
};

const POINT_BYTES: u32 = size_of::<Point>() as u32;
const BIG_ENDIAN_HOST: bool = cfg!(target_endian = "big");

/// Layout of [`Point`].
static FIELDS: [PointField<'static>; 4] =
    [float("x", 0), float("y", 4), float("z", 8), float("intensity", 12)];

const fn float(name: &'static str, offset: u32) -> PointField<'static> {
    PointField { name: Cow::Borrowed(name), offset, datatype: PointField::FLOAT32, count: 1 }
}

/// Returns a slice as it lies in memory: one row per profile, NaN for missing points, in the scan frame `frame_id`.
pub fn organised<'a>(frame_id: &'a str, slice: &'a Slice) -> PointCloud2<'a> {
    PointCloud2 {
        height: slice.height,
        width: slice.width,
        is_dense: false,
        ..cloud(frame_id, slice.stamp_ns, slice.width, &slice.points)
    }
}

/// Returns a slice without its missing points, in one row, for viewers. Replaces `points` by the remaining points.
pub(crate) fn dense<'a>(
    frame_id: &'a str,
    slice: &Slice,
    points: &'a mut Vec<Point>,
) -> PointCloud2<'a> {
    points.clear();
    points.extend(slice.points.iter().filter(|point| point.iter().all(|v| v.is_finite())));
    let width = points.len() as u32;
    PointCloud2 {
        height: 1,
        width,
        is_dense: true,
        ..cloud(frame_id, slice.stamp_ns, width, points)
    }
}

fn cloud<'a>(frame_id: &'a str, stamp_ns: i64, width: u32, points: &'a [Point]) -> PointCloud2<'a> {
    PointCloud2 {
        header: Header { stamp: Time::from_ns(stamp_ns), frame_id: Cow::Borrowed(frame_id) },
        fields: Cow::Borrowed(&FIELDS),
        is_bigendian: BIG_ENDIAN_HOST,
        point_step: POINT_BYTES,
        row_step: width.saturating_mul(POINT_BYTES),
        data: bytemuck::cast_slice(points),
        ..PointCloud2::default()
    }
}

/// Returns the largest number of points of a cloud whose message in the frame `frame_id` has at most `max_bytes`.
pub(crate) fn points_within(max_bytes: usize, frame_id: &str) -> usize {
    let mut empty = Vec::new();
    // An empty cloud that cannot be encoded has no room for points.
    match cdr::encode(&cloud(frame_id, 0, 0, &[]), &mut empty) {
        Ok(()) => max_bytes.saturating_sub(empty.len()) / size_of::<Point>(),
        Err(_) => 0,
    }
}

/// Returns the heights of a scan as an image of floats (REP 118): metres, NaN if not measured.
pub(crate) fn height_map<'a>(frame_id: &'a str, map: &'a HeightMap) -> Image<'a> {
    Image {
        header: Header { stamp: Time::from_ns(map.stamp_ns), frame_id: Cow::Borrowed(frame_id) },
        height: map.height,
        width: map.width,
        encoding: Cow::Borrowed("32FC1"),
        is_bigendian: u8::from(BIG_ENDIAN_HOST),
        step: map.width.saturating_mul(size_of::<f32>() as u32),
        data: bytemuck::cast_slice(&map.z_m),
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "values are copied, not computed")]
mod tests {
    use super::*;

    const NAN: Point = [f32::NAN; 4];

    /// Two profiles of three points, the middle one missing and the last one empty.
    fn slice() -> Slice {
        let points = vec![[1.0, 2.0, 3.0, 0.5], NAN, [4.0, 5.0, 6.0, 0.25], NAN, NAN, NAN];
        Slice { stamp_ns: 1_000_000_002, width: 3, height: 2, points, ..Slice::default() }
    }

    /// Returns a field of a point, read according to the message's own description.
    fn value(cloud: &PointCloud2<'_>, row: u32, column: u32, name: &str) -> f32 {
        let field = cloud.fields.iter().find(|field| field.name == name).unwrap();
        assert_eq!((field.datatype, field.count), (PointField::FLOAT32, 1));
        let at = (row * cloud.row_step + column * cloud.point_step + field.offset) as usize;
        let bytes = cloud.data[at..at + 4].try_into().unwrap();
        if cloud.is_bigendian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }
    }

    #[test]
    fn an_organised_cloud_keeps_missing_points() {
        let slice = slice();
        let cloud = organised("scan", &slice);
        assert_eq!(cloud.header.stamp, Time { sec: 1, nanosec: 2 });
        assert_eq!(cloud.header.frame_id, "scan");
        assert_eq!((cloud.height, cloud.width, cloud.is_dense), (2, 3, false));
        assert_eq!((cloud.point_step, cloud.row_step, cloud.data.len()), (16, 48, 96));
        let third = ["x", "y", "z", "intensity"].map(|name| value(&cloud, 0, 2, name));
        assert_eq!(third, [4.0, 5.0, 6.0, 0.25]);
        assert!(["x", "y", "z", "intensity"].iter().all(|name| value(&cloud, 1, 0, name).is_nan()));
    }

    #[test]
    fn a_dense_cloud_has_only_measured_points() {
        let mut buffer = vec![[9.0; 4]; 10];
        let slice = slice();
        let cloud = dense("scan", &slice, &mut buffer);
        assert_eq!((cloud.height, cloud.width, cloud.is_dense), (1, 2, true));
        assert_eq!((cloud.row_step, cloud.data.len()), (32, 32));
        assert_eq!([0, 1].map(|i| value(&cloud, 0, i, "z")), [3.0, 6.0]);

        let empty = Slice { points: vec![NAN; 6], ..slice };
        let cloud = dense("scan", &empty, &mut buffer);
        assert_eq!((cloud.height, cloud.width, cloud.data.len()), (1, 0, 0));
    }

    #[test]
    fn points_within_is_the_largest_number_that_fits() {
        let mut bytes = Vec::new();
        let mut size = |frame_id, num_points| {
            let points = vec![NAN; num_points];
            let slice = Slice { width: num_points as u32, height: 1, points, ..Slice::default() };
            cdr::encode(&organised(frame_id, &slice), &mut bytes).unwrap();
            bytes.len()
        };
        for frame_id in ["", "a", "laser_plane"] {
            for max_bytes in [1000, 1007, 1013, 98_304] {
                let fits = points_within(max_bytes, frame_id);
                assert!(size(frame_id, fits) <= max_bytes && size(frame_id, fits + 1) > max_bytes);
            }
            assert_eq!(points_within(10, frame_id), 0);
        }
    }

    #[test]
    fn a_height_map_is_an_image_of_floats() {
        let map =
            HeightMap { stamp_ns: 0, width: 2, height: 2, z_m: vec![0.5, f32::NAN, -1.0, 2.0] };
        let image = height_map("scan", &map);
        assert_eq!((image.height, image.width, image.step), (2, 2, 8));
        assert_eq!(image.encoding, "32FC1");
        let heights: Vec<f32> = image
            .data
            .chunks_exact(4)
            .map(|bytes| f32::from_ne_bytes(bytes.try_into().unwrap()))
            .collect();
        assert_eq!(heights[0], 0.5);
        assert!(heights[1].is_nan());
        assert_eq!(heights[2..], [-1.0, 2.0]);
    }
}
