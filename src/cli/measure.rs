//! `laser_profiler measure`: planes, steps, spheres and volumes of a scan, with uncertainties.

mod report;
mod tools;

use std::io::Write;

use super::{
    Outcome,
    length::{interval_m, positive_m, region},
    output,
    results_args::ResultsArgs,
};
use crate::metrology::surface::Region;

const HELP: &str = "\
Examples:
  laser_profiler measure plane results --region 0,0,20mm,30mm      flatness and inclination
  laser_profiler measure plane results --region=-50mm,-50mm,50mm,50mm --heights=-1mm,1mm     without objects that stand on it
  laser_profiler measure step results --region 0,0,20mm,5mm        a ridge or groove across the profiles, ISO 5436-1 type A1
  laser_profiler measure step results --edges 8mm,12mm --direction y --json
  laser_profiler measure sphere results --region 5mm,5mm,15mm,15mm
  laser_profiler measure spheres results --region 0,0,9mm,20mm --region 30mm,0,39mm,20mm
  laser_profiler measure volume results --region 5mm,5mm,9mm,9mm --reference 0,0,20mm,4mm

A region is x0,y0,x1,y1 in the frame of the point cloud: x along the stripe, y along the motion; in metres, or with a unit. Lengths are
in metres with --json, otherwise as labelled. Values have a standard deviation (sigma) and a half width with 95 % coverage (u95).
The uncertainty combines the scatter of the points with that of the calibration, if the calibration in the recording states its
covariance (`sigma_calibration`): the measurement is repeated with the calibration, its axis included, off by one standard deviation.
Correlated neighbours, as after smoothing or on a wavy surface, count as fewer independent points (`effective`).

--json prints one object:
  tool, topic, profiles, points, rejected (clouds), calibration (text of the file in the recording; null without),
  calibration_unknown (reason why the uncertainties do not include the calibration),
  outside_calibrated_volume (points whose place the calibration extrapolates: the stated uncertainty does not cover them; null if
  the calibration does not state its volume)
  plane:   tilt_rad, normal, center_m, height_m, scatter_m, flatness_d95_m, peak_to_valley_m, outliers, effective;
           profiles_sigma_m (scatter of the profiles' mean heights over the plane: the repeatability of a height),
           profiles_compared (profiles with at least half the usual number of points; with fewer than two, both are missing)
  step:    height_m, edges_m, profile_sigma_m, profiles_used, profiles_rejected, effective
  sphere:  center_x_m, center_y_m, center_z_m, radius_m, scatter_m, form_d95_m, peak_to_valley_m, outliers, effective
  spheres: distance_m, spheres: [sphere, sphere]
  volume:  volume_m3, above_m3, below_m3, area_m2, missing_m2, cell_m
  a value with an uncertainty is {value, sigma, u95, sigma_calibration}";

/// Measures a scan: plane and flatness, step height, spheres and their distance, volume, with uncertainties.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct MeasureArgs {
    #[command(subcommand)]
    tool: Tool,
}

#[derive(Debug, clap::Subcommand)]
enum Tool {
    /// Robust plane: inclination and flatness (D95 % of ISO 10360-13, peak to valley).
    Plane(PlaneArgs),
    /// Height of a ridge or groove over the straight line beside it, ISO 5436-1 type A1, profile by profile.
    Step(StepArgs),
    /// Robust sphere: centre, radius, form (D95 %).
    Sphere(PlaneArgs),
    /// Distance between the centres of two spheres.
    Spheres(SpheresArgs),
    /// Volume between the surface and a plane.
    Volume(VolumeArgs),
}

#[derive(Debug, clap::Args)]
struct Common {
    #[command(flatten)]
    results: ResultsArgs,
    /// Only heights from LOW to HIGH.
    #[arg(long, value_name = "LOW,HIGH", value_parser = interval_m, allow_hyphen_values = true)]
    heights: Option<[f64; 2]>,
    /// One JSON object on standard output; see `measure --help`.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct PlaneArgs {
    #[command(flatten)]
    common: Common,
    /// Only points in x0,y0,x1,y1.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    region: Option<Region>,
}

#[derive(Debug, clap::Args)]
struct StepArgs {
    #[command(flatten)]
    common: Common,
    /// Only points in x0,y0,x1,y1.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    region: Option<Region>,
    /// Begin and end of the ridge or groove. Default: detected in the median of all profiles.
    #[arg(long, value_name = "FROM,TO", value_parser = interval_m, allow_hyphen_values = true)]
    edges: Option<[f64; 2]>,
    /// Direction of the evaluated profiles: x along the stripe, y along the motion.
    #[arg(long, value_name = "AXIS", default_value = "x", value_parser = ["x", "y"])]
    direction: String,
}

#[derive(Debug, clap::Args)]
struct SpheresArgs {
    #[command(flatten)]
    common: Common,
    /// Points of one sphere, x0,y0,x1,y1. Give it twice.
    #[arg(long, value_name = "REGION", value_parser = region, required = true, allow_hyphen_values = true)]
    region: Vec<Region>,
}

#[derive(Debug, clap::Args)]
struct VolumeArgs {
    #[command(flatten)]
    common: Common,
    /// Region of the volume, x0,y0,x1,y1. Default: the whole scan.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    region: Option<Region>,
    /// Region of the reference plane, x0,y0,x1,y1. Default: all points outside --region. May be repeated.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    reference: Vec<Region>,
    /// Cell size of the height map. Default: the distance of the points.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m)]
    cell: Option<f64>,
}

/// Measures a scan and prints the result on `out`.
///
/// # Errors
/// [`Usage`](super::Usage) for wrong usage; a recording without points in the region, points that do not determine the
/// form.
pub(crate) fn run(args: &MeasureArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let (common, answer) = match &args.tool {
        Tool::Plane(args) => (&args.common, tools::plane(args)?),
        Tool::Step(args) => (&args.common, tools::step(args)?),
        Tool::Sphere(args) => (&args.common, tools::sphere(args)?),
        Tool::Spheres(args) => (&args.common, tools::spheres(args)?),
        Tool::Volume(args) => (&args.common, tools::volume(args)?),
    };
    let text = if common.json { answer.json() } else { answer.text() };
    output::print(out, &text)?;
    Ok(answer.outcome)
}
