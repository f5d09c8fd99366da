//! The scale along the stripe, which heights alone do not determine, and the resulting calibration.

use super::{GaugePlateau, HeightModel, StepsCalibration, VerticalGeometry};
use crate::{
    calibrate::GaugePicture,
    scanner::{
        calibration::{Projective, StepsQuality, VerticalIncidence},
        params::StripeDirection,
    },
};

/// A known length along the stripe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KnownLateral {
    /// Length of a pixel at height 0 in the middle of the image, metres.
    PerPixel(f64),
    /// Width of every plateau between two others, metres.
    PlateauWidth(f64),
}

impl StepsCalibration {
    /// Returns the numerator of x per pixel along the stripe. A projective map divides it by the same denominator as
    /// the heights, taken here at height 0 in the middle of the image. `None` if a plateau width is known, but no
    /// plateau lies between two others.
    #[must_use]
    pub fn lateral_scale(
        &self,
        known: KnownLateral,
        plateaus: &[GaugePlateau],
        picture: &GaugePicture,
    ) -> Option<f64> {
        match known {
            KnownLateral::PerPixel(lateral_m) => {
                Some(lateral_m * denominator_at_base(&self.model, picture.middle_px()))
            }
            KnownLateral::PlateauWidth(width_m) => of_width(&self.model, plateaus, width_m),
        }
    }

    /// Returns the length of a pixel at height 0 in the middle of the image, metres.
    #[must_use]
    pub fn meters_per_pixel(&self, lateral_scale: f64, picture: &GaugePicture) -> f64 {
        (lateral_scale / denominator_at_base(&self.model, picture.middle_px())).abs()
    }

    /// Returns the calibration of a camera without distortion, without a date. `frame_id` names the frame of the profiles.
    #[must_use]
    pub fn projective(
        &self,
        picture: &GaugePicture,
        lateral_scale: f64,
        frame_id: &str,
    ) -> Projective {
        let of = |model: &HeightModel| homography(model, picture, lateral_scale);
        let covariance = self.model.propagated(of);
        Projective {
            frame_id: frame_id.to_owned(),
            width_px: picture.size_px[0],
            height_px: picture.size_px[1],
            homography: of(&self.model),
            quality: Some(self.quality(covariance.as_slice())),
            calibrated_at: None,
        }
    }

    /// Returns the calibration by formula 6 of Yao et al. 2023. `pixel_pitch_m` is the distance of pixels on the sensor.
    #[must_use]
    pub fn vertical_incidence(
        &self,
        geometry: &VerticalGeometry,
        pixel_pitch_m: f64,
        picture: &GaugePicture,
        frame_id: &str,
    ) -> VerticalIncidence {
        VerticalIncidence {
            frame_id: frame_id.to_owned(),
            image_distance_m: geometry.image_distance_m[0],
            object_distance_m: geometry.object_distance_m[0],
            beta_rad: geometry.beta_rad[0],
            pixel_pitch_m,
            base_row_px: geometry.base_px[0],
            center_column_px: picture.middle_px(),
            height_sign: geometry.height_sign,
            quality: Some(self.quality(geometry.covariance.as_slice())),
        }
    }

    /// A covariance that the heights do not determine is omitted.
    fn quality(&self, covariance: &[f64]) -> StepsQuality {
        let is_known = covariance.iter().all(|value| value.is_finite());
        StepsQuality {
            rms_m: self.rms_m,
            heights_used: self.checks.len() as u32,
            covariance: if is_known { covariance.to_vec() } else { Vec::new() },
        }
    }
}

/// Returns the numerator of x from plateaus of one known width.
fn of_width(model: &HeightModel, plateaus: &[GaugePlateau], width_m: f64) -> Option<f64> {
    let [_, w] = model.rows();
    let scales: Vec<f64> = plateaus
        .iter()
        .filter_map(|GaugePlateau { plateau, borders_px }| {
            // x / scale at both borders, each over its own denominator.
            let [from, to] = (*borders_px)?.map(|along| {
                let across = plateau.across_px + plateau.slope * (along - plateau.middle_px());
                along / (w[0] * along + w[1] * across + w[2])
            });
            Some(width_m / (to - from).abs())
        })
        .collect();
    (!scales.is_empty()).then(|| scales.iter().sum::<f64>() / scales.len() as f64)
}

fn denominator_at_base(model: &HeightModel, middle_px: f64) -> f64 {
    let [z, w] = model.rows();
    // The line z = 0: z[0]·u + z[1]·v + z[2] = 0.
    let across = -(z[0] * middle_px + z[2]) / z[1];
    w[0] * middle_px + w[1] * across + w[2]
}

/// Returns the homography from (column, row, 1) to (x, z, 1), row-major.
fn homography(model: &HeightModel, picture: &GaugePicture, scale: f64) -> [f64; 9] {
    let [z, w] = model.rows();
    let rows =
        [[scale, 0.0, -scale * picture.middle_px()], z, w].map(
            |[along, across, one]| match picture.direction {
                StripeDirection::Horizontal => [along, across, one],
                StripeDirection::Vertical => [across, along, one],
            },
        );
    let mut flat = [0.0; 9];
    for (entry, value) in flat.iter_mut().zip(rows.iter().flatten()) {
        *entry = *value;
    }
    flat
}
