//! Places on the plane z = 1, before and after the lens bends the light.

use nalgebra::Point2;

/// Place on the plane z = 1 where a ray in front of the lens meets it: x/z and y/z of each of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UndistortedPoint(pub Point2<f64>);

/// Place on the plane z = 1 where a ray appears through the lens, before tilt and K.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistortedPoint(pub Point2<f64>);
