//! Arguments of `calibrate camera`, `plane` and `axis`. A build without the feature `calibrate` has them too.

use std::path::PathBuf;

use crate::cli::settings::SettingsArgs;

const CAMERA_HELP: &str = "\
Hold the board into every part of the image, near and far, and tilt it by 20 to 40 degrees each way; 20 views are good.
Rejected views are reported, each with its reason.

Targets, lengths in metres:
  checkerboard:COLUMNSxROWS:SQUARE                 counts inner corners: 8x6 has 9 x 7 squares
  charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY]  counts squares, as OpenCV; MARKER is the side of a marker's black square;
                                                   4x4_50 if left out. May be partly hidden: its corners are numbered
  circles:COLUMNSxROWS:PITCH                       counts circles; PITCH is the distance of their centres
  asymmetric-circles:COLUMNSxROWS:PITCH            circles of a row and rows, as OpenCV: 4x11; PITCH is the distance of
                                                   neighbouring rows, half of that between the circles of a row

Examples:
  laser_profiler calibrate camera board_recording --target checkerboard:8x6:0.040 -o camera.yaml --report camera.png
  laser_profiler calibrate camera pictures --target charuco:10x7:0.030:0.022:5x5_100 -o camera.yaml
  laser_profiler calibrate camera pictures --target asymmetric-circles:4x11:0.020 --model equidistant -o camera.yaml
  laser_profiler calibrate camera pictures/*.png --target checkerboard:8x6:0.040 -o camera.yaml --json
  laser_profiler calibrate camera recording --target checkerboard:8x6:0.040 -o camera.yaml \\
      --ros-args -r image_raw:=/camera/image_raw";

/// Calibrates a camera, its lens included, from views of a target.
#[derive(Debug, clap::Args)]
#[command(after_help = CAMERA_HELP)]
pub(super) struct CameraArgs {
    /// Recordings, folders of pictures, pictures (PNG, JPEG, TIFF, BMP, PGM), quoted patterns, or videos.
    #[arg(value_name = "BAG|PICTURE", required = true)]
    pub(super) inputs: Vec<PathBuf>,
    /// The target: checkerboard, charuco, circles or asymmetric-circles with its sizes, see below.
    #[arg(long)]
    pub(super) target: String,
    /// Distortion model, as ROS names it. `rational_polynomial` suits wide-angle lenses, `equidistant` fisheyes
    /// (k1 to k4, as in OpenCV's fisheye).
    #[arg(long, default_value = "plumb_bob", value_parser = ["plumb_bob", "rational_polynomial", "equidistant"])]
    pub(super) model: String,
    /// Name of the camera in the file.
    #[arg(long, default_value = "camera")]
    pub(super) camera_name: String,
    #[command(flatten)]
    pub(super) output: OutputArgs,
    #[command(flatten)]
    pub(super) settings: SettingsArgs,
}

const PLANE_HELP: &str = "\
Hold the board into the laser near and far and tilted, with the line across its squares; 20 views are good. The node's
extraction finds the line, with these defaults: background local, threshold adaptive (5 sigmas), method steger, and in
colour pictures the laser's colour minus the mean of the others. A parameter file or -p changes them.

Examples:
  laser_profiler calibrate plane laser_on_board --target checkerboard:8x6:0.040 --camera camera.yaml -o rig.yaml \\
      --ros-args -p stripe_direction:=vertical
  laser_profiler calibrate plane pictures --target checkerboard:8x6:0.040 --camera camera.yaml -o rig.yaml --json";

/// Calibrates the plane of the laser from views of a target with the line on it.
#[derive(Debug, clap::Args)]
#[command(after_help = PLANE_HELP)]
pub(super) struct PlaneArgs {
    /// Recordings, folders of pictures, pictures (PNG, JPEG, TIFF, BMP, PGM), quoted patterns, or videos.
    #[arg(value_name = "BAG|PICTURE", required = true)]
    pub(super) inputs: Vec<PathBuf>,
    /// The target: checkerboard, charuco, circles or asymmetric-circles with its sizes, as for
    /// `calibrate camera`.
    #[arg(long)]
    pub(super) target: String,
    /// The camera: a file of `calibrate camera`, of ROS's `camera_calibration`, OpenCV or Kalibr, or a printed `camera_info`.
    #[arg(long = "camera", value_name = "FILE")]
    pub(super) camera_file: PathBuf,
    /// Width of the flat rim beyond the inner corners, in squares: 1 for the outermost squares, 1.5 with the usual rim,
    /// more for a larger plate. The search for the laser line extends that far.
    #[arg(long, default_value_t = 1.5, value_name = "SQUARES", value_parser = border)]
    pub(super) border: f64,
    /// Name of the profiles' frame, the laser plane.
    #[arg(long, default_value = "laser_plane")]
    pub(super) frame_id: String,
    /// ROS 2 parameter file; several are applied in order, before those of --ros-args.
    #[arg(long, value_name = "FILE")]
    pub(super) params_file: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

const AXIS_HELP: &str = "\
The markers lie on a turntable and turn with it: at least half a turn, one full turn is best. Their distance follows from
their side if it is given, otherwise from the laser's line on the table. A board that moves with the part gives a linear or a
rotary axis. A checkerboard or a grid of circles must be entirely visible, and turn by less than a quarter from picture to
picture; of a ChArUco board 12 corners suffice. Positions come from sensor_msgs/JointState or laser_profiler_msgs/EncoderStamped
(with motion.scale and motion.encoder_bits as in the node); pictures whose position lags are reported and do not affect the
result.

Examples:
  laser_profiler calibrate axis turning --calibration rig.yaml --markers aruco:4x4_50 -o scanner.yaml \\
      --ros-args -p stripe_direction:=vertical
  laser_profiler calibrate axis turning --calibration rig.yaml --markers aruco:4x4_50:0.030 --joint table -o scanner.yaml
  laser_profiler calibrate axis pictures --calibration rig.yaml --markers aruco:4x4_50:0.030 --step 0.157 -o scanner.yaml
  laser_profiler calibrate axis pictures --calibration rig.yaml --markers aruco:4x4_50 --positions positions.csv -o scanner.yaml
  laser_profiler calibrate axis sliding_board --calibration rig.yaml --target checkerboard:8x6:0.040 -o scanner.yaml";

/// Calibrates the axis that moves the part, from markers that turn with it or a board that moves with it.
#[derive(Debug, clap::Args)]
#[command(after_help = AXIS_HELP)]
pub(super) struct AxisArgs {
    /// Recordings, folders of pictures, pictures (PNG, JPEG, TIFF, BMP, PGM), quoted patterns, or videos.
    #[arg(value_name = "BAG|PICTURE", required = true)]
    pub(super) inputs: Vec<PathBuf>,
    /// Camera and laser plane: a file of `calibrate plane`.
    #[arg(long, value_name = "FILE.yaml")]
    pub(super) calibration: PathBuf,
    /// The markers: `aruco:DICTIONARY`, as `aruco:4x4_50`, or with the side of the black square in metres,
    /// `aruco:4x4_50:0.030`.
    #[arg(long, required_unless_present = "target", conflicts_with = "target")]
    pub(super) markers: Option<String>,
    /// The board: checkerboard, charuco, circles or asymmetric-circles with its sizes, as for `calibrate camera`.
    #[arg(long)]
    pub(super) target: Option<String>,
    /// Joint to use if the messages name several.
    #[arg(long, value_name = "NAME")]
    pub(super) joint: Option<String>,
    /// Topic of the positions if the recording has several.
    #[arg(long, value_name = "TOPIC")]
    pub(super) joint_topic: Option<String>,
    /// Motion from one picture to the next, radians or metres, if no messages state positions.
    #[arg(long, value_name = "STEP", allow_negative_numbers = true, conflicts_with_all = ["joint", "joint_topic"])]
    pub(super) step: Option<f64>,
    /// CSV file with the columns file (name of the picture) and position (radians or metres), if the inputs are pictures.
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["joint", "joint_topic", "step"])]
    pub(super) positions: Option<PathBuf>,
    /// ROS 2 parameter file; several are applied in order, before those of --ros-args.
    #[arg(long, value_name = "FILE")]
    pub(super) params_file: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

fn border(text: &str) -> Result<f64, String> {
    let squares = text.parse().ok().filter(|squares| (0.0..=20.0).contains(squares));
    squares.ok_or_else(|| "a number of squares from 0 to 20".to_owned())
}

/// Output files and format.
#[derive(Debug, clap::Args)]
pub(super) struct OutputArgs {
    /// The calibration, a YAML file.
    #[arg(short, long, value_name = "FILE.yaml")]
    pub(super) output: PathBuf,
    /// Replaces an existing file.
    #[arg(long)]
    pub(super) force: bool,
    /// Prints one JSON object on standard output: all figures, unrounded.
    #[arg(long)]
    pub(super) json: bool,
    /// Writes charts of the detections and residuals to this PNG file.
    #[arg(long, value_name = "FILE.png")]
    pub(super) report: Option<PathBuf>,
}
