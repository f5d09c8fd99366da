//! The identity of a calibration: equal for equal calibrations.

use sha2::{Digest, Sha256};

use crate::scanner::{
    axis::{Axis, AxisKind},
    camera::Camera,
};

/// The SHA-256 of a calibration's values, under construction.
pub(in crate::scanner::calibration) struct Id(Sha256);

impl Id {
    pub(in crate::scanner::calibration) fn new(kind: &str) -> Self {
        Self(Sha256::new()).text(kind).text("\0")
    }

    pub(in crate::scanner::calibration) fn text(mut self, text: &str) -> Self {
        self.0.update(text.as_bytes());
        self
    }

    pub(in crate::scanner::calibration) fn numbers(
        mut self,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        for value in values {
            self.0.update(value.to_le_bytes());
        }
        self
    }

    pub(in crate::scanner::calibration) fn camera(self, camera: &Camera) -> Self {
        self.numbers([f64::from(camera.width_px), f64::from(camera.height_px)])
            .numbers([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
            .text(camera.distortion.name())
            .numbers(camera.distortion.coefficients())
            .numbers(camera.tilt_rad)
    }

    pub(in crate::scanner::calibration) fn axis(self, axis: &Axis) -> Self {
        let kind = self.text("axis").text(axis.kind.name());
        let placed = match axis.kind {
            AxisKind::Prismatic => kind,
            AxisKind::Revolute => kind.numbers(axis.point_m.iter().copied()),
        };
        placed.numbers(axis.direction.iter().copied()).numbers([axis.scale])
    }

    /// Returns sixteen hexadecimal digits.
    pub(in crate::scanner::calibration) fn finish(self) -> String {
        self.0.finalize()[..8].iter().fold(String::new(), |id, byte| id + &format!("{byte:02x}"))
    }
}
