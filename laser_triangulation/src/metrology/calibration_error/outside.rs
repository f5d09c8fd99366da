//! Points that lie outside the volume from which the calibration has data.

use nalgebra::{Isometry3, Matrix3, Point2, Vector3};

use super::rig::Rig;
use crate::{
    metrology::surface::Surface,
    scanner::{calibration::Calibration, params::StripeDirection},
};

/// Returns the number of points of a surface that lie outside the calibrated volume; `None` if the calibration does not
/// state it. `positions` are those of the rows, in the unit of the axis; if there are none, y is the position.
#[must_use]
pub fn num_outside(
    calibration: &Calibration,
    direction: StripeDirection,
    surface: &Surface,
    positions: &[f64],
) -> Option<u64> {
    let bounds = calibration.bounds(direction)?;
    let lens = Lens::new(calibration, direction)?;
    let mut num = 0;
    for (number, row) in surface.rows().enumerate() {
        let laser_from_part = lens.laser_from_part(positions.get(number).copied());
        let outside = row.iter().filter(|point| point.z.is_finite()).filter(|point| {
            let in_laser = laser_from_part * *point;
            let at_m = [in_laser.x, in_laser.z];
            !lens.seen(at_m).is_some_and(|place_px| bounds.contain(place_px, at_m))
        });
        num += outside.count() as u64;
    }
    Some(num)
}

/// The map from points of the laser plane to the image.
struct Lens<'a> {
    calibration: &'a Calibration,
    direction: StripeDirection,
    /// From metres to pixels, of a homography.
    inverse: Matrix3<f64>,
    rig: Option<Rig>,
}

impl<'a> Lens<'a> {
    /// `None` if a homography has no inverse.
    fn new(calibration: &'a Calibration, direction: StripeDirection) -> Option<Self> {
        let inverse = match calibration {
            Calibration::Projective(map) => {
                Matrix3::from_row_slice(&map.homography).try_inverse()?
            }
            _ => Matrix3::identity(),
        };
        let rig = match calibration {
            Calibration::CameraAndPlane(geometry) => Some(Rig::new(geometry, direction)),
            _ => None,
        };
        Some(Self { calibration, direction, inverse, rig })
    }

    /// Returns the pose of the part in the laser plane's frame; without a position, y stays.
    fn laser_from_part(&self, position: Option<f64>) -> Isometry3<f64> {
        self.rig.as_ref().map_or_else(Isometry3::identity, |rig| rig.laser_from_part(position))
    }

    /// Returns the place (along, across) in pixels of x and z in the laser plane's frame.
    fn seen(&self, at_m: [f64; 2]) -> Option<[f64; 2]> {
        let [x_m, z_m] = at_m;
        if let Calibration::VerticalIncidence(geometry) = self.calibration {
            return geometry.project(x_m, z_m).map(|(along_px, across_px)| [along_px, across_px]);
        }
        let pixel = match &self.rig {
            Some(rig) => rig.seen(at_m)?,
            None => Point2::from_homogeneous(self.inverse * Vector3::new(x_m, z_m, 1.0))?,
        };
        Some(match self.direction {
            StripeDirection::Horizontal => [pixel.x, pixel.y],
            StripeDirection::Vertical => [pixel.y, pixel.x],
        })
    }
}

#[cfg(test)]
mod tests;
