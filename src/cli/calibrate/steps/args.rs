//! The arguments of `calibrate steps`.

use std::path::PathBuf;

use crate::cli::{
    Usage,
    length::{length_m, positive_m},
    output,
    settings::SettingsArgs,
};

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
      three recordings; only assesses the accuracy of heights

Heights: three different ones or more, in metres or with a unit (mm, um); four or more give the uncertainty. Heights alone
determine three numbers of h = (p v + q) / (r v + 1), v across the stripe; with terms along it five, which are used if they fit
better than by chance. They do not determine the scale along the stripe: -o needs --lateral, --pitch, or --pixel-pitch with a
distance. The stripe is extracted as in the node, with the same parameters (roi.* selects a region of interest).

--json prints one object:
  model (across | both | vertical_incidence), rms_m, rms_left_out_m, linearity (largest residual over the range of heights),
  degrees_of_freedom, sigma_m, u95_m (of a height; null without redundancy), lateral_m_per_px (at height 0), geometry, output
  heights: [{source, height_m, measured_m, residual_m, left_out_m, noise_m, along_px: [from, to], across_px, sigma_px, points}]";

/// Calibrates from pictures of known heights: a step gauge, gauge blocks, or a flat moved by known amounts.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli::calibrate) struct StepsArgs {
    /// A PNG or JPEG file or a recording, and the heights it shows in their order along the stripe.
    #[arg(value_name = "SOURCE=HEIGHT[,HEIGHT]", required = true, value_parser = source)]
    pub(super) sources: Vec<Source>,
    /// The calibration, a YAML file.
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Option<PathBuf>,
    /// Replaces an existing file.
    #[arg(long)]
    pub(super) force: bool,
    /// Length of a pixel along the stripe at height 0, in the middle of the picture.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m)]
    pub(super) lateral: Option<f64>,
    /// Width of every plateau between two others of one picture.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, conflicts_with = "lateral")]
    pub(super) pitch: Option<f64>,
    /// Pixel pitch of the sensor. Together with one of the distances it selects formula 6.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, conflicts_with_all = ["lateral", "pitch"])]
    pub(super) pixel_pitch: Option<f64>,
    /// a: from the lens to the sensor, near the focal length.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, requires = "pixel_pitch")]
    pub(super) image_distance: Option<f64>,
    /// b: from the lens to the base point, as measured by a ruler.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m, requires = "pixel_pitch",
        conflicts_with = "image_distance")]
    pub(super) object_distance: Option<f64>,
    /// Parameters to estimate; auto adds terms along the stripe if they fit better than by chance.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = ["auto", "across", "both"])]
    pub(super) terms: String,
    /// Frame of the profiles.
    #[arg(long, value_name = "NAME", default_value = "laser_plane")]
    pub(super) frame_id: String,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) settings: SettingsArgs,
}

/// A picture or recording and its heights.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) heights_m: Vec<f64>,
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

impl StepsArgs {
    /// Checks everything that does not depend on the pictures.
    ///
    /// # Errors
    /// An output without a lateral scale, a pixel pitch without a distance, an output that exists.
    pub(super) fn check(&self) -> Result<(), Usage> {
        let has_distance = self.image_distance.is_some() || self.object_distance.is_some();
        if self.pixel_pitch.is_some() && !has_distance {
            return Err(Usage("--pixel-pitch needs --image-distance or --object-distance".into()));
        }
        let has_scale = self.lateral.is_some() || self.pitch.is_some() || has_distance;
        if self.output.is_some() && !has_scale {
            return Err(Usage(
                "heights do not determine the scale along the stripe: -o needs --lateral LENGTH (a pixel at height 0), \
                 --pitch LENGTH (the width of a plateau), or --pixel-pitch with --image-distance or --object-distance; \
                 without -o only the heights are assessed"
                    .into(),
            ));
        }
        match &self.output {
            Some(path) if !self.force => {
                output::refuse_existing(path).map_err(|error| Usage(error.to_string()))
            }
            _ => Ok(()),
        }
    }
}
