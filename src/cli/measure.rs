//! `laser_profiler measure`: planes, steps, spheres and volumes in the results of a replay, with their uncertainty.

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
  laser_profiler measure plane results --region 0,0,20mm,30mm      how flat, how inclined
  laser_profiler measure plane results --region=-50mm,-50mm,50mm,50mm --heights=-1mm,1mm     without what stands on it
  laser_profiler measure step results --region 0,0,20mm,5mm        a ridge or groove across the profiles, ISO 5436-1 type A1
  laser_profiler measure step results --edges 8mm,12mm --direction y --json
  laser_profiler measure sphere results --region 5mm,5mm,15mm,15mm
  laser_profiler measure spheres results --region 0,0,9mm,20mm --region 30mm,0,39mm,20mm
  laser_profiler measure volume results --region 5mm,5mm,9mm,9mm --reference 0,0,20mm,4mm

A region is x0,y0,x1,y1 in the frame of the point cloud: x along the stripe, y along the motion; metres, or with a unit. Lengths in
the answer are metres with --json, else as they are labelled; each has one standard deviation and a half width that contains the
truth in 95 %. It comes from the scatter of the points and, where the
calibration in the recording states its covariance, from that of the calibration (`sigma_calibration`): everything is measured again
with a calibration one standard deviation off, its axis included. Neighbours that deviate together, as after smoothing or by waviness, count as so many
independent points as the correlation of the residuals leaves (`effective`).

--json prints one object:
  tool, topic, profiles, points, rejected (clouds), calibration (text of the file in the recording; null without),
  calibration_unknown (why it has no share in the uncertainties)
  plane:   tilt_rad, normal, center_m, height_m, scatter_m, flatness_d95_m, peak_to_valley_m, outliers, effective;
           profiles_sigma_m (scatter of the profiles' mean heights over the plane, which says how well a height repeats),
           profiles_compared (those with half as many points as usual, or more; without two of them both are missing)
  step:    height_m, edges_m, profile_sigma_m, profiles_used, profiles_rejected, effective
  sphere:  center_x_m, center_y_m, center_z_m, radius_m, scatter_m, form_d95_m, peak_to_valley_m, outliers, effective
  spheres: distance_m, spheres: [sphere, sphere]
  volume:  volume_m3, above_m3, below_m3, area_m2, missing_m2, cell_m
  where a figure with an uncertainty is {value, sigma, u95, sigma_calibration}";

/// Measures in the point cloud of a scan: plane and flatness, step height, spheres and their distance, volume.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub struct MeasureArgs {
    #[command(subcommand)]
    tool: Tool,
}

#[derive(Debug, clap::Subcommand)]
enum Tool {
    /// A plane through the points, robust: how inclined, how flat (D95 % of ISO 10360-13, peak to valley).
    Plane(PlaneArgs),
    /// The height of a ridge or groove over the straight line beside it, ISO 5436-1 type A1, profile by profile.
    Step(StepArgs),
    /// A sphere through the points, robust: centre, radius, form (D95 %).
    Sphere(PlaneArgs),
    /// The distance between the centres of two spheres.
    Spheres(SpheresArgs),
    /// The volume between the surface and a plane.
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
    /// Where the middle part begins and ends; found in the median of all profiles, when not given.
    #[arg(long, value_name = "FROM,TO", value_parser = interval_m, allow_hyphen_values = true)]
    edges: Option<[f64; 2]>,
    /// Along what the profiles run: x along the stripe, y along the motion.
    #[arg(long, value_name = "AXIS", default_value = "x", value_parser = ["x", "y"])]
    direction: String,
}

#[derive(Debug, clap::Args)]
struct SpheresArgs {
    #[command(flatten)]
    common: Common,
    /// Points of one sphere, x0,y0,x1,y1; given twice.
    #[arg(long, value_name = "REGION", value_parser = region, required = true, allow_hyphen_values = true)]
    region: Vec<Region>,
}

#[derive(Debug, clap::Args)]
struct VolumeArgs {
    #[command(flatten)]
    common: Common,
    /// The volume over x0,y0,x1,y1; over everything, when not given.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    region: Option<Region>,
    /// The plane goes through the points here; through all points outside the region, when not given. May be given often.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    reference: Vec<Region>,
    /// Side of a cell of the height map that is summed; the distance of the points, when not given.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m)]
    cell: Option<f64>,
}

/// Measures and tells on `out`.
///
/// # Errors
/// [`Usage`](super::Usage) when the request cannot be followed, a recording without points there, points that do not
/// determine the form.
pub fn run(args: &MeasureArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
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
