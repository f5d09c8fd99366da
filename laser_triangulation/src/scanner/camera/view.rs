//! The part of a sensor that an image shows, and its binning.

use nalgebra::Point2;

use super::Camera;

/// The sensor pixels that make up an image: first a part is cut out, then pixels are binned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct View {
    /// First column and row of the part, in pixels of the sensor.
    pub offset_px: [u32; 2],
    /// Columns and rows of the image.
    pub size_px: [u32; 2],
    /// Sensor columns and rows per pixel of the image; at least 1.
    pub binning: [u32; 2],
}

impl View {
    /// Returns the view of a whole sensor.
    pub const fn whole(size_px: [u32; 2]) -> Self {
        Self { offset_px: [0, 0], size_px, binning: [1, 1] }
    }

    /// Returns the position on the sensor of the centre of an image pixel. The centre of a binned pixel is the middle
    /// of its sensor pixels: `sensor = binning · image + (binning - 1) / 2 + offset`.
    pub(crate) fn on_sensor(&self, image: Point2<f64>) -> Point2<f64> {
        Point2::from([0, 1].map(|axis| {
            let binning = f64::from(self.binning[axis]);
            binning * image[axis] + 0.5 * (binning - 1.0) + f64::from(self.offset_px[axis])
        }))
    }
}

impl Camera {
    /// Returns the camera for such images: the principal point is shifted, and focal lengths are in larger pixels.
    #[must_use]
    pub(crate) fn seen_through(&self, view: &View) -> Self {
        let shift = view.on_sensor(Point2::origin());
        let [bx, by] = view.binning.map(f64::from);
        Self {
            width_px: view.size_px[0],
            height_px: view.size_px[1],
            fx_px: self.fx_px / bx,
            fy_px: self.fy_px / by,
            cx_px: (self.cx_px - shift.x) / bx,
            cy_px: (self.cy_px - shift.y) / by,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;
    use crate::scanner::camera::{DistortedPixel, Distortion};

    proptest! {
        /// A point is seen where the sensor sees it.
        #[test]
        fn an_image_of_a_part_is_that_part(
            x in -0.2..0.2_f64, y in -0.2..0.2_f64, offset_px in prop::array::uniform2(0..200_u32),
            binning in prop::array::uniform2(1..5_u32),
        ) {
            let sensor = Camera {
                width_px: 640,
                height_px: 480,
                fx_px: 700.0,
                fy_px: 690.0,
                cx_px: 330.0,
                cy_px: 236.0,
                distortion: Distortion::PlumbBob { k1: -0.2, k2: 0.1, p1: 0.001, p2: 0.002, k3: 0.0 },
                tilt_rad: [0.05, 0.02],
            };
            let view = View { offset_px, size_px: [100, 50], binning };
            let point = Point3::new(x, y, 1.0);
            let DistortedPixel(seen) = sensor.seen_through(&view).project(point).unwrap();
            let DistortedPixel(on_sensor) = sensor.project(point).unwrap();
            prop_assert!((view.on_sensor(seen) - on_sensor).norm() < 1e-9);
        }
    }

    /// Two pixels in one: the first pixel of the image has its centre between them.
    #[test]
    fn a_pixel_of_four_is_where_their_middle_is() {
        let view = View { offset_px: [10, 20], size_px: [4, 4], binning: [2, 2] };
        assert_eq!(view.on_sensor(Point2::new(0.0, 1.0)), Point2::new(10.5, 22.5));
        let whole = View::whole([4, 4]);
        assert_eq!(whole.on_sensor(Point2::new(3.0, 2.0)), Point2::new(3.0, 2.0));
    }
}
