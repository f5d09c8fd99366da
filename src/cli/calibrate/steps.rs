//! `laser_profiler calibrate steps`: known heights instead of a board.

mod lateral;
mod report;

use std::{fs, io::Write, path::PathBuf};

use anyhow::Context;

use super::line::{self, Line};
use crate::{
    cli::{
        Outcome, Usage,
        length::{length_m, positive_m},
        output,
        progress::progress_bar,
        settings::{Settings, SettingsArgs},
    },
    metrology::{
        plateaus::{self, Piece, PlateauError},
        steps::{self, Known, Plateau, StepsCalibration, Term, VerticalGeometry},
    },
    ros::arguments::RosArguments,
    scanner::{
        calibration::{Calibration, Projective, StepsQuality, VerticalIncidence},
        params::StripeDirection,
    },
};
use lateral::Bordered;

const HELP: &str = "\
Examples:
  laser_profiler calibrate steps base.png=0mm low.png=2mm high.png=5mm top.png=9mm --lateral 22um -o calibration.yaml
      four pictures, one height each
  laser_profiler calibrate steps stair.jpg=0mm,1mm,2mm,3mm,4mm --pitch 5mm -o calibration.yaml
      one picture of a stair gauge whose steps are 5 mm wide; the heights in their order along the stripe
  laser_profiler calibrate steps a.png=0mm b.png=10mm c.png=20mm d.png=35mm --pixel-pitch 4.8um --image-distance 26mm \\
      -o calibration.yaml
      formula 6: sensor and lens are known, so that a, b, the angle and the lateral scale follow
  laser_profiler calibrate steps flat_at_0=0mm flat_at_5=5mm flat_at_9=9mm --ros-args -p stripe_direction:=vertical
      three recordings; only tells how well heights would be measured

Heights: three different ones or more, in metres or with a unit (mm, um); four or more say how good the result is. Heights alone
tell three numbers of h = (p v + q) / (r v + 1), v across the stripe; with terms along it five, which are taken when they fit
better than by chance. They do not tell what a pixel sees along the stripe: -o needs --lateral, --pitch, or --pixel-pitch with a
distance. The stripe is found as by the node: the same parameters serve (roi.* chooses a part of the picture).

--json prints one object:
  model (across | both | vertical_incidence), rms_m, rms_left_out_m, linearity (largest residual over the range of heights),
  degrees_of_freedom, sigma_m, u95_m (of a height; null without redundancy), lateral_m_per_px (at height 0), geometry, output
  heights: [{source, height_m, measured_m, residual_m, left_out_m, noise_m, along_px: [from, to], across_px, sigma_px, points}]";

/// Calibrates from pictures of known heights: a step gauge, gauge blocks, or a flat moved by known amounts.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct StepsArgs {
    /// A PNG or JPEG file or a recording, and the heights it shows in their order along the stripe.
    #[arg(value_name = "SOURCE=HEIGHT[,HEIGHT]", required = true, value_parser = source)]
    sources: Vec<Source>,
    /// The calibration, a YAML file.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Replaces a file that is there already.
    #[arg(long)]
    force: bool,
    /// What a pixel sees along the stripe at height 0, in the middle of the picture.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m)]
    lateral: Option<f64>,
    /// Width of every plateau between two others of one picture.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, conflicts_with = "lateral")]
    pitch: Option<f64>,
    /// Distance of pixels on the sensor; with one of the distances the calibration is formula 6.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, conflicts_with_all = ["lateral", "pitch"])]
    pixel_pitch: Option<f64>,
    /// a: from the lens to the sensor, near the focal length.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, requires = "pixel_pitch")]
    image_distance: Option<f64>,
    /// b: from the lens to the base point, as measured by a ruler.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, requires = "pixel_pitch",
        conflicts_with = "image_distance")]
    object_distance: Option<f64>,
    /// Which numbers are estimated; auto: terms along the stripe when they fit better than by chance.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = ["auto", "across", "both"])]
    terms: String,
    /// Frame of the profiles.
    #[arg(long, value_name = "NAME", default_value = "laser_plane")]
    frame_id: String,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// A picture or recording and its heights.
#[derive(Clone, Debug, PartialEq)]
struct Source {
    path: PathBuf,
    heights_m: Vec<f64>,
}

fn source(text: &str) -> Result<Source, String> {
    let Some((path, heights)) = text.rsplit_once('=') else {
        return Err("a height is missing: FILE=HEIGHT, as in base.png=0mm".to_owned());
    };
    let heights_m = heights.split(',').map(length_m).collect::<Result<Vec<_>, _>>()?;
    if heights_m.windows(2).any(|pair| pair[0].total_cmp(&pair[1]).is_eq()) {
        return Err("two neighbouring plateaus of one height are one plateau".to_owned());
    }
    Ok(Source { path: path.into(), heights_m })
}

/// Everything that was found.
struct Found {
    /// Where each plateau was seen.
    sources: Vec<PathBuf>,
    plateaus: Vec<Plateau>,
    /// Borders of each plateau that lies between two of its picture.
    borders_px: Vec<Option<[f64; 2]>>,
    size_px: (u32, u32),
    direction: StripeDirection,
}

impl Found {
    /// Middle of the picture along the stripe, pixels.
    fn middle_px(&self) -> f64 {
        let (width, height) = self.size_px;
        let length = match self.direction {
            StripeDirection::Horizontal => width,
            StripeDirection::Vertical => height,
        };
        0.5 * (f64::from(length) - 1.0)
    }
}

/// Calibrates and tells on `out` how well.
///
/// # Errors
/// [`Usage`] for parameters that the node would refuse, for heights that do not calibrate, for an output without a
/// lateral scale; pictures that cannot be read or show other plateaus.
pub(super) fn run(
    args: &StepsArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    check(args)?;
    let found = find(args, &Settings::load(&args.settings, ros)?)?;
    let terms = match args.terms.as_str() {
        "across" => Some(Term::Across),
        "both" => Some(Term::Both),
        _ if args.pixel_pitch.is_some() => Some(Term::Across),
        _ => None,
    };
    let result =
        steps::calibrate(&found.plateaus, terms).map_err(|error| Usage(error.to_string()))?;
    let geometry = geometry(args, &result)?;
    let scale = scale(args, &found, &result, geometry.as_ref())?;
    if let (Some(path), Some(scale)) = (&args.output, scale) {
        let calibration = match &geometry {
            Some(geometry) => vertical(args, &found, &result, geometry),
            None => projective(args, &found, &result, scale),
        };
        fs::write(path, calibration.to_yaml())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let lateral_m = scale.map(|s| lateral::at_base(&result.model, found.middle_px(), s).abs());
    let text = if args.json {
        report::json(args, &found, &result, geometry.as_ref(), lateral_m)
    } else {
        report::text(args, &found, &result, geometry.as_ref(), lateral_m)
    };
    output::print(out, &text)?;
    Ok(Outcome::Done)
}

/// What can be refused before anything is read.
fn check(args: &StepsArgs) -> Result<(), Usage> {
    let has_distance = args.image_distance.is_some() || args.object_distance.is_some();
    if args.pixel_pitch.is_some() && !has_distance {
        return Err(Usage("--pixel-pitch needs --image-distance or --object-distance".into()));
    }
    let has_scale = args.lateral.is_some() || args.pitch.is_some() || has_distance;
    if args.output.is_some() && !has_scale {
        return Err(Usage(
            "heights do not tell what a pixel sees along the stripe: -o needs --lateral LENGTH (a pixel at height 0), \
             --pitch LENGTH (the width of a plateau), or --pixel-pitch with --image-distance or --object-distance; \
             without -o the heights are judged alone"
                .into(),
        ));
    }
    match &args.output {
        Some(path) if !args.force => {
            output::refuse_existing(path).map_err(|error| Usage(error.to_string()))
        }
        _ => Ok(()),
    }
}

fn find(args: &StepsArgs, settings: &Settings) -> anyhow::Result<Found> {
    let mut found = Found {
        sources: Vec::new(),
        plateaus: Vec::new(),
        borders_px: Vec::new(),
        size_px: (0, 0),
        direction: StripeDirection::Horizontal,
    };
    let bar = progress_bar(Some(args.sources.len() as u64), "pictures");
    for Source { path, heights_m } in &args.sources {
        let name = path.display();
        let Line { points, size_px, direction, frames } = line::find(path, settings)?;
        tracing::debug!("{name}: {} points in {frames} frames", points.len());
        if !found.sources.is_empty() && size_px != found.size_px {
            let ((w, h), (w0, h0)) = (size_px, found.size_px);
            let text = format!(
                "{name} has {w} x {h} pixels, those before {w0} x {h0}: one camera calibrates"
            );
            return Err(Usage(text).into());
        }
        (found.size_px, found.direction) = (size_px, direction);
        let pieces = plateaus::cut(&points, heights_m.len())
            .map_err(|error| Usage(format!("{name}: {error}{}", hint(&error, settings))))?;
        for (at, (piece, height_m)) in pieces.iter().zip(heights_m).enumerate() {
            let plateau = Plateau::fit(&points, &piece.inner, *height_m)
                .with_context(|| format!("{name}: plateau {at} has too few points"))?;
            found.plateaus.push(plateau);
            found.sources.push(path.clone());
            let is_between = at > 0 && at + 1 < pieces.len();
            found.borders_px.push(is_between.then(|| borders(&points, piece)));
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(found)
}

/// What to do about another number of plateaus.
fn hint(error: &PlateauError, settings: &Settings) -> String {
    let PlateauError::Count { wanted, found, .. } = error else { return String::new() };
    if found > wanted {
        return "; give a height for each, as in FILE=0mm,2mm,0mm".to_owned();
    }
    let areas = settings.cameras.iter().map(|c| c.scanner.extraction.min_segment_area);
    let area = areas.max().unwrap_or_default();
    format!(
        "; pieces of the stripe of fewer than {area} pixels are left out (extraction.min_segment_area)"
    )
}

/// Where a plateau between two others begins and ends: half way to the neighbour's nearest point.
fn borders(points: &[[f64; 2]], piece: &Piece) -> [f64; 2] {
    let between = |at: usize| 0.5 * (points[at - 1][0] + points[at][0]);
    [between(piece.whole.start), between(piece.whole.end)]
}

fn geometry(
    args: &StepsArgs,
    result: &StepsCalibration,
) -> anyhow::Result<Option<VerticalGeometry>> {
    let known = match (args.image_distance, args.object_distance) {
        (Some(a), _) => Known::ImageDistance(a),
        (_, Some(b)) => Known::ObjectDistance(b),
        _ => return Ok(None),
    };
    let pitch_m = args.pixel_pitch.unwrap_or_default();
    Ok(Some(steps::vertical_incidence(&result.model, pitch_m, known)?))
}

/// Numerator of x for a pixel along the stripe, as far as it is known.
fn scale(
    args: &StepsArgs,
    found: &Found,
    result: &StepsCalibration,
    geometry: Option<&VerticalGeometry>,
) -> anyhow::Result<Option<f64>> {
    let (model, middle_px) = (&result.model, found.middle_px());
    if let (Some(geometry), Some(pitch_m)) = (geometry, args.pixel_pitch) {
        let lateral_m = pitch_m * geometry.object_distance_m[0] / geometry.image_distance_m[0];
        return Ok(Some(lateral::of_pixel(model, middle_px, lateral_m)));
    }
    if let Some(width_m) = args.pitch {
        let plateaus = found.plateaus.iter().zip(&found.borders_px);
        let plateaus = plateaus.map(|(plateau, &borders_px)| Bordered { plateau, borders_px });
        let scale = lateral::of_width(model, plateaus, width_m).ok_or_else(|| {
            Usage("--pitch needs a plateau between two others: three or more in one picture".into())
        })?;
        return Ok(Some(scale));
    }
    Ok(args.lateral.map(|lateral_m| lateral::of_pixel(model, middle_px, lateral_m)))
}

fn projective(
    args: &StepsArgs,
    found: &Found,
    result: &StepsCalibration,
    scale: f64,
) -> Calibration {
    let of = |model: &steps::Model| {
        lateral::homography(model, found.direction, found.middle_px(), scale)
    };
    let covariance = result.model.propagated(of);
    Calibration::Projective(Box::new(Projective {
        frame_id: args.frame_id.clone(),
        width_px: found.size_px.0,
        height_px: found.size_px.1,
        homography: of(&result.model),
        quality: Some(quality(found, result, covariance.as_slice())),
        calibrated_at: Some(now()),
    }))
}

/// How well it is known; a covariance that the heights leave open is not stated.
fn quality(found: &Found, result: &StepsCalibration, covariance: &[f64]) -> StepsQuality {
    let is_known = covariance.iter().all(|value| value.is_finite());
    StepsQuality {
        rms_m: result.rms_m,
        heights_used: found.plateaus.len() as u32,
        covariance: if is_known { covariance.to_vec() } else { Vec::new() },
    }
}

/// The time as `2026-11-22T12:00:00Z`.
fn now() -> String {
    jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

fn vertical(
    args: &StepsArgs,
    found: &Found,
    result: &StepsCalibration,
    geometry: &VerticalGeometry,
) -> Calibration {
    Calibration::VerticalIncidence(VerticalIncidence {
        frame_id: args.frame_id.clone(),
        image_distance_m: geometry.image_distance_m[0],
        object_distance_m: geometry.object_distance_m[0],
        beta_rad: geometry.beta_rad[0],
        pixel_pitch_m: args.pixel_pitch.unwrap_or_default(),
        base_row_px: geometry.base_px[0],
        center_column_px: found.middle_px(),
        height_sign: geometry.height_sign,
        quality: Some(quality(found, result, geometry.covariance.as_slice())),
    })
}
