//! The centreline as annotations of its image.

use crate::{
    msg::{
        builtin_interfaces::Time,
        foxglove_msgs::{Color, ImageAnnotations, Point2, PointsAnnotation},
    },
    scanner::stripe::Centerline,
};

/// Green: contrasts with red and white stripes and with grey.
const LINE_COLOR: Color = Color { r: 0.1, g: 1.0, b: 0.2, a: 1.0 };
const LINE_THICKNESS_PX: f64 = 1.0;
/// Offset from pixel centres at integers to an origin at the corner of the top-left pixel.
const CENTER_FROM_CORNER_PX: f64 = 0.5;

/// Replaces the lines of `annotations` by a centreline: one line per connected stripe, none across gaps.
///
/// Reuses the memory of the lines.
pub(crate) fn draw(stamp: Time, line: &Centerline, annotations: &mut ImageAnnotations<'_>) {
    annotations.points.resize_with(line.stripe_start.len(), PointsAnnotation::default);
    let ends = line.stripe_start.iter().skip(1).map(|&start| start as usize).chain([line.len()]);
    for ((strip, &start), end) in annotations.points.iter_mut().zip(&line.stripe_start).zip(ends) {
        let start = start as usize;
        strip.timestamp = stamp;
        strip.r#type = PointsAnnotation::LINE_STRIP;
        strip.outline_color = LINE_COLOR;
        strip.thickness = LINE_THICKNESS_PX;
        strip.points.clear();
        let points = line.u_px.iter().zip(&line.v_px).take(end).skip(start);
        strip.points.extend(points.map(|(&u, &v)| Point2 {
            x: f64::from(u) + CENTER_FROM_CORNER_PX,
            y: f64::from(v) + CENTER_FROM_CORNER_PX,
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(strip: &PointsAnnotation) -> Vec<(f64, f64)> {
        strip.points.iter().map(|point| (point.x, point.y)).collect()
    }

    #[test]
    fn every_stripe_is_a_separate_line() {
        let line = Centerline {
            u_px: vec![0.0, 1.0, 5.0, 6.0, 7.0],
            v_px: vec![10.0, 10.25, 20.0, 20.5, 21.0],
            stripe_start: vec![0, 2],
            ..Centerline::default()
        };
        let stamp = Time { sec: 3, nanosec: 4 };
        let mut annotations = ImageAnnotations::default();
        draw(stamp, &line, &mut annotations);
        let [first, second] = &annotations.points[..] else { panic!("{annotations:?}") };
        assert_eq!(points(first), [(0.5, 10.5), (1.5, 10.75)]);
        assert_eq!(points(second), [(5.5, 20.5), (6.5, 21.0), (7.5, 21.5)]);
        for strip in [first, second] {
            assert_eq!((strip.timestamp, strip.r#type), (stamp, PointsAnnotation::LINE_STRIP));
            assert!(strip.thickness > 0.0 && strip.outline_color.a > 0.0);
            assert!(strip.fill_color.a == 0.0, "a filled stripe would hide the image");
        }
        draw(stamp, &Centerline::default(), &mut annotations);
        assert_eq!(annotations.points, [], "lines of an earlier frame must go");
    }
}
