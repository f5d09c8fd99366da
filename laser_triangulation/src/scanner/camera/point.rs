//! Places that a ray passes on its way to the image: on the plane z = 1 before and after the lens, and in the image.

use nalgebra::Point2;

/// Place on the plane z = 1 where a ray in front of the lens meets it: x/z and y/z of each of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UndistortedPoint(pub Point2<f64>);

/// Place on the plane z = 1 where a ray appears through the lens, before tilt and K.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistortedPoint(pub Point2<f64>);

/// Image position (column, row) as the camera records it, with distortion and tilt, pixels; (0, 0) is the centre of the
/// top-left pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistortedPixel(pub Point2<f64>);
