//! Step 9 of Yao et al. 2023: from pixels to metres. Holds measured values; the only place that chooses a camera model.

mod bow;
mod camera_and_plane;
mod camera_calibration;
mod equivalent;
mod file;
mod height_sigma;
mod lines;
mod principal_axes;
mod projective;
mod quality;
mod shifted;
mod triangulator;
mod vertical_incidence;
mod volume;

use thiserror::Error;

use super::{
    axis::Axis, camera::View, params::StripeDirection, profile::Profile, stripe::Centerline,
};
use lines::Source;

pub use bow::Bow;
pub(crate) use bow::Deviation;
pub use camera_and_plane::{Alignment, CameraAndPlane, PartPose};
pub use camera_calibration::CameraCalibration;
pub use lines::Lines;
pub(crate) use principal_axes::axes;
pub use projective::Projective;
pub use quality::{AxisQuality, CameraQuality, PlaneQuality, StepsQuality};
pub use triangulator::Triangulator;
pub use vertical_incidence::{Height, VerticalIncidence};
pub use volume::CalibratedVolume;
pub(crate) use volume::{Bounds, range};

/// A calibration: maps image points to points of the laser plane.
#[derive(Clone, Debug, PartialEq)]
pub enum Calibration {
    /// Laser at right angles onto the base plane, camera inclined.
    VerticalIncidence(VerticalIncidence),
    /// A calibrated camera and a laser plane in any pose in front of it.
    CameraAndPlane(Box<CameraAndPlane>),
    /// The image of the laser plane as a homography.
    Projective(Box<Projective>),
}

/// Reason to reject a calibration file.
#[derive(Debug, Error)]
pub enum CalibrationError {
    /// Not the YAML of a calibration; key, line and remedy.
    #[error("not a calibration: {0}")]
    Syntax(String),
    /// A value outside its range.
    #[error("{key} is {value}, allowed is {allowed}")]
    Value {
        /// Name of the entry.
        key: &'static str,
        /// Its value.
        value: String,
        /// Allowed values.
        allowed: &'static str,
    },
    /// A camera file of another program that cannot be read.
    #[error("{kind}: {problem}")]
    Foreign {
        /// The kind of file.
        kind: &'static str,
        /// The fault and the remedy.
        problem: String,
    },
    /// Camera only: a profile needs the plane of light too.
    #[error(
        "it is {kind}: a camera without a laser plane. Run `laser_profiler calibrate plane PICTURES --target \
         checkerboard:COLUMNSxROWS:SQUARE --camera FILE -o rig.yaml` with this file as FILE, and use rig.yaml"
    )]
    CameraOnly {
        /// The kind of file.
        kind: &'static str,
    },
    /// The values were edited after the file was written.
    #[error(
        "id is {stated}, but these values have id {actual}: the file was edited; calibrate again, or remove the line \
         to accept the edit"
    )]
    Edited {
        /// `id` in the file.
        stated: String,
        /// `id` of its values.
        actual: String,
    },
}

impl CalibrationError {
    fn value(key: &'static str, value: impl Into<String>, allowed: &'static str) -> Self {
        Self::Value { key, value: value.into(), allowed }
    }
}

impl Calibration {
    /// Reads and checks a calibration file's text. `type` selects the geometry: `vertical_incidence` as below,
    /// `camera_and_plane` or `projective`. The last two are results of the calibration from pictures.
    ///
    /// ```
    /// use laser_triangulation::scanner::calibration::Calibration;
    ///
    /// let calibration = Calibration::from_yaml("
    /// type: vertical_incidence
    /// frame_id: laser_plane            # frame of the profiles
    /// image_distance_m: 0.026          # metres: lens centre to image
    /// object_distance_m: 0.300         # metres: base point, on the table under the stripe, to lens centre
    /// beta_rad: 0.5235987755982988     # radians, between 0 and pi/2: laser plane to optical axis
    /// pixel_pitch_m: 4.8e-6            # metres: distance of neighbouring pixels on the sensor
    /// base_row_px: 1024.0              # pixels: row of the stripe on the empty table (column, if vertical)
    /// center_column_px: 1295.5         # pixels: column of the optical axis (row, if vertical)
    /// height_sign: -1                  # -1: a higher surface moves the stripe to smaller rows; 1: to larger rows
    /// ")?;
    /// let Calibration::VerticalIncidence(geometry) = &calibration else { panic!() };
    /// assert_eq!(geometry.height(1024.0).map(|height| height.z_m), Some(0.0));
    /// // 10 pixels higher in the image are about 1.1 mm of height.
    /// let z_m = geometry.height(1014.0).unwrap().z_m;
    /// assert!((z_m - 0.0011).abs() < 5e-5);
    /// # Ok::<(), laser_triangulation::scanner::calibration::CalibrationError>(())
    /// ```
    ///
    /// # Errors
    /// Unknown or missing keys, wrong types, values outside their range, or an `id` that does not match the values. The
    /// error names the key.
    pub fn from_yaml(text: &str) -> Result<Self, CalibrationError> {
        file::read(text)
    }

    /// Returns the calibration file's text; [`from_yaml`](Self::from_yaml) returns an equal calibration.
    pub fn to_yaml(&self) -> String {
        file::write(self)
    }

    /// Returns the axis that moves the part, if calibrated.
    pub const fn axis(&self) -> Option<&Axis> {
        match self {
            Self::CameraAndPlane(geometry) => geometry.axis.as_ref(),
            Self::VerticalIncidence(_) | Self::Projective(_) => None,
        }
    }

    /// Returns the part's frame, if defined by a flat.
    pub const fn part(&self) -> Option<&PartPose> {
        match self {
            Self::CameraAndPlane(geometry) => geometry.part.as_ref(),
            Self::VerticalIncidence(_) | Self::Projective(_) => None,
        }
    }

    /// Returns the frame of the profiles.
    pub fn frame_id(&self) -> &str {
        match self {
            Self::VerticalIncidence(geometry) => &geometry.frame_id,
            Self::CameraAndPlane(geometry) => &geometry.frame_id,
            Self::Projective(geometry) => &geometry.frame_id,
        }
    }

    /// Returns sixteen hexadecimal digits that are equal for equal calibrations: the start of the SHA-256 of all values
    /// except quality and date.
    pub fn id(&self) -> String {
        match self {
            Self::VerticalIncidence(geometry) => geometry.id(),
            Self::CameraAndPlane(geometry) => geometry.id(),
            Self::Projective(geometry) => geometry.id(),
        }
    }

    /// Returns columns and rows of the calibrated images; `None` if unknown.
    pub fn image_size_px(&self) -> Option<(u32, u32)> {
        match self {
            Self::VerticalIncidence(_) => None,
            Self::CameraAndPlane(geometry) => {
                Some((geometry.camera.width_px, geometry.camera.height_px))
            }
            Self::Projective(geometry) => Some((geometry.width_px, geometry.height_px)),
        }
    }

    /// Returns the same calibration for images of a part of the sensor. Formula 6 states no size and is returned
    /// unchanged: it applies to the images with which it was measured.
    #[must_use]
    pub fn seen_through(&self, view: &View) -> Self {
        match self {
            Self::VerticalIncidence(_) => self.clone(),
            Self::CameraAndPlane(geometry) => {
                let camera = geometry.camera.seen_through(view);
                let seen = CameraAndPlane { camera, ..(**geometry).clone() };
                Self::CameraAndPlane(Box::new(seen.with_quality_seen_through(view)))
            }
            Self::Projective(geometry) => Self::Projective(Box::new(geometry.seen_through(view))),
        }
    }

    /// Step 9: replaces `profile` by the centreline in metres, one entry per searched line. A point that the geometry
    /// cannot place, or that lies outside `lines`, counts as not measured; one outside the calibrated volume is flagged.
    /// `full_scale` is the level of a saturated sample. `calibration_sigma_z_m` stays empty: [`Triangulator`] states it.
    pub fn triangulate(
        &self,
        centerline: &Centerline,
        lines: &Lines,
        full_scale: u32,
        profile: &mut Profile,
    ) {
        self.fill(&Source { centerline, lines: *lines, full_scale, sigma: None }, profile);
    }

    fn fill(&self, source: &Source<'_>, profile: &mut Profile) {
        let direction = source.lines.direction;
        let bounds = self.bounds(direction);
        let checked = |point, along_px, across_px| {
            Some(Bounds::flag(bounds.as_ref(), [along_px, across_px], point?))
        };
        match self {
            Self::VerticalIncidence(geometry) => {
                source.fill(profile, |along_px, across_px| {
                    checked(geometry.place(along_px, across_px), along_px, across_px)
                });
            }
            Self::CameraAndPlane(geometry) => {
                let mut cuts = geometry.cuts(direction);
                source.fill(profile, |along_px, across_px| {
                    checked(cuts.place(along_px, across_px), along_px, across_px)
                });
            }
            Self::Projective(geometry) => {
                source.fill(profile, |along_px, across_px| {
                    let point = geometry.place(direction, along_px, across_px);
                    checked(point, along_px, across_px)
                });
            }
        }
    }

    /// Returns x and z of each place (along, across) in pixels, metres; NaN where the geometry has none. Places beside one
    /// another are found faster.
    fn points_m(
        &self,
        direction: StripeDirection,
        places_px: impl Iterator<Item = [f64; 2]>,
    ) -> impl Iterator<Item = [f64; 2]> {
        let mut cuts = match self {
            Self::CameraAndPlane(geometry) => Some(geometry.cuts(direction)),
            Self::VerticalIncidence(_) | Self::Projective(_) => None,
        };
        places_px.map(move |[along_px, across_px]| {
            let point = match self {
                Self::VerticalIncidence(geometry) => geometry.place(along_px, across_px),
                Self::CameraAndPlane(_) => {
                    cuts.as_mut().and_then(|cuts| cuts.place(along_px, across_px))
                }
                Self::Projective(geometry) => geometry.place(direction, along_px, across_px),
            };
            point.map_or([f64::NAN; 2], |point| [point.x_m, point.z_m])
        })
    }
}

/// A point of the laser plane and its derivative with respect to the image position across the stripe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedPoint {
    /// Along the stripe, metres.
    pub(crate) x_m: f64,
    /// Height, metres.
    pub(crate) z_m: f64,
    /// dx/d(pixel across the stripe), metres a pixel.
    pub(crate) x_m_per_px: f64,
    /// dz/d(pixel across the stripe), metres a pixel.
    pub(crate) z_m_per_px: f64,
    /// Flags that the calibration adds to those of the centre.
    pub(crate) flags: u8,
}

#[cfg(test)]
pub(super) mod tests;
