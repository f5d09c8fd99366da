//! The arguments of `calibrate steps`.

use std::path::PathBuf;

use crate::{
    calibrate::GaugeHeight,
    cli::{
        Usage,
        length::{UncertainLength, length_m, positive_m, positive_uncertain_m, uncertain_m},
        output,
        settings::SettingsArgs,
    },
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
  laser_profiler calibrate steps flat_at_0=0mm flat_at_5=5mm±1um flat_at_9=9mm±1um --ros-args -p stripe_direction:=vertical
      three recordings of gauge blocks with a certificate; only assesses the accuracy of heights
  laser_profiler calibrate steps a.png=0mm,3.68mm,0mm b.png=0mm,9.14mm,0mm --differences --gauge-sigma 1um --lateral 22um -o rig.yaml
      a block on a bed that drifts between the pictures: only the height over the bed is known

Heights: three different ones or more, in metres or with a unit (mm, um). 3.68mm±0.002mm (or +-) states one standard deviation:
half of the expanded uncertainty (k = 2) of a certificate; --gauge-sigma states that of all others. A height that is given several
times has the same error each time. Without a stated uncertainty it is estimated from the residuals, which takes one more height than
the map has unknowns: four or more; 0 is exact beside stated uncertainties. Both go into the calibration, and from there into `measure`.
The file also states the part of the image and the heights that the gauge covered (`volume`): points outside are flagged.

Lens distortion curves the line of a flat, which the map cannot follow. It is reported, and widens the uncertainty. Flats over the
whole width show it best; `calibrate camera` and `calibrate plane`, with a board, remove it.

Heights alone determine three numbers of h = (p v + q) / (r v + 1), v across the stripe; with terms along it five, which are used if they fit
better than by chance. They do not determine the scale along the stripe: -o needs --lateral, --pitch, or --pixel-pitch with a
distance. The stripe is extracted as in the node, with the same parameters (roi.* selects a region of interest).

--json prints one object:
  model (across | both | vertical_incidence), rms_m, rms_left_out_m, linearity (largest residual over the range of heights),
  degrees_of_freedom (different heights beyond the unknowns), sigma_m, u95_m (of a height), gauge_stated (false: estimated from the
  residuals), excess (residuals over what the stated uncertainty explains, if they contradict it: all uncertainties are widened),
  line_curvature_m (of a flat's line over the used columns), line_curvature_significant (true: all uncertainties are widened),
  height_sign (with --any-order), offsets_m (of the pictures' zeros, with --differences), lateral_m_per_px (at height 0), geometry,
  output
  heights: [{source, height_m, gauge_sigma_m, measured_m, residual_m, left_out_m, noise_m, along_px: [from, to], across_px, sigma_px, points}]";

/// Calibrates from pictures of known heights: a step gauge, gauge blocks, or a flat moved by known amounts.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli::calibrate) struct StepsArgs {
    /// A PNG or JPEG file or a recording, and the heights it shows in their order along the stripe, each with or without
    /// its standard deviation: base.png=0mm, gauge.png=0mm,3.68mm±0.002mm,0mm.
    #[arg(value_name = "SOURCE=HEIGHT[,HEIGHT]", required = true, value_parser = source)]
    pub(super) sources: Vec<Source>,
    /// The calibration, a YAML file.
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Option<PathBuf>,
    /// Replaces an existing file.
    #[arg(long)]
    pub(super) force: bool,
    #[command(flatten)]
    pub(super) gauge: GaugeArgs,
    /// Length of a pixel along the stripe at height 0, in the middle of the picture; 22um±0.1um with a standard deviation.
    #[arg(long, value_name = "LENGTH", value_parser = positive_uncertain_m)]
    pub(super) lateral: Option<UncertainLength>,
    /// Width of every plateau between two others of one picture; 5mm±2um with a standard deviation.
    #[arg(long, value_name = "LENGTH", value_parser = positive_uncertain_m, conflicts_with = "lateral")]
    pub(super) pitch: Option<UncertainLength>,
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

/// Knowledge of the heights.
#[derive(Debug, clap::Args)]
pub(super) struct GaugeArgs {
    /// One standard deviation of every height without a stated one.
    #[arg(long, value_name = "LENGTH", value_parser = not_negative_m)]
    pub(super) gauge_sigma: Option<f64>,
    /// Heights are known only relative to the others in the same picture: the bed drifts from picture to picture. The
    /// first picture defines height 0.
    #[arg(long)]
    pub(super) differences: bool,
    /// The heights of a picture are in any order, one for each plateau: the fit decides which is which.
    #[arg(long)]
    pub(super) any_order: bool,
    /// With --any-order, where the fit cannot decide: -1 if a higher surface lies at smaller rows (columns, for a vertical
    /// stripe), 1 if at larger ones.
    #[arg(long, value_name = "SIGN", requires = "any_order", allow_hyphen_values = true,
        value_parser = clap::value_parser!(i8).range(-1..=1))]
    pub(super) height_sign: Option<i8>,
}

/// A picture or recording and its heights.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) heights: Vec<GaugeHeight>,
}

fn source(text: &str) -> Result<Source, String> {
    let Some((path, heights)) = text.rsplit_once('=') else {
        return Err("a height is missing: FILE=HEIGHT, as in base.png=0mm".to_owned());
    };
    let height = |text| {
        let UncertainLength { length_m: height_m, sigma_m } = uncertain_m(text)?;
        // Adding 0 turns -0 into 0: both are one height.
        Ok(GaugeHeight { height_m: height_m + 0.0, sigma_m })
    };
    let heights = heights.split(',').map(height).collect::<Result<Vec<_>, String>>()?;
    Ok(Source { path: path.into(), heights })
}

fn not_negative_m(text: &str) -> Result<f64, String> {
    match length_m(text)? {
        length if length >= 0.0 => Ok(length),
        _ => Err(format!("{text:?} must be 0 or more")),
    }
}

impl StepsArgs {
    /// Checks everything that does not depend on the pictures.
    ///
    /// # Errors
    /// An output without a lateral scale, a pixel pitch without a distance, an output that exists.
    pub(super) fn check(&self) -> Result<(), Usage> {
        for Source { path, heights } in &self.sources {
            let is_same =
                |pair: &[GaugeHeight]| pair[0].height_m.total_cmp(&pair[1].height_m).is_eq();
            if !self.gauge.any_order && heights.windows(2).any(is_same) {
                let name = path.display();
                let text =
                    format!("{name}: two neighbouring plateaus of one height are one plateau");
                return Err(Usage(text));
            }
        }
        if self.gauge.height_sign == Some(0) {
            return Err(Usage("--height-sign is -1 or 1".into()));
        }
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
