//! The scale along the stripe, which heights alone do not determine, and the resulting calibration.

use nalgebra::DMatrix;

use super::{GaugePlateau, HeightModel, Plateau, StepsCalibration, VerticalGeometry};
use crate::{
    calibrate::GaugePicture,
    metrology::student::{NORMAL_95, factor_95},
    scanner::{
        calibration::{CalibratedVolume, Projective, StepsQuality, VerticalIncidence, range},
        params::StripeDirection,
    },
};

/// One standard deviation of a border that lies somewhere between two neighbouring pixels, pixels.
const BORDER_SIGMA_PX: f64 = 0.29;

/// A known length and its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownLength {
    /// Length, metres.
    pub length_m: f64,
    /// One standard deviation of it, metres; 0 if it is exact.
    pub sigma_m: f64,
}

/// A known length along the stripe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KnownLateral {
    /// Length of a pixel at height 0 in the middle of the image.
    PerPixel(KnownLength),
    /// Width of every plateau between two others.
    PlateauWidth(KnownLength),
}

/// The scale along the stripe: the numerator of x per pixel. A projective map divides it by the same denominator as the
/// heights, taken here at height 0 in the middle of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateralScale {
    /// Numerator of x per pixel, metres.
    pub per_px: f64,
    /// One standard deviation of it, relative to it.
    pub relative_sigma: f64,
}

impl StepsCalibration {
    /// Returns the scale along the stripe. `None` if a plateau width is known, but no plateau lies between two others.
    #[must_use]
    pub fn lateral_scale(
        &self,
        known: KnownLateral,
        plateaus: &[GaugePlateau],
        picture: &GaugePicture,
    ) -> Option<LateralScale> {
        match known {
            KnownLateral::PerPixel(KnownLength { length_m, sigma_m }) => Some(LateralScale {
                per_px: length_m * denominator_at_base(&self.model, picture.middle_px()),
                relative_sigma: sigma_m / length_m,
            }),
            KnownLateral::PlateauWidth(width) => of_width(&self.model, plateaus, width),
        }
    }

    /// Returns the length of a pixel at height 0 in the middle of the image, metres.
    #[must_use]
    pub fn meters_per_pixel(&self, scale: LateralScale, picture: &GaugePicture) -> f64 {
        (scale.per_px / denominator_at_base(&self.model, picture.middle_px())).abs()
    }

    /// Returns the calibration of a camera without distortion, without a date. `frame_id` names the frame of the profiles.
    #[must_use]
    pub fn projective(
        &self,
        picture: &GaugePicture,
        scale: LateralScale,
        frame_id: &str,
    ) -> Projective {
        let of = |model: &HeightModel| homography(model, picture, scale.per_px);
        // The first row is proportional to the scale.
        let mut by_scale = [0.0; 9];
        by_scale[..3].copy_from_slice(&of(&self.model)[..3]);
        let by_scale = DMatrix::from_row_slice(9, 1, &by_scale) * scale.relative_sigma;
        let covariance = self.model.propagated(of) + &by_scale * by_scale.transpose();
        let mut map = Projective {
            frame_id: frame_id.to_owned(),
            width_px: picture.size_px[0],
            height_px: picture.size_px[1],
            homography: of(&self.model),
            quality: None,
            calibrated_at: None,
        };
        let bow = self.bow.of_projective(&map, picture.direction).map(Box::new);
        let quality = self.quality(picture, covariance.as_slice());
        map.quality = Some(StepsQuality { bow, ..quality });
        map
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
        let mut formula = VerticalIncidence {
            frame_id: frame_id.to_owned(),
            image_distance_m: geometry.image_distance_m[0],
            object_distance_m: geometry.object_distance_m[0],
            beta_rad: geometry.beta_rad[0],
            pixel_pitch_m,
            base_row_px: geometry.base_px[0],
            center_column_px: picture.middle_px(),
            height_sign: geometry.height_sign,
            quality: None,
        };
        let bow = self.bow.of_vertical_incidence(&formula).map(Box::new);
        let quality = self.quality(picture, geometry.covariance.as_slice());
        formula.quality = Some(StepsQuality { bow, ..quality });
        formula
    }

    /// The quality without the bow of the line. A covariance that the heights do not determine is omitted.
    fn quality(&self, picture: &GaugePicture, covariance: &[f64]) -> StepsQuality {
        let is_known = covariance.iter().all(|value| value.is_finite());
        StepsQuality {
            rms_m: self.rms_m,
            heights_used: self.checks.len() as u32,
            covariance: if is_known { covariance.to_vec() } else { Vec::new() },
            volume: self.volume(picture.direction),
            bow: None,
        }
    }

    /// Returns the part of the image, and the heights, that the lines of all plateaus cover.
    fn volume(&self, direction: StripeDirection) -> Option<CalibratedVolume> {
        let ends = || self.checks.iter().flat_map(|check| check.plateau.ends());
        let along_px = range(ends().map(|[along, _]| along))?;
        let across_px = range(ends().map(|[_, across]| across))?;
        let heights_m = range(self.checks.iter().map(|check| {
            let Plateau { height, picture, .. } = &check.plateau;
            height.height_m + self.offsets_m.get(*picture).copied().unwrap_or(0.0)
        }));
        let (columns_px, rows_px) = match direction {
            StripeDirection::Horizontal => (along_px, across_px),
            StripeDirection::Vertical => (across_px, along_px),
        };
        Some(CalibratedVolume { columns_px, rows_px, heights_m, depths_m: None })
    }
}

/// Returns the scale from plateaus of one known width.
fn of_width(
    model: &HeightModel,
    plateaus: &[GaugePlateau],
    KnownLength { length_m, sigma_m }: KnownLength,
) -> Option<LateralScale> {
    let [_, w] = model.rows();
    let scales: Vec<[f64; 2]> = plateaus
        .iter()
        .filter_map(|GaugePlateau { plateau, borders_px }| {
            // x / scale at both borders, each over its own denominator.
            let [from, to] = (*borders_px)?.map(|along| {
                let across = plateau.across_px + plateau.slope * (along - plateau.middle_px());
                along / (w[0] * along + w[1] * across + w[2])
            });
            let width_px = borders_px.map(|[from, to]| (to - from).abs())?;
            Some([length_m / (to - from).abs(), 2.0_f64.sqrt() * BORDER_SIGMA_PX / width_px])
        })
        .collect();
    let num = scales.len() as f64;
    let per_px = scales.iter().map(|[scale, _]| scale).sum::<f64>() / num;
    let of_borders = (scales.iter().map(|[_, sigma]| sigma.powi(2)).sum::<f64>()).sqrt() / num;
    let squares: f64 = scales.iter().map(|[scale, _]| (scale / per_px - 1.0).powi(2)).sum();
    let scatter = if scales.len() > 1 {
        (squares / (num - 1.0) / num).sqrt() * factor_95(num - 1.0) / NORMAL_95
    } else {
        0.0
    };
    let relative_sigma = (sigma_m / length_m).hypot(of_borders.max(scatter));
    (!scales.is_empty()).then_some(LateralScale { per_px, relative_sigma })
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
