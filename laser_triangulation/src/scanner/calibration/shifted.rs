//! The calibrations that are off by one standard deviation: the model of a calibration's error that measuring tools and
//! profiles share.

use nalgebra::Matrix3;

use super::{Calibration, CameraAndPlane, Projective, VerticalIncidence, axes};

impl Calibration {
    /// Returns the calibration shifted by one standard deviation along each of its independent directions, the principal
    /// axes of its covariance. Their effects on any result add in quadrature. The axis follows the camera; its own error is
    /// left out, because it moves no point within the laser plane.
    ///
    /// # Errors
    /// The file states no covariance.
    pub(crate) fn shifted(&self) -> Result<Vec<Self>, &'static str> {
        Ok(match self {
            Self::VerticalIncidence(geometry) => {
                geometry.shifted()?.into_iter().map(Self::VerticalIncidence).collect()
            }
            Self::Projective(map) => {
                map.shifted()?.into_iter().map(|map| Self::Projective(Box::new(map))).collect()
            }
            Self::CameraAndPlane(geometry) => {
                let all = geometry.shifted()?.into_iter();
                all.map(|geometry| Self::CameraAndPlane(Box::new(geometry))).collect()
            }
        })
    }
}

impl VerticalIncidence {
    /// As [`Calibration::shifted`].
    pub(crate) fn shifted(&self) -> Result<Vec<Self>, &'static str> {
        let quality = self.quality.as_ref().filter(|quality| quality.covariance.len() == 16);
        let quality = quality.ok_or("the file states no covariance of a, b and β")?;
        let all = axes(4, &quality.covariance).into_iter();
        Ok(all.map(|axis| self.moved([axis[0], axis[1], axis[2], axis[3]])).collect())
    }
}

impl Projective {
    /// As [`Calibration::shifted`].
    pub(crate) fn shifted(&self) -> Result<Vec<Self>, &'static str> {
        let quality = self.quality.as_ref().filter(|quality| quality.covariance.len() == 81);
        let quality = quality.ok_or("the file states no covariance of its homography")?;
        let nominal = Matrix3::from_row_slice(&self.homography);
        let moved = |axis: Vec<f64>| {
            let other = nominal + Matrix3::from_row_slice(&axis);
            let homography = std::array::from_fn(|at| other[(at / 3, at % 3)]);
            Self { homography, ..self.clone() }
        };
        Ok(axes(9, &quality.covariance).into_iter().map(moved).collect())
    }
}

impl CameraAndPlane {
    /// As [`Calibration::shifted`]. Plane and axis follow the camera as the calibration states; where it does not, they
    /// are assumed independent of it. Without a covariance of the camera, its share is left out.
    pub(crate) fn shifted(&self) -> Result<Vec<Self>, &'static str> {
        let plane = self.plane_quality.as_ref().and_then(|quality| quality.covariance);
        let plane = plane.ok_or("the file states no covariance of its laser plane")?;
        let planes = axes(3, &plane).into_iter().map(|axis| {
            let plane = self.plane.moved([axis[0], axis[1], axis[2]]);
            Self { plane, ..self.clone() }
        });
        let mut all: Vec<_> = planes.collect();
        all.extend(self.with_other_cameras());
        Ok(all)
    }

    /// Returns the rigs whose camera is off by one standard deviation, each with the plane and the axis that this camera
    /// would have measured; none if the camera's covariance is unknown.
    fn with_other_cameras(&self) -> Vec<Self> {
        let stated = self.camera_quality.as_ref().filter(|quality| quality.has_covariance());
        let Some(quality) = stated else { return Vec::new() };
        let other = |by: Vec<f64>| {
            let mut camera = self.camera;
            for (name, by) in quality.parameters.iter().zip(&by) {
                if let Some(value) = camera.value_mut(name) {
                    *value += by;
                }
            }
            let (plane, axis) = (self.plane_seen_by(&by), self.axis_seen_by(&by));
            Self { camera, plane, axis, ..self.clone() }
        };
        axes(quality.parameters.len(), &quality.covariance).into_iter().map(other).collect()
    }
}
