//! `laser_profiler calibrate level`: levels the part's frame on a flat.

use std::{io::Write, path::PathBuf};

use anyhow::{Context, bail};
use serde_json::json;

use crate::{
    calibrate::level_part,
    cli::{
        Outcome,
        length::{interval_m, region},
        output,
        results_args::ResultsArgs,
    },
    metrology::{
        plane::{self, PlaneFit},
        surface::Region,
    },
    results::{ANY_HEIGHT_M, Results},
    scanner::calibration::{Calibration, CameraAndPlane, PartPose},
};

const HELP: &str = "\
Scan a flat (the empty table, a plate, a flat of the part), then level the part's frame on it: scans with the new file come out
level, with the flat at height 0 and x and y unchanged. The calibration is taken from the results; an existing level is
refined. Outliers do not affect the flat; --region and --heights exclude objects that stand on it.

Examples:
  laser_profiler calibrate level results -o level.yaml
  laser_profiler calibrate level results -o level.yaml --region=-30mm,-30mm,30mm,30mm --heights=-50mm,-40mm

--json prints one object: output, id, points, outliers, tilt_rad, tilt_sigma_rad and height_m, height_sigma_m (of the flat, before),
  flatness_d95_m, part: {origin_m, rotation_rad}";

/// Levels the part's frame on a scanned flat: later scans come out level.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct LevelArgs {
    #[command(flatten)]
    results: ResultsArgs,
    /// Region of the flat: x0,y0,x1,y1.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    region: Option<Region>,
    /// Uses only heights from LOW to HIGH.
    #[arg(long, value_name = "LOW,HIGH", value_parser = interval_m, allow_hyphen_values = true)]
    heights: Option<[f64; 2]>,
    /// The calibration, a YAML file.
    #[arg(short, long, value_name = "FILE.yaml")]
    output: PathBuf,
    /// Replaces an existing file.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
}

/// Fits the flat, writes the file and prints the pose of the flat to `out`.
///
/// # Errors
/// Results without a calibration of a camera and a plane, or placed by poses; no flat; a file that exists or cannot be
/// written.
pub(super) fn run(args: &LevelArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if !args.force {
        output::refuse_existing(&args.output)?;
    }
    let results = Results::open(&args.results.selection())?;
    let bag = args.results.bag.display();
    results.check_surface().with_context(|| bag.to_string())?;
    let mut geometry = geometry(&results).with_context(|| bag.to_string())?;
    let scanned = results
        .surface(&args.region.unwrap_or(Region::ALL), args.heights.unwrap_or(ANY_HEIGHT_M))
        .with_context(|| format!("{bag}: {}", results.topic()))?;
    let flat = plane::fit(&scanned.surface)?;
    let part = level_part(&flat, geometry.part);
    geometry.part = Some(part);
    geometry.calibrated_at =
        Some(jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string());
    let calibration = Calibration::CameraAndPlane(Box::new(geometry));
    output::write_file(&args.output, calibration.to_yaml())?;
    let text = summary(args, &calibration.id(), &flat, part);
    output::print(out, &text)?;
    Ok(Outcome::with_losses(scanned.counts.rejected))
}

/// Returns the calibration contained in the results.
fn geometry(results: &Results) -> anyhow::Result<CameraAndPlane> {
    let provenance = results.provenance();
    let text = provenance.calibration.as_ref().context(
        "the results contain no calibration: replay with a calibration_file, which can then be levelled",
    )?;
    if provenance.is_posed() {
        bail!("profiles were placed by poses (motion.source: tf): their frame is that of tf");
    }
    match Calibration::from_yaml(text).context("the calibration in the results")? {
        Calibration::CameraAndPlane(geometry) => Ok(*geometry),
        _ => bail!(
            "the results were measured by known heights or formula 6: a level needs a calibration of type camera_and_plane; \
             `export --level` levels a single scan"
        ),
    }
}

fn summary(args: &LevelArgs, id: &str, flat: &PlaneFit, part: PartPose) -> String {
    let [about_x, about_y] = flat.tilt_sigma_rad;
    let tilt_sigma_rad = about_x.hypot(about_y) / 2.0_f64.sqrt();
    let output = args.output.display();
    if args.json {
        let object = json!({
            "output": args.output,
            "id": id,
            "points": flat.num_points,
            "outliers": flat.num_outliers,
            "tilt_rad": flat.tilt_rad(),
            "tilt_sigma_rad": tilt_sigma_rad,
            "height_m": flat.center_m.z,
            "height_sigma_m": flat.sigma_m / flat.normal.z.abs().max(1e-3),
            "flatness_d95_m": flat.flatness.d95_m,
            "part": {"origin_m": part.origin_m, "rotation_rad": part.rotation_rad},
        });
        return format!("{object}\n");
    }
    format!(
        "{output}: levelled on a flat of {} points, {} of them outliers\n  it was inclined by {:.3} ± {:.3} mrad and lay at {:.4} ± \
         {:.4} mm (one standard deviation)\n",
        flat.num_points,
        flat.num_outliers,
        1e3 * flat.tilt_rad(),
        1e3 * tilt_sigma_rad,
        1e3 * flat.center_m.z,
        1e3 * flat.sigma_m
    )
}
