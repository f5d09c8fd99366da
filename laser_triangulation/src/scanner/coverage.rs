//! Share of the searched image above the segment threshold: a laser line covers a few percent of it.
//!
//! If a bright room is above the threshold, the longest candidate of each cross-section is the room, and the centreline
//! is meaningless. The share reveals this without looking at the points.

use super::{
    channel::{AnyPlane, Plane},
    params::{Background, ExtractionParams, Threshold},
};

/// A larger share of the searched pixels is not a line, even in a narrow region of interest: a line 12 px wide covers
/// 30 % of 40 rows.
pub const LARGEST_SHARE: f64 = 0.3;
/// The grid has `SIDE` columns and `SIDE` rows. At [`LARGEST_SHARE`], one standard deviation of the share is 1.4 %.
const SIDE: usize = 32;

/// Share of the pixels above a fixed segment threshold, from 0 to 1, from a grid of 32 x 32 pixels, or of all in a smaller
/// plane. `full_scale` is the level of a saturated sample, to which the threshold is scaled. `None` where the threshold is
/// not one of the image's grey levels: adaptive, or above a background.
pub(super) fn share_above_threshold(
    plane: &AnyPlane<'_>,
    params: &ExtractionParams,
    full_scale: u32,
) -> Option<f64> {
    if params.threshold != Threshold::Fixed || params.background != Background::None {
        return None;
    }
    let threshold = params.segment_threshold * f64::from(full_scale) / 255.0;
    Some(match plane {
        AnyPlane::Eight(plane) => share(plane, threshold),
        AnyPlane::Sixteen(plane) => share(plane, threshold),
    })
}

fn share<S: Copy + Into<u32>>(plane: &Plane<'_, S>, threshold: f64) -> f64 {
    let (columns, rows) = (SIDE.min(plane.width), SIDE.min(plane.height));
    // The middle of each of `count` equal parts of `length`.
    let place = |i: usize, count: usize, length: usize| (2 * i + 1) * length / (2 * count);
    let is_above = |&(row, column): &(usize, usize)| {
        let level: u32 = plane.samples[row * plane.stride + column].into();
        f64::from(level) > threshold
    };
    let pixels = (0..rows).flat_map(|j| {
        let row = place(j, rows, plane.height);
        (0..columns).map(move |i| (row, place(i, columns, plane.width)))
    });
    pixels.filter(is_above).count() as f64 / (columns * rows).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of a plane 300 x 200 whose columns below `bright` are at 36, those from there on at 35.
    fn share_of(bright: usize, params: &ExtractionParams) -> Option<f64> {
        let samples: Vec<u8> = (0..300 * 200).map(|i| 35 + u8::from(i % 300 < bright)).collect();
        let plane = Plane { width: 300, height: 200, stride: 300, samples: &samples };
        share_above_threshold(&AnyPlane::Eight(plane), params, 255)
    }

    #[test]
    fn pixels_above_the_threshold_are_counted() {
        let params = ExtractionParams::default();
        assert_eq!(share_of(0, &params), Some(0.0));
        assert_eq!(share_of(300, &params), Some(1.0));
        let third = share_of(100, &params).unwrap();
        assert!((third - 1.0 / 3.0).abs() < 1.0 / 32.0, "{third}");
    }

    #[test]
    fn a_small_plane_is_counted_whole_and_its_padding_not_at_all() {
        let samples = [1000_u16, 9000, 9000, 9000, 1000, 9000];
        let plane = Plane { width: 2, height: 2, stride: 3, samples: &samples };
        let share = |full_scale| {
            let plane = AnyPlane::Sixteen(plane);
            share_above_threshold(&plane, &ExtractionParams::default(), full_scale)
        };
        assert_eq!(share(65_535), Some(0.5), "35 of 255 is 8995 of 65535");
        assert_eq!(share(4095), Some(1.0));
        let none = Plane { width: 0, height: 0, stride: 0, samples: &samples[..0] };
        let params = ExtractionParams::default();
        assert_eq!(share_above_threshold(&AnyPlane::Sixteen(none), &params, 255), Some(0.0));
    }

    #[test]
    fn a_threshold_that_follows_the_scene_is_not_judged() {
        let adaptive =
            ExtractionParams { threshold: Threshold::Adaptive, ..ExtractionParams::default() };
        assert_eq!(share_of(300, &adaptive), None);
        let local =
            ExtractionParams { background: Background::Local, ..ExtractionParams::default() };
        assert_eq!(share_of(300, &local), None);
    }
}
