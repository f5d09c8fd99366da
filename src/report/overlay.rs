//! A centreline over its image, as SVG lines in image pixels.

use askama::Template;

use crate::msg::laser_profiler_msgs::Centerline;

/// One frame on a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Overlay {
    /// Number of the frame in the recording, from 0.
    pub(crate) frame: u64,
    /// Stamp, nanoseconds.
    pub(crate) stamp_ns: i64,
    /// Time of reception of its image, nanoseconds.
    pub(crate) received_ns: i64,
    /// Columns and rows of the image.
    pub(crate) size_px: [u32; 2],
    /// Number of points.
    pub(crate) num_points: usize,
    /// The image as `data:` address; empty without one.
    pub(crate) image: String,
    /// Reduction factor of the image; 1: full size.
    pub(crate) reduction: usize,
    /// Points of each connected stripe: `u,v u,v …`.
    pub(crate) lines: Vec<String>,
}

impl Overlay {
    /// Creates a frame without its image.
    #[must_use]
    pub(crate) fn new(frame: u64, line: &Centerline<'_>) -> Self {
        Self {
            frame,
            stamp_ns: line.header.stamp.to_ns(),
            received_ns: line.trace.receive_stamp.to_ns(),
            size_px: [line.image_width, line.image_height],
            num_points: line.u.len(),
            image: String::new(),
            reduction: 1,
            lines: lines(line),
        }
    }

    /// Returns the frame as SVG text.
    ///
    /// # Errors
    /// Errors of the template; none are expected.
    pub(crate) fn svg(&self) -> Result<String, askama::Error> {
        Picture { overlay: self }.render()
    }
}

#[derive(Template)]
#[template(path = "frame.svg", escape = "html")]
struct Picture<'a> {
    overlay: &'a Overlay,
}

/// Returns one line per connected stripe. A single point becomes a line of a tenth of a pixel.
fn lines(line: &Centerline<'_>) -> Vec<String> {
    let num = line.u.len().min(line.v.len());
    let starts = line.stripe_start.iter().map(|start| (*start as usize).min(num));
    let ends = starts.clone().skip(1).chain([num]);
    let strip = |(start, end): (usize, usize)| {
        let place = |at: usize| format!("{},{:.3}", line.u[at], line.v[at]);
        let mut places: Vec<String> = (start..end.max(start)).map(place).collect();
        if end == start + 1 {
            places.push(format!("{:.1},{:.3}", line.u[start] + 0.1, line.v[start]));
        }
        places.join(" ")
    };
    starts.zip(ends).map(strip).filter(|text| !text.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stripe_is_its_own_line_and_false_starts_are_ignored() {
        let line = Centerline {
            u: vec![0.0, 1.0, 5.0].into(),
            v: vec![2.0, 2.5, 7.0].into(),
            stripe_start: vec![0, 2].into(),
            ..Centerline::default()
        };
        let overlay = Overlay::new(4, &line);
        assert_eq!(overlay.lines, ["0,2.000 1,2.500", "5,7.000 5.1,7.000"]);
        assert_eq!((overlay.frame, overlay.num_points), (4, 3));
        let lying = Centerline { stripe_start: vec![0, 9, 1].into(), ..line };
        assert_eq!(Overlay::new(0, &lying).lines[0], "0,2.000 1,2.500 5,7.000");
        assert!(Overlay::new(0, &Centerline::default()).lines.is_empty());
    }
}
