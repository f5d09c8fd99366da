//! The measuring tools, applied to a scan.

use anyhow::{Context, ensure};
use serde_json::json;

use super::{
    Common, PlaneArgs, SpheresArgs, StepArgs, VolumeArgs,
    report::{Answer, Unit},
};
use crate::{
    cli::{Outcome, Usage},
    metrology::{
        between_profiles::{self, BetweenProfiles},
        form::Form,
        height_map::{GridLayout, Resampler},
        plane::{self, PlaneFit},
        sphere,
        sphere::SphereFit,
        step_height,
        surface::{Region, Surface, is_measured},
        volume,
    },
    results::{ANY_HEIGHT_M, Figure, Results, Scanned, calibration_share, num_outside_calibration},
};

/// Inclination from which a height along z differs from one along the normal by more than 0.05 %, radians.
const INCLINED_RAD: f64 = 0.032;

/// Reads the points of a region.
fn points(common: &Common, region: &Region) -> anyhow::Result<(Scanned, Results)> {
    let results = Results::open(&common.results.selection())?;
    let scanned = results
        .surface(region, common.heights.unwrap_or(ANY_HEIGHT_M))
        .with_context(|| format!("{}: {}", common.results.bag.display(), results.topic()))?;
    Ok((scanned, results))
}

/// Reads the points of a region of a surface.
fn surface_points(common: &Common, region: &Region) -> anyhow::Result<(Scanned, Results)> {
    let (scanned, results) = points(common, region)?;
    let bag = || format!("{}: {}", common.results.bag.display(), results.topic());
    results.check_surface().with_context(bag)?;
    scanned.surface.check().map_err(|reason| results.no_surface(reason)).with_context(bag)?;
    Ok((scanned, results))
}

/// Returns the standard deviation of each value due to the calibration; adds the reason to the answer if it is unknown.
fn shares<const N: usize>(
    answer: &mut Answer,
    results: &Results,
    scanned: &[&Scanned],
    measure: impl Fn(&[Surface]) -> anyhow::Result<[f64; N]>,
) -> [Option<f64>; N] {
    match calibration_share(results, scanned, measure) {
        Ok(sigmas) => sigmas.map(Some),
        Err(why) => {
            answer.text_line("calibration_unknown", "not in sigma: calibration", &why);
            [None; N]
        }
    }
}

/// Adds the description of the input to the answer.
fn input(answer: &mut Answer, results: &Results, scanned: &[&Scanned], num_points: usize) {
    let counts = scanned.first().map(|scanned| scanned.counts).unwrap_or_default();
    answer.text_line("topic", "points of", results.topic());
    answer.count("profiles", "profiles", counts.profiles);
    answer.count("points", "points", num_points as u64);
    if counts.rejected > 0 {
        answer.count("rejected", "clouds skipped", counts.rejected);
    } else {
        answer.hidden("rejected", json!(0));
    }
    match num_outside_calibration(results, scanned) {
        Some(num) if num > 0 => {
            answer.count(
                "outside_calibrated_volume",
                "extrapolated: outside the calibrated volume",
                num,
            );
        }
        num => answer.hidden("outside_calibrated_volume", json!(num)),
    }
    answer.hidden("calibration", json!(results.provenance().calibration));
    answer.outcome = Outcome::with_losses(counts.rejected);
}

pub(super) fn plane(args: &PlaneArgs) -> anyhow::Result<Answer> {
    let region = args.region.unwrap_or(Region::ALL);
    let (scanned, results) = surface_points(&args.common, &region)?;
    let plane = plane::fit(&scanned.surface)?;
    let mut answer = Answer::new("plane");
    input(&mut answer, &results, &[&scanned], plane.num_points);
    answer.hidden("normal", json!([plane.normal.x, plane.normal.y, plane.normal.z]));
    answer.place("center_m", "centre", plane.center_m.coords.as_slice());
    let [x_m, y_m] = [plane.center_m.x, plane.center_m.y];
    let of_height = |s: &[Surface]| {
        let plane = plane::fit(&s[0])?;
        Ok([plane.height_m(x_m, y_m), plane.tilt_rad(), plane.flatness.d95_m])
    };
    let [by_height, by_tilt, by_form] = shares(&mut answer, &results, &[&scanned], of_height);
    let height = Figure::new(plane.center_m.z, plane.sigma_m / plane.normal.z.abs().max(1e-3));
    let height = height.with_calibration(by_height);
    answer.figure("height_m", "height at the centre", height, Unit::Millimetre);
    let [about_x, about_y] = plane.tilt_sigma_rad;
    let tilt = Figure::new(plane.tilt_rad(), about_x.hypot(about_y) / 2.0_f64.sqrt());
    answer.figure("tilt_rad", "inclination", tilt.with_calibration(by_tilt), Unit::Milliradian);
    answer.number("scatter_m", "scatter (robust sigma)", plane.scatter_m, Unit::Micrometre);
    form(&mut answer, "flatness_d95_m", "flatness D95 %", plane.flatness, by_form);
    answer.count("outliers", "outliers", plane.num_outliers as u64);
    answer.number("effective", "independent points", plane.effective_points, Unit::None);
    if let Some(profiles) = between_profiles::of(&scanned.surface, &plane) {
        let BetweenProfiles { sigma_m, of_sigma_m, num_profiles } = profiles;
        let scatter = Figure::new(sigma_m, of_sigma_m);
        answer.figure("profiles_sigma_m", "sigma of profile heights", scatter, Unit::Micrometre);
        answer.count("profiles_compared", "profiles compared", num_profiles as u64);
    }
    Ok(answer)
}

fn form(answer: &mut Answer, key: &str, label: &str, form: Form, calibration: Option<f64>) {
    let d95 = Figure::new(form.d95_m, form.d95_sigma_m).with_calibration(calibration);
    answer.figure(key, label, d95, Unit::Micrometre);
    answer.number("peak_to_valley_m", "peak to valley", form.peak_to_valley_m, Unit::Micrometre);
}

pub(super) fn step(args: &StepArgs) -> anyhow::Result<Answer> {
    let region = args.region.unwrap_or(Region::ALL);
    // Profiles along the stripe need no motion.
    let read = if args.direction == "y" { surface_points } else { points };
    let (scanned, results) = read(&args.common, &region)?;
    let measured = |surface: &Surface, edges_m| {
        let transposed = (args.direction == "y").then(|| surface.transposed());
        step_height::measure(transposed.as_ref().unwrap_or(surface), edges_m)
    };
    let step = measured(&scanned.surface, args.edges)?;
    let mut answer = Answer::new("step");
    input(&mut answer, &results, &[&scanned], scanned.surface.num_measured());
    answer.text_line("direction", "profiles along", &args.direction);
    let [by_height] = shares(&mut answer, &results, &[&scanned], |s| {
        Ok([measured(&s[0], Some(step.edges_m))?.height_m])
    });
    let height = Figure::with_u95(step.height_m, step.sigma_m, step.u95_m);
    let height = height.with_calibration(by_height);
    answer.figure("height_m", "step height", height, Unit::Micrometre);
    answer.number(
        "inclination_rad",
        "inclination beside it",
        step.inclination_rad,
        Unit::Milliradian,
    );
    if step.inclination_rad > INCLINED_RAD {
        let along_normal_um = 1e6 * step.height_m * step.inclination_rad.cos();
        let note = format!(
            "the height is along z, but the surface is inclined: perpendicular to it the step is {along_normal_um:.3} µm. \
             laser_profiler calibrate level brings its base level"
        );
        answer.text_line("inclined", "note", &note);
    }
    answer.place("edges_m", "edges", &step.edges_m);
    answer.number(
        "profile_sigma_m",
        "sigma of one profile",
        step.profile_sigma_m,
        Unit::Micrometre,
    );
    answer.count("profiles_used", "profiles used", step.num_profiles as u64);
    answer.count("profiles_rejected", "profiles with too few points", step.num_rejected as u64);
    answer.number("effective", "independent profiles", step.effective_profiles, Unit::None);
    Ok(answer)
}

pub(super) fn sphere(args: &PlaneArgs) -> anyhow::Result<Answer> {
    let region = args.region.unwrap_or(Region::ALL);
    let (scanned, results) = surface_points(&args.common, &region)?;
    let sphere = sphere::fit(&scanned.surface)?;
    let mut answer = Answer::new("sphere");
    input(&mut answer, &results, &[&scanned], sphere.num_points);
    let by = shares(&mut answer, &results, &[&scanned], |s| Ok(numbers(&sphere::fit(&s[0])?)));
    add_sphere(&mut answer, &sphere, by);
    Ok(answer)
}

/// Returns centre, radius and form.
fn numbers(sphere: &SphereFit) -> [f64; 5] {
    let center = sphere.center_m;
    [center.x, center.y, center.z, sphere.radius_m, sphere.form.d95_m]
}

fn add_sphere(answer: &mut Answer, sphere: &SphereFit, calibration: [Option<f64>; 5]) {
    for (at, key) in ["center_x_m", "center_y_m", "center_z_m"].into_iter().enumerate() {
        let figure = Figure::new(sphere.center_m[at], sphere.center_sigma_m()[at]);
        let figure = figure.with_calibration(calibration[at]);
        answer.figure(key, &format!("centre {}", &key[7..8]), figure, Unit::Millimetre);
    }
    let radius = Figure::new(sphere.radius_m, sphere.radius_sigma_m());
    let radius = radius.with_calibration(calibration[3]);
    answer.figure("radius_m", "radius", radius, Unit::Millimetre);
    answer.number("scatter_m", "scatter (robust sigma)", sphere.scatter_m, Unit::Micrometre);
    form(answer, "form_d95_m", "form D95 %", sphere.form, calibration[4]);
    answer.count("outliers", "outliers", sphere.num_outliers as u64);
    answer.number("effective", "independent points", sphere.effective_points, Unit::None);
}

pub(super) fn spheres(args: &SpheresArgs) -> anyhow::Result<Answer> {
    let [first, second] = args.region[..] else {
        return Err(Usage("spheres needs two --region".into()).into());
    };
    let mut answer = Answer::new("spheres");
    let (one, results) = surface_points(&args.common, &first)?;
    let (other, _) = surface_points(&args.common, &second)?;
    let fits = [
        sphere::fit(&one.surface).context("sphere 1")?,
        sphere::fit(&other.surface).context("sphere 2")?,
    ];
    input(&mut answer, &results, &[&one, &other], fits[0].num_points + fits[1].num_points);
    let by = shares(&mut answer, &results, &[&one, &other], |s| {
        let fits = [sphere::fit(&s[0])?, sphere::fit(&s[1])?];
        let [a, b] = fits.each_ref().map(numbers);
        let mut all = [0.0; 11];
        all[..5].copy_from_slice(&a);
        all[5..10].copy_from_slice(&b);
        all[10] = sphere::distance_m(&fits[0], &fits[1])[0];
        Ok(all)
    });
    let mut parts = Vec::new();
    for (number, fit) in fits.iter().enumerate() {
        answer.heading(&format!("sphere {}", number + 1));
        let mut part = Answer::new("sphere");
        add_sphere(&mut part, fit, [0, 1, 2, 3, 4].map(|i| by[5 * number + i]));
        parts.push(answer.absorb(part));
    }
    let [distance, sigma] = sphere::distance_m(&fits[0], &fits[1]);
    answer.heading("both");
    let distance = Figure::new(distance, sigma).with_calibration(by[10]);
    answer.figure("distance_m", "distance between centres", distance, Unit::Millimetre);
    answer.hidden("spheres", json!(parts));
    Ok(answer)
}

pub(super) fn volume(args: &VolumeArgs) -> anyhow::Result<Answer> {
    let (scanned, results) = surface_points(&args.common, &Region::ALL)?;
    let surface = &scanned.surface;
    let region = args.region.unwrap_or_else(|| surface.extent());
    let is_reference = |x: f64, y: f64| match &args.reference[..] {
        [] => args.region.is_none() || !region.contains(x, y),
        regions => regions.iter().any(|reference| reference.contains(x, y)),
    };
    let is_base: Vec<bool> = surface.points.iter().map(|p| is_reference(p.x, p.y)).collect();
    let plane = plane::fit_where(surface, &is_base).context("the reference plane")?;
    ensure!(
        plane.normal.z > 0.1,
        "the reference plane is inclined by {:.0} degrees: a volume over it is meaningless",
        plane.tilt_rad().to_degrees()
    );
    let pitch_m = surface.pitch_m();
    let cell_m = args.cell.unwrap_or_else(|| pitch_m[0].max(pitch_m[1]));
    let layout = GridLayout::covering(&region, cell_m)?;
    let inside = surface.points.iter().filter(|p| is_measured(p) && region.contains(p.x, p.y));
    let num_inside = inside.count();
    let effective = plane.effective_among(num_inside);
    let over = |surface: &Surface, plane: &PlaneFit| {
        let mut resampler = Resampler::new(layout, pitch_m);
        surface.rows().for_each(|row| resampler.push(row));
        volume::over_plane(&resampler.finish(), &region, plane, plane.scatter_m, effective)
    };
    let found = over(surface, &plane);
    let mut answer = Answer::new("volume");
    input(&mut answer, &results, &[&scanned], num_inside);
    let [by_volume] = shares(&mut answer, &results, &[&scanned], |s| {
        Ok([over(&s[0], &plane::fit_where(&s[0], &is_base)?).volume_m3])
    });
    let figure = Figure::new(found.volume_m3, found.sigma_m3).with_calibration(by_volume);
    answer.figure("volume_m3", "volume", figure, Unit::CubicMillimetre);
    answer.number("above_m3", "above the plane", found.above_m3, Unit::CubicMillimetre);
    answer.number("below_m3", "below the plane", found.below_m3, Unit::CubicMillimetre);
    answer.number("area_m2", "measured area", found.area_m2, Unit::SquareMillimetre);
    answer.number("missing_m2", "area without points", found.missing_m2, Unit::SquareMillimetre);
    answer.number("cell_m", "cell", cell_m, Unit::Millimetre);
    answer.number("scatter_m", "scatter on the reference", plane.scatter_m, Unit::Micrometre);
    Ok(answer)
}
