//! `laser_profiler export`: a scan as files in common formats.

mod cloud;
mod csv;
mod grid;

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::Context;
use nalgebra::Isometry3;
use serde_json::{Value as Json, json};

use super::{
    Outcome, Usage, height_picture,
    length::{interval_m, positive_m, region},
    output,
    results_args::ResultsArgs,
};
use crate::{
    metrology::{
        height_map::{CellState, RegularHeightMap, fill_gaps},
        plane,
        surface::Region,
    },
    results::{ANY_HEIGHT_M, Outline, Placing, ReadCounts, Results},
};
use cloud::{CloudFormat, CloudWriter};

const HELP: &str = "\
Examples:
  laser_profiler export results -o part.ply                        a binary point cloud with intensity
  laser_profiler export results -o part.ply --color height         the same with colours
  laser_profiler export results -o map.png -o map.tif --cell 50um  height maps, 16-bit integer and 32-bit float
  laser_profiler export results --picture part.png --level         a levelled picture

Formats by file extension:
  .ply   x, y, z, intensity as 32-bit floats in metres, binary little endian; with --color also red, green, blue
  .pcd   x, y, z, intensity as 32-bit floats in metres, binary (PCL 0.7)
  .csv   one point per line: frame, stamp_ns, position, x_m, z_m, intensity, sigma_z_m (the point's own noise), flags,
         calibration_sigma_z_m (common to neighbouring points; NaN if the calibration states none) of every profile; with --region,
         --heights or --level, or if the recording has no profiles: x_m, y_m, z_m, intensity of the cloud
  .png   16-bit heights: level 0 is invalid, otherwise z = offset_m + level * metres_per_level; the numbers are in the file (tEXt)
         and in FILE.json
  .tif   heights in metres as 32-bit floats, NaN if invalid; the grid is in ImageDescription and in FILE.json
The first row of a height map has the smallest y. A cell is the mean over its area of the surface through neighbouring points. Cells
without points are invalid; --fill N fills gaps of at most N cells and marks them in FILE.mask.png
(0 invalid, 1 measured, 2 filled).

--json prints one object: topic, profiles, points, rejected (clouds, and profiles of a .csv), from_m and to_m ([x, y, z]), files: [{path, format, …}]";

/// Exports a scan as point cloud (PLY, PCD, CSV), height map (16-bit PNG, 32-bit TIFF) or picture.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct ExportArgs {
    #[command(flatten)]
    results: ResultsArgs,
    /// Output file. The extension selects the format: ply, pcd, csv, png, tif. May be repeated.
    #[arg(short, long, value_name = "FILE", required_unless_present = "picture")]
    output: Vec<PathBuf>,
    /// PNG picture: shaded heights in colour, with axes and scale.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Only points in x0,y0,x1,y1.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    region: Option<Region>,
    /// Only heights from LOW to HIGH, before levelling.
    #[arg(long, value_name = "LOW,HIGH", value_parser = interval_m, allow_hyphen_values = true)]
    heights: Option<[f64; 2]>,
    /// Level the scan: move the robust plane through its points to height 0.
    #[arg(long)]
    level: bool,
    /// Level the scan by the plane through the points in x0,y0,x1,y1.
    #[arg(long, value_name = "REGION", value_parser = region, allow_hyphen_values = true)]
    level_on: Option<Region>,
    /// Cell size of height maps and pictures. Default: the geometric mean of the point distances along x and y.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m)]
    cell: Option<f64>,
    /// Fill gaps of at most CELLS cells in height maps and pictures.
    #[arg(long, value_name = "CELLS", default_value_t = 0)]
    fill: usize,
    /// Colours of a PLY file.
    #[arg(long, value_name = "NAME", default_value = "none", value_parser = ["none", "height"])]
    color: String,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
}

impl ExportArgs {
    const fn is_leveled(&self) -> bool {
        self.level || self.level_on.is_some()
    }
}

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Cloud(CloudFormat),
    Csv,
    Png,
    Tiff,
}

impl Format {
    fn of(path: &Path) -> Result<Self, Usage> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("ply") => Ok(Self::Cloud(CloudFormat::Ply)),
            Some("pcd") => Ok(Self::Cloud(CloudFormat::Pcd)),
            Some("csv") => Ok(Self::Csv),
            Some("png") => Ok(Self::Png),
            Some("tif" | "tiff") => Ok(Self::Tiff),
            _ => Err(Usage(format!(
                "{}: unknown extension; use .ply, .pcd, .csv, .png or .tif",
                path.display()
            ))),
        }
    }

    const fn is_grid(self) -> bool {
        matches!(self, Self::Png | Self::Tiff)
    }
}

/// Counts of a written point file.
#[derive(Clone, Copy, Debug, Default)]
struct Written {
    num_points: u64,
    /// Messages that could not be read.
    num_lost: u64,
}

/// Exports a scan and lists the files on `out`.
///
/// # Errors
/// [`Usage`] for an unknown extension or an ambiguous selection; a recording without points, a file that exists or cannot
/// be written.
pub(crate) fn run(args: &ExportArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let formats: Vec<(&Path, Format)> = args
        .output
        .iter()
        .map(|path| Format::of(path).map(|format| (path.as_path(), format)))
        .collect::<Result<_, _>>()?;
    for path in args.output.iter().chain(&args.picture) {
        if !args.force {
            output::refuse_existing(path)?;
        }
    }
    let results = Results::open(&args.results.selection())?;
    let region = args.region.unwrap_or(Region::ALL);
    let heights_m = args.heights.unwrap_or(ANY_HEIGHT_M);
    let motion = motion(args, &results, &region)?;
    let placing = Placing { region, heights_m, motion };
    let outline = results.outline(&placing)?;
    warn_of_one_place(&formats, &results);
    let (mut files, num_lost) = clouds(args, &formats, &results, &placing, &outline)?;
    let counts = ReadCounts { rejected: outline.counts.rejected + num_lost, ..outline.counts };
    if args.picture.is_some() || formats.iter().any(|(_, format)| format.is_grid()) {
        let cell_m = args.cell.map_or_else(|| outline.cell_m(), Ok)?;
        let map = results.height_map(&placing, &outline, cell_m)?;
        let map = filled(map, args.fill);
        files.extend(grids(args, &formats, &results, &map)?);
    }
    let text = report(args, &results, &outline, counts, &files);
    output::print(out, &text)?;
    Ok(Outcome::with_losses(counts.rejected))
}

/// Warns if points of a single place are written: unlike a height map they can be, but they are no surface.
fn warn_of_one_place(formats: &[(&Path, Format)], results: &Results) {
    let is_cloud = |(_, format): &(&Path, Format)| matches!(format, Format::Cloud(_));
    if formats.iter().any(is_cloud)
        && let Err(error) = results.check_surface()
    {
        tracing::warn!("the points are no surface: {error}");
    }
}

/// Returns the motion that levels the scan.
fn motion(
    args: &ExportArgs,
    results: &Results,
    region: &Region,
) -> anyhow::Result<Option<Isometry3<f64>>> {
    if !args.is_leveled() {
        return Ok(None);
    }
    let region = args.level_on.as_ref().unwrap_or(region);
    results.check_surface().context("--level")?;
    let scanned = results.surface(region, args.heights.unwrap_or(ANY_HEIGHT_M))?;
    let plane = plane::fit(&scanned.surface).context("--level")?;
    Ok(Some(plane::leveling(&plane)))
}

/// Writes the point files.
fn clouds(
    args: &ExportArgs,
    formats: &[(&Path, Format)],
    results: &Results,
    placing: &Placing,
    outline: &Outline,
) -> anyhow::Result<(Vec<Json>, u64)> {
    let (mut files, mut num_lost) = (Vec::new(), 0);
    for &(path, format) in formats {
        let written = match format {
            Format::Cloud(format) => write_whole(path, |file| {
                let scale_m = (args.color == "height").then_some(outline.color_scale_m());
                let mut writer = CloudWriter::begin(file, format, outline.num_points, scale_m)?;
                results.for_each_profile(|row| {
                    placing.points(row).try_for_each(|point| writer.point(&point))?;
                    Ok(())
                })?;
                writer.finish()
            }),
            Format::Csv => write_whole(path, |file| csv::write(file, args, results, placing)),
            Format::Png | Format::Tiff => continue,
        };
        let written = written.with_context(|| path.display().to_string())?;
        num_lost += written.num_lost;
        let format = path.extension().map(|ending| ending.to_string_lossy().into_owned());
        files.push(json!({"path": path, "format": format, "points": written.num_points}));
    }
    Ok((files, num_lost))
}

/// Writes a file; removes it on failure.
fn write_whole<T>(
    path: &Path,
    write: impl FnOnce(&mut std::io::BufWriter<fs::File>) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let mut file = std::io::BufWriter::new(fs::File::create(path)?);
    let written = write(&mut file).and_then(|written| {
        file.flush()?;
        Ok(written)
    });
    // A pipe or a device is not ours to remove.
    if written.is_err() && fs::symlink_metadata(path).is_ok_and(|path| path.is_file()) {
        // The first error is the one to report.
        drop(fs::remove_file(path));
    }
    written
}

fn filled(mut map: RegularHeightMap, max_gap: usize) -> RegularHeightMap {
    if max_gap > 0 {
        fill_gaps(&mut map, max_gap);
    }
    map
}

/// Writes height maps and picture.
fn grids(
    args: &ExportArgs,
    formats: &[(&Path, Format)],
    results: &Results,
    map: &RegularHeightMap,
) -> anyhow::Result<Vec<Json>> {
    let mut files = Vec::new();
    let about = grid::about(map, results.topic());
    for &(path, format) in formats.iter().filter(|(_, format)| format.is_grid()) {
        let metadata = match format {
            Format::Png => grid::write_png(path, map, &about),
            _ => grid::write_tiff(path, map, &about),
        };
        let mut metadata = metadata.with_context(|| path.display().to_string())?;
        let beside = |ending: &str| {
            let mut name = path.as_os_str().to_owned();
            name.push(ending);
            PathBuf::from(name)
        };
        if args.fill > 0 {
            let mask = beside(".mask.png");
            grid::write_mask(&mask, map).with_context(|| mask.display().to_string())?;
            metadata["mask"] = json!(mask.file_name().map(|name| name.to_string_lossy()));
        }
        let sidecar = beside(".json");
        fs::write(&sidecar, format!("{metadata:#}\n"))
            .with_context(|| sidecar.display().to_string())?;
        metadata["path"] = json!(path);
        files.push(metadata);
    }
    if let Some(path) = &args.picture {
        height_picture::save(path, results.topic(), map)?;
        files.push(json!({"path": path, "format": "picture"}));
    }
    Ok(files)
}

fn report(
    args: &ExportArgs,
    results: &Results,
    outline: &Outline,
    counts: ReadCounts,
    files: &[Json],
) -> String {
    if args.json {
        let object = json!({
            "topic": results.topic(),
            "profiles": counts.profiles,
            "points": outline.num_points,
            "rejected": counts.rejected,
            "from_m": outline.from_m,
            "to_m": outline.to_m,
            "files": files,
        });
        format!("{object}\n")
    } else {
        let line = |file: &Json| {
            let path = file["path"].as_str().unwrap_or_default();
            match (file["points"].as_u64(), file["cell_m"].as_f64()) {
                (Some(points), _) => format!("{path}: {points} points\n"),
                (_, Some(cell_m)) => format!(
                    "{path}: {} x {} cells of {:.1} µm, {} measured, {} filled\n",
                    file["width"],
                    file["height"],
                    1e6 * cell_m,
                    file["measured"],
                    file["filled"]
                ),
                _ => format!("{path}: a picture\n"),
            }
        };
        files.iter().map(line).collect()
    }
}

/// Returns the numbers of measured and of filled cells.
fn counts(map: &RegularHeightMap) -> [usize; 2] {
    [CellState::Measured, CellState::Filled].map(|state| map.count(state))
}
