//! The volume from which a calibration has data: beyond it the stated uncertainty is an extrapolation.

use nalgebra::{Isometry3, Point2};
use serde::{Deserialize, Serialize};

use super::{Calibration, CalibrationError, CameraAndPlane, PlacedPoint};
use crate::scanner::{camera::View, params::StripeDirection, stripe::flag};

/// Share of its extent by which a volume is exceeded before a point counts as outside: surfaces at the limits scatter.
const MARGIN: f64 = 0.05;

/// The part of the image, and the heights or depths, from which a calibration has data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedVolume {
    /// First and last column, pixels of the sensor.
    pub columns_px: [f64; 2],
    /// First and last row, pixels of the sensor.
    pub rows_px: [f64; 2],
    /// Lowest and highest z of the profiles, metres; `None`: not limited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights_m: Option<[f64; 2]>,
    /// Nearest and farthest depth along the optical axis, metres; `None`: not limited. Only with a laser plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depths_m: Option<[f64; 2]>,
}

impl CalibratedVolume {
    /// Returns the part of the image that holds all positions (column, row), without limits of height or depth; `None`
    /// if there are none.
    #[must_use]
    pub(crate) fn of_positions(positions: impl IntoIterator<Item = Point2<f64>>) -> Option<Self> {
        let positions: Vec<_> = positions.into_iter().collect();
        let columns_px = range(positions.iter().map(|position| position.x))?;
        let rows_px = range(positions.iter().map(|position| position.y))?;
        Some(Self { columns_px, rows_px, heights_m: None, depths_m: None })
    }

    /// Returns the volume in the pixels of an image that shows a part of the sensor.
    pub(super) fn seen_through(&self, view: &View) -> Self {
        let shift = view.on_sensor(Point2::origin());
        let seen = |limits: [f64; 2], axis: usize| {
            limits.map(|px| (px - shift[axis]) / f64::from(view.binning[axis]))
        };
        Self { columns_px: seen(self.columns_px, 0), rows_px: seen(self.rows_px, 1), ..*self }
    }

    /// Checks the limits; `key` names the entry of the file.
    pub(super) fn check(volume: Option<&Self>, key: &'static str) -> Result<(), CalibrationError> {
        let Some(volume) = volume else { return Ok(()) };
        let Self { columns_px, rows_px, heights_m, depths_m } = volume;
        let all = [Some(columns_px), Some(rows_px), heights_m.as_ref(), depths_m.as_ref()];
        let is_range = |[from, to]: &[f64; 2]| from.is_finite() && to.is_finite() && from <= to;
        if all.into_iter().flatten().all(is_range) {
            return Ok(());
        }
        let allowed = "pairs of finite numbers, the smaller one first";
        Err(CalibrationError::value(key, format!("{volume:?}"), allowed))
    }
}

/// Returns the smallest and the largest value; `None` without values.
pub(crate) fn range(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    let widened = |range: Option<[f64; 2]>, value: f64| {
        let [from, to] = range.unwrap_or([value; 2]);
        Some([from.min(value), to.max(value)])
    };
    values.into_iter().fold(None, widened)
}

/// The limits of a calibrated volume for one direction of the stripe, with their margins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    along_px: [f64; 2],
    across_px: [f64; 2],
    height_m: [f64; 2],
    depth_m: [f64; 2],
    /// Depth of the profile's origin, and its derivatives by x and z.
    depth_of: [f64; 3],
}

impl Bounds {
    /// The image, heights and depths without limits.
    const ALL: Self = Self {
        along_px: EVERYWHERE,
        across_px: EVERYWHERE,
        height_m: EVERYWHERE,
        depth_m: EVERYWHERE,
        depth_of: [0.0; 3],
    };

    /// Returns true if a point of the laser plane, seen at (along, across) in pixels, lies in the volume.
    pub(crate) fn contain(&self, [along_px, across_px]: [f64; 2], [x_m, z_m]: [f64; 2]) -> bool {
        let [depth_m, by_x, by_z] = self.depth_of;
        let depth_m = depth_m + by_x * x_m + by_z * z_m;
        let is_in = |value: f64, [from, to]: [f64; 2]| from <= value && value <= to;
        is_in(along_px, self.along_px)
            && is_in(across_px, self.across_px)
            && is_in(z_m, self.height_m)
            && is_in(depth_m, self.depth_m)
    }

    /// Returns the point, flagged if it lies outside.
    pub(super) fn flag(
        bounds: Option<&Self>,
        place_px: [f64; 2],
        point: PlacedPoint,
    ) -> PlacedPoint {
        match bounds {
            Some(bounds) if !bounds.contain(place_px, [point.x_m, point.z_m]) => {
                PlacedPoint { flags: flag::OUTSIDE_CALIBRATION, ..point }
            }
            _ => point,
        }
    }

    fn within(self, volume: Option<&CalibratedVolume>, direction: StripeDirection) -> Self {
        let Some(volume) = volume else { return self };
        let (along_px, across_px) = match direction {
            StripeDirection::Horizontal => (volume.columns_px, volume.rows_px),
            StripeDirection::Vertical => (volume.rows_px, volume.columns_px),
        };
        let height_m = volume.heights_m.map_or(EVERYWHERE, widened);
        let depth_m = volume.depths_m.map_or(EVERYWHERE, widened);
        Self {
            along_px: common(self.along_px, widened(along_px)),
            across_px: common(self.across_px, widened(across_px)),
            height_m: common(self.height_m, height_m),
            depth_m: common(self.depth_m, depth_m),
            ..self
        }
    }
}

const EVERYWHERE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

fn widened([from, to]: [f64; 2]) -> [f64; 2] {
    let margin = MARGIN * (to - from);
    [from - margin, to + margin]
}

fn common(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].max(b[0]), a[1].min(b[1])]
}

impl Calibration {
    /// Returns the volume from which the calibration has data; of camera and laser plane, that of each, if known. Empty
    /// if unknown, as in files of older versions or written by hand.
    pub fn volumes(&self) -> impl Iterator<Item = &CalibratedVolume> {
        let both = match self {
            Self::VerticalIncidence(geometry) => [geometry.volume(), None],
            Self::Projective(geometry) => [geometry.volume(), None],
            Self::CameraAndPlane(geometry) => geometry.volumes(),
        };
        both.into_iter().flatten()
    }

    /// Returns the limits of the volume; `None` if it is unknown.
    pub(crate) fn bounds(&self, direction: StripeDirection) -> Option<Bounds> {
        self.volumes().next()?;
        let unlimited = match self {
            Self::CameraAndPlane(geometry) => {
                let pose: Isometry3<f64> = geometry.camera_from_laser(direction);
                let to_depth = pose.rotation.to_rotation_matrix();
                let depth_of = [pose.translation.z, to_depth[(2, 0)], to_depth[(2, 2)]];
                Bounds { depth_of, ..Bounds::ALL }
            }
            Self::VerticalIncidence(_) | Self::Projective(_) => Bounds::ALL,
        };
        let within = |bounds: Bounds, volume| bounds.within(Some(volume), direction);
        Some(self.volumes().fold(unlimited, within))
    }
}

impl CameraAndPlane {
    /// Returns the volume of the camera and that of the plane.
    pub(super) fn volumes(&self) -> [Option<&CalibratedVolume>; 2] {
        let of_camera = self.camera_quality.as_ref().and_then(|quality| quality.volume.as_ref());
        let of_plane = self.plane_quality.as_ref().and_then(|quality| quality.volume.as_ref());
        [of_camera, of_plane]
    }
}
