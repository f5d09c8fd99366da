//! `laser_profiler demo`: replays the bundled recording through the node, draws the results and prints the defects.

use std::{
    cmp::Ordering,
    fmt::Write as _,
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use nalgebra::Point3;

use super::{Outcome, output, replaying::replay};
use crate::{
    metrology::{
        deviation::{Deviation, deviations},
        part::inside_part,
        surface::{Region, Surface, is_measured},
    },
    node::{replay::ReplayRequest, statistics::Summary, stop::Stop},
    results::{ANY_HEIGHT_M, Results, ScanSelection},
    ros::arguments::RosArguments,
    simulate::scenario::Scenario,
};
use truth::{known_defects, nearest};

pub(crate) mod truth;
pub(crate) mod picture;

/// Smallest height or depth of a defect, metres.
const THRESHOLD_M: f64 = 60e-6;
/// Smallest area of a defect, square metres: smaller ones are noise.
const MIN_AREA_M2: f64 = 0.3e-6;
/// Largest distance of a defect found from its true place, metres.
const REACH_M: f64 = 2e-3;
/// Number of columns on either side that the blur of the default parameters mixes into a column.
const BLUR_REACH: usize = 3;

/// Files of the bundled recording: path and content.
const FILES: [(&str, &[u8]); 4] = [
    (
        "film_defects/film_defects_0.mcap",
        include_bytes!("../../bags/film_defects/film_defects_0.mcap"),
    ),
    ("film_defects/metadata.yaml", include_bytes!("../../bags/film_defects/metadata.yaml")),
    ("film_defects/calibration.yaml", include_bytes!("../../bags/film_defects/calibration.yaml")),
    ("film_defects.params.yaml", include_bytes!("../../bags/film_defects.params.yaml")),
];
const SCENARIO: &str = include_str!("../../bags/film_defects.scenario.yaml");

const HELP: &str = "\
Example:
  laser_profiler demo -o film      writes film/height_map.png, film/profile.png and the recordings";

/// Replays the bundled recording, draws the measured heights and prints the defects found.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct DemoArgs {
    /// Directory for the recording, the results and the pictures; replaces those of an earlier demo.
    #[arg(short, long, value_name = "DIR", default_value = "demo")]
    pub(crate) output: PathBuf,
}

/// A measured scan, its defects and the ground truth.
#[derive(Debug)]
struct Findings {
    surface: Surface,
    scenario: Scenario,
    deviations: Vec<Deviation>,
}

/// Replays the bundled recording, draws its results and prints a report to `out`.
///
/// Returns [`Outcome::DataLost`] if more frames are missing than the recording lacks.
///
/// # Errors
/// A directory that cannot be written, results that cannot be read, no defect found.
pub(crate) fn run(args: &DemoArgs, out: &mut dyn Write) -> Result<Outcome> {
    let directory = &args.output;
    let request = unpack(directory)?;
    let results = request.output.clone();
    let summary = replay(request, &Stop::default())?;
    let findings = Findings::read(&results)?;
    findings.draw(directory)?;
    let report = findings.report(&summary, directory)?;
    output::print(out, &report)?;
    // The recording lacks frames on purpose; no other frame may be missing.
    let is_as_recorded = summary.counts.lost() == findings.scenario.dropped_frames.len() as u64
        && summary.counts.received == summary.counts.processed;
    Ok(if is_as_recorded { Outcome::Done } else { Outcome::DataLost })
}

/// Writes the bundled recording and its parameters into a directory and returns the request that replays it.
fn unpack(directory: &Path) -> Result<ReplayRequest> {
    let recording = directory.join("film_defects");
    fs::create_dir_all(&recording)
        .with_context(|| format!("cannot create {}", recording.display()))?;
    for (name, content) in FILES {
        let path = directory.join(name);
        fs::write(&path, content).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let parameters = directory.join("film_defects.params.yaml");
    Ok(ReplayRequest {
        bags: vec![recording],
        output: directory.join("results"),
        force: true,
        ros: RosArguments { parameter_files: vec![parameters], ..RosArguments::default() },
        ..ReplayRequest::default()
    })
}

impl Findings {
    /// Reads the scan from the results and searches it for defects.
    fn read(results: &Path) -> Result<Self> {
        let selection = ScanSelection { bag: results.to_owned(), ..ScanSelection::default() };
        let scanned = Results::open(&selection)?.surface(&Region::ALL, ANY_HEIGHT_M)?;
        let rejected = scanned.counts.rejected;
        ensure!(rejected == 0, "{rejected} point clouds of the results cannot be read");
        let surface = scanned.surface;
        let deviations = deviations(&surface, THRESHOLD_M, MIN_AREA_M2);
        Ok(Self { surface, scenario: Scenario::from_yaml(SCENARIO)?, deviations })
    }

    fn draw(&self, directory: &Path) -> Result<()> {
        let part = inside_part(&self.surface, BLUR_REACH);
        let heights_m = part.measured().map(|(_, point)| point.z as f32);
        let scale_m = picture::range_of(heights_m).context("nothing was measured")?;
        let title = "Film of a simulated cell: height above the table";
        picture::save_height_map(&directory.join("height_map.png"), title, &self.surface, scale_m)?;
        let top = self.deviations.first().context("no defect was found")?;
        let (position_m, profile) = (part.rows())
            .filter_map(|row| Some((row.iter().find(|point| is_measured(point))?.y, row)))
            .min_by(|(a, _), (b, _)| nearer(top.center_m[1], *a, *b))
            .context("nothing was measured")?;
        let truth_m: Vec<f64> = profile.iter().map(|point| self.true_height_m(point)).collect();
        let title = format!("Cross-section at y = {:.1} mm", 1e3 * position_m);
        picture::save_profile(&directory.join("profile.png"), &title, profile, &truth_m)
    }

    /// Returns the height of the scenario's part under a measured point, metres; the first frame lies at y = 0.
    fn true_height_m(&self, point: &Point3<f64>) -> f64 {
        self.scenario.part.surface(point.x, point.y + self.scenario.motion.start_m).height_m
    }

    fn report(&self, summary: &Summary, directory: &Path) -> Result<String> {
        let counts = &summary.counts;
        let mut text = format!(
            "A simulated cell with a film went through the node: {} frames measured, {} lost (the recording lacks \
             them on purpose),\n{} points in {} slices, {:.2} s.\n\n",
            counts.processed,
            counts.lost(),
            counts.points,
            counts.slices,
            summary.elapsed.as_secs_f64(),
        );
        let limit_um = 1e6 * THRESHOLD_M;
        writeln!(text, "Deviations from the film's smooth shape by more than {limit_um:.0} µm:\n")?;
        self.write_table(&mut text)?;
        let file = |name: &str| directory.join(name).display().to_string();
        write!(
            text,
            "
See    {map}  {profile}
Data   {results}
       Foxglove  app.foxglove.dev, Open local file; a 3D panel shows /laser_profiler/points_dense,
                 an Image panel /laser_profiler/height_map
       Rerun     convert it first: launch_configs/viewers/to_rerun.py in the repository
Again  laser_profiler replay {recording} -o again --params-file {parameters}
",
            map = file("height_map.png"),
            profile = file("profile.png"),
            results = file("results/results_0.mcap"),
            recording = file("film_defects"),
            parameters = file("film_defects.params.yaml"),
        )?;
        Ok(text)
    }

    fn write_table(&self, text: &mut String) -> Result<()> {
        let known = known_defects(&self.scenario);
        writeln!(text, "   x [mm]   y [mm]   area [mm²]   height [µm]   true height [µm]")?;
        for found in &self.deviations {
            let [x_mm, y_mm] = found.center_m.map(|metres| 1e3 * metres);
            let (area_mm2, height_um) = (1e6 * found.area_m2, 1e6 * found.height_m);
            write!(text, "  {x_mm:7.1}  {y_mm:7.1}  {area_mm2:11.1}  {height_um:+12.0}")?;
            match nearest(&known, found.center_m, REACH_M) {
                Some(known) => writeln!(text, "  {:+17.0}  {}", 1e6 * known.height_m, known.name)?,
                None => writeln!(text, "  {:>17}", "none")?,
            }
        }
        Ok(())
    }
}

/// Orders two positions by their distance from `goal`.
fn nearer(goal: f64, a: f64, b: f64) -> Ordering {
    (a - goal).abs().total_cmp(&(b - goal).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_finds_the_defects_of_its_scenario_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let args = DemoArgs { output: directory.path().join("a demo: \"quoted\"") };
        let mut printed = Vec::new();
        assert_eq!(run(&args, &mut printed).unwrap(), Outcome::Done);
        let findings = Findings::read(&args.output.join("results")).unwrap();
        let known = known_defects(&findings.scenario);
        assert_eq!(findings.deviations.len(), known.len());
        for defect in &known {
            let found = (findings.deviations.iter())
                .find(|found| (found.height_m - defect.height_m).abs() < 15e-6)
                .unwrap();
            for axis in [0, 1] {
                assert!((found.center_m[axis] - defect.center_m[axis]).abs() < 0.3e-3);
            }
        }
        let printed = String::from_utf8(printed).unwrap();
        assert!(printed.contains("147 frames measured, 3 lost"), "{printed}");
        for name in ["height_map.png", "profile.png"] {
            assert!(image::open(args.output.join(name)).unwrap().width() > 1000);
        }
        assert_eq!(run(&args, &mut Vec::new()).unwrap(), Outcome::Done, "again, over the first");
    }
}
