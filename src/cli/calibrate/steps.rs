//! `laser_profiler calibrate steps`: calibrates from known heights instead of a board.

mod args;
mod gauge;
mod report;

use std::io::Write;

use crate::{
    calibrate::{
        HeightReference, HeightTerms, KnownDistance, KnownLateral, KnownLength, LateralScale,
        StepsCalibration, StepsRequest, VerticalGeometry, assign_heights, calibrate_steps,
        vertical_incidence,
    },
    cli::{Outcome, Usage, length::UncertainLength, output, settings::Settings},
    ros::arguments::RosArguments,
    scanner::calibration::Calibration,
};
pub(super) use args::StepsArgs;
use gauge::Gauge;
use report::Answer;

/// Calibrates and prints the result to `out`.
///
/// # Errors
/// [`Usage`] for invalid parameters, for heights that do not calibrate, for an output without a lateral scale; pictures
/// that cannot be read or show a different number of plateaus.
pub(super) fn run(
    args: &StepsArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    args.check()?;
    let mut gauge = Gauge::find(args, &Settings::load(&args.settings, ros)?)?;
    let terms = match args.terms.as_str() {
        "across" => Some(HeightTerms::Across),
        "both" => Some(HeightTerms::Both),
        _ if args.pixel_pitch.is_some() => Some(HeightTerms::Across),
        _ => None,
    };
    let reference =
        if args.gauge.differences { HeightReference::EachPicture } else { HeightReference::Common };
    let request = StepsRequest { terms, reference, picture: gauge.picture };
    let height_sign =
        if args.gauge.any_order { Some(assign(args, &mut gauge, &request)?) } else { None };
    let plateaus: Vec<_> = gauge.plateaus.iter().map(|found| found.plateau.clone()).collect();
    let result = calibrate_steps(&plateaus, &request).map_err(|error| Usage(error.to_string()))?;
    warn(&result);
    let geometry = geometry(args, &result)?;
    let scale = scale(args, &gauge, &result, geometry.as_ref())?;
    if let (Some(path), Some(scale)) = (&args.output, scale) {
        let frame_id = &args.frame_id;
        let calibration = if let (Some(geometry), Some(pitch_m)) = (&geometry, args.pixel_pitch) {
            Calibration::VerticalIncidence(result.vertical_incidence(
                geometry,
                pitch_m,
                &gauge.picture,
                frame_id,
            ))
        } else {
            let mut projective = result.projective(&gauge.picture, scale, frame_id);
            projective.calibrated_at = Some(now());
            Calibration::Projective(Box::new(projective))
        };
        output::write_file(path, calibration.to_yaml())?;
    }
    let lateral_m = scale.map(|scale| result.meters_per_pixel(scale, &gauge.picture));
    let answer = Answer { result: &result, geometry: geometry.as_ref(), height_sign, lateral_m };
    let text = if args.json {
        report::json(args, &gauge, &answer)
    } else {
        report::text(args, &gauge, &answer)
    };
    output::print(out, &text)?;
    Ok(Outcome::Done)
}

/// Says what widens the uncertainties.
fn warn(result: &StepsCalibration) {
    if let Some(excess) = result.excess {
        tracing::warn!(
            "the residuals are {excess:.1} times as large as the stated uncertainty of the gauge explains: check the heights, their \
             order and the lens; all uncertainties are widened accordingly"
        );
    }
    if result.bow.is_harmful {
        tracing::warn!(
            "the line of a flat is curved by {:.1} µm: lens distortion. Calibrate the camera with a board (calibrate camera, calibrate \
             plane); all uncertainties are widened accordingly",
            1e6 * result.bow.curvature_m
        );
    }
}

/// Exchanges the heights of each picture so that they fit; returns the sign of the heights.
fn assign(args: &StepsArgs, gauge: &mut Gauge, request: &StepsRequest) -> Result<i8, Usage> {
    let mut plateaus: Vec<_> = gauge.plateaus.iter().map(|found| found.plateau.clone()).collect();
    let sign = assign_heights(&mut plateaus, request, args.gauge.height_sign)
        .map_err(|error| Usage(error.to_string()))?;
    for (found, plateau) in gauge.plateaus.iter_mut().zip(plateaus) {
        found.plateau = plateau;
    }
    Ok(sign)
}

/// A length without a stated uncertainty is taken as exact.
fn known(length: UncertainLength) -> KnownLength {
    KnownLength { length_m: length.length_m, sigma_m: length.sigma_m.unwrap_or(0.0) }
}

fn geometry(
    args: &StepsArgs,
    result: &StepsCalibration,
) -> anyhow::Result<Option<VerticalGeometry>> {
    let known = match (args.image_distance, args.object_distance) {
        (Some(a), _) => KnownDistance::ImageDistance(a),
        (_, Some(b)) => KnownDistance::ObjectDistance(b),
        _ => return Ok(None),
    };
    let pitch_m = args.pixel_pitch.unwrap_or_default();
    Ok(Some(vertical_incidence(&result.model, pitch_m, known)?))
}

/// Returns the numerator of x per pixel along the stripe; `None` if no argument determines it.
fn scale(
    args: &StepsArgs,
    gauge: &Gauge,
    result: &StepsCalibration,
    geometry: Option<&VerticalGeometry>,
) -> Result<Option<LateralScale>, Usage> {
    let known = match (geometry, args.pixel_pitch, args.pitch, args.lateral) {
        (Some(geometry), Some(pitch_m), ..) => KnownLateral::PerPixel(KnownLength {
            length_m: pitch_m * geometry.object_distance_m[0] / geometry.image_distance_m[0],
            sigma_m: 0.0,
        }),
        (_, _, Some(width), _) => KnownLateral::PlateauWidth(known(width)),
        (_, _, _, Some(lateral)) => KnownLateral::PerPixel(known(lateral)),
        _ => return Ok(None),
    };
    let scale = result.lateral_scale(known, &gauge.plateaus, &gauge.picture).ok_or_else(|| {
        Usage("--pitch needs a plateau between two others: three or more in one picture".into())
    })?;
    Ok(Some(scale))
}

/// Formats the time as `2026-11-22T12:00:00Z`.
fn now() -> String {
    jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}
