//! The parameters of a camera: all that decides what its frames give. Each of several cameras has them under its name.

use crate::{
    ros::node_params::ImageTransport,
    scanner::{
        image::MAX_SIDE_PX,
        params::{
            AxisChoice, Background, Channel, Exposure, GravityWindow, Method, MotionSource,
            NoiseSource, PeakSelection, ScanDirection, StripeDirection, Threshold,
        },
    },
};

use super::{MIB, Parameter, choice, float, integer, text};

const MAX_SIDE: i64 = MAX_SIDE_PX as i64;

/// In the order in which a parameter file shows them. Numbers in brackets: (default, smallest, largest).
#[rustfmt::skip]
pub const CAMERA: &[Parameter] = &[
    choice("image_transport", "raw", ImageTransport::NAMES,
        "Which image topic is taken: image_raw itself, or image_raw/compressed. When this is not set, replay takes \
         what the recording holds. Lossy compression (JPEG) moves the centreline by some hundredths of a pixel."),
    integer("max_frame_bytes", "bytes", (64 * MIB, MIB, 1024 * MIB),
        "Largest image that is accepted, decoded; a larger one is rejected as malformed. Bounds the memory against \
         damaged or hostile input. Raise it only for cameras with larger frames."),
    choice("channel", "auto", Channel::NAMES,
        "Grey level of a colour or Bayer pixel, the latter after bilinear demosaicing. auto: grey images as they are, \
         the largest of the three colours otherwise. gray: luma, BT.601. The laser's own colour has the best contrast in \
         ambient light; red_excess, green_excess and blue_excess are what it has above the larger of the other two, so \
         that white and grey things vanish. Grey images are taken as they are, whatever stands here."),
    choice("stripe_direction", "horizontal", StripeDirection::NAMES,
        "Which way the stripe runs through the image. horizontal: one point a column; vertical: one point a row."),
    integer("full_scale", "grey levels of the image", (0, 0, 65_535),
        "Level at which a sample counts as saturated. 0: by encoding, 255 or 65535. Set 4095 for 12 bits in mono16, \
         or thresholds and saturation are wrong."),
    integer("roi.x_offset", "px", (0, 0, MAX_SIDE),
        "First searched column. A region without reflections is both safer and faster."),
    integer("roi.y_offset", "px", (0, 0, MAX_SIDE),
        "First searched row."),
    integer("roi.width", "px", (0, 0, MAX_SIDE),
        "Searched columns; 0 reaches to the right border."),
    integer("roi.height", "px", (0, 0, MAX_SIDE),
        "Searched rows; 0 reaches to the lower border. Time grows with width x height."),
    choice("exposure", "single", Exposure::NAMES,
        "How frames of different exposure times follow one another. alternating: short and long ones in turn; each is \
         merged with the one before it: points that are saturated or missing in the long one are the short one's. The \
         two are a period apart, so points lie up to one step of the motion off. Intensities are the long one's."),
    choice("extraction.method", "improved_gravity", Method::NAMES,
        "Estimator of the stripe's centre in a cross-section. improved_gravity: centroid in a window about a fitted \
         maximum, the paper's. gaussian_fit suits narrow, unsaturated stripes; gray_gravity is the plain centroid, which \
         background pulls aside. gaussian_ml: maximum likelihood, the most accurate of one cross-section alone, \
         saturated or not. log_gaussian: its fast approximation. fir_peak: zero of the derivative, for stripes of \
         uneven flanks. steger: ridge of the image, averages along the stripe."),
    choice("extraction.window", "fractional", GravityWindow::NAMES,
        "Window of improved_gravity. fractional: unbiased. rounded: as printed in the paper, locks to whole pixels; \
         only to compare with it."),
    integer("extraction.blur_radius", "px", (3, 0, 15),
        "Radius r of the Gaussian blur, kernel 2r + 1; 0 is off. Suppresses speckle and noise; a stripe narrower than \
         r is smeared. Time grows with r."),
    float("extraction.segment_threshold", "grey levels of an 8-bit scale", (35.0, 0.0, 255.0),
        "Blurred grey above which a pixel may belong to the stripe; deeper images are scaled to 8 bits. Fixed, as in \
         the paper: above the ambient light, below the stripe's weakest part. Too low lets the background in."),
    integer("extraction.min_segment_area", "px", (500, 0, 10_000_000),
        "Connected regions of this area or less are no stripe. Removes speckle and small reflections; lower it for \
         short stripes and small images."),
    float("extraction.width_threshold", "grey levels of an 8-bit scale", (50.0, 0.0, 255.0),
        "Blurred grey above which a sample counts towards the width D of the stripe, whose two thirds are the window \
         of improved_gravity."),
    choice("extraction.peak_selection", "brightest", PeakSelection::NAMES,
        "Which of several candidates in a cross-section is the stripe. brightest suits most scenes; first or last \
         when a reflection always lies on the other side; continuity takes those that make one line, for scenes with \
         bright clutter, and parts a stripe from the halo that it stands on."),
    choice("extraction.background", "none", Background::NAMES,
        "What is taken off before the search. local: what is wider across the stripe than background_window (white \
         top-hat), for ambient light and bright objects; takes some times longer, because every pixel counts. \
         reference: background_file, a frame without laser from the same place."),
    integer("extraction.background_window", "px", (41, 3, 1001),
        "What is wider across the stripe than this is local background; even ones count as the next odd one. Twice the \
         widest stripe or more; lower lets less clutter through."),
    text("extraction.background_file", "",
        "Picture for background: reference, of the camera's size and depth: PNG, 8 or 16 bits, as laser_profiler ambient \
         makes. A relative path starts from the parameter file that sets it, or from the working directory when set by -p."),
    choice("extraction.threshold", "fixed", Threshold::NAMES,
        "Where the segment threshold comes from. fixed: segment_threshold. adaptive: threshold_sigmas times the noise of \
         the searched image above its median, frame by frame; width_threshold moves along. Wants a background that is \
         even or taken off."),
    float("extraction.threshold_sigmas", "standard deviations", (8.0, 1.0, 1000.0),
        "Adaptive threshold: so many standard deviations of the searched image's noise above its median."),
    float("extraction.min_contrast", "grey levels of an 8-bit scale", (0.0, 0.0, 255.0),
        "Candidates whose blurred peak is less than this above the background are no stripe."),
    integer("extraction.min_width", "px", (1, 1, MAX_SIDE),
        "Candidates with fewer samples above the threshold are no stripe."),
    integer("extraction.max_width", "px", (0, 0, MAX_SIDE),
        "Candidates with more samples above the threshold are no stripe; 0: no limit."),
    float("extraction.min_snr", "standard deviations", (3.0, 0.0, 1000.0),
        "Points whose amplitude is less than so many standard deviations of the noise are flagged LOW_CONTRAST."),
    integer("extraction.max_stripes", "stripes", (1, 1, 8),
        "Surfaces that a cross-section may show: glass, a film over a part, a wall behind. Further ones follow as \
         stripes of their own; the profile holds the first."),
    float("extraction.max_step", "px", (3.0, 0.1, 1000.0),
        "For peak_selection continuity: what moves further from one column to the next is a break in the line."),
    integer("extraction.tracking_margin", "px", (0, 0, MAX_SIDE),
        "Search only so far from the last frame's stripe, and everywhere again when less than half of its points are found \
         there. 0: everywhere."),
    integer("extraction.smoothing_columns", "points", (1, 1, 255),
        "Points that are smoothed together along the stripe, an odd number; 1: none. Noise falls with their root; steps \
         and grooves above the noise stay as they are."),
    float("extraction.ridge_sigma", "px", (2.2, 0.5, 10.0),
        "Standard deviation of the Gaussian of the method steger: the stripe's standard deviation, about."),
    choice("extraction.noise", "stated", NoiseSource::NAMES,
        "Noise model of gaussian_ml and of the stated uncertainty. stated: read_noise and shot_gain. estimated: from \
         the frame itself."),
    float("extraction.read_noise", "grey levels of an 8-bit scale", (2.0, 0.0, 100.0),
        "Standard deviation of the camera's noise in the dark, for gaussian_ml and for the stated uncertainty (sigma); \
         measure it with the lens covered."),
    float("extraction.shot_gain", "grey levels of an 8-bit scale", (0.01, 0.0, 10.0),
        "Variance of the shot noise per grey level: 255 / full-well electrons. For gaussian_ml and for sigma."),
    text("calibration_file", "",
        "Calibration of camera and laser plane. Empty: centrelines only, no metric profile. A relative path \
         starts from the parameter file that sets it, or from the working directory when set by -p."),
    choice("motion.source", "none", MotionSource::NAMES,
        "Where a profile's position along the scan comes from. none: every profile at 0. constant: motion.step or \
         motion.velocity. joint_state: a joint on joint_states. encoder: EncoderStamped on encoder. tf: the pose of \
         motion.sensor_frame in motion.part_frame, on /tf and /tf_static. The last three are looked up at the middle of the \
         exposure; a frame whose position nobody knows is published, but left out of the scan."),
    float("motion.step", "m/frame", (0.0, -1.0, 1.0),
        "Distance between two frames, lost ones included; for triggered cameras. Negative moves against the scan axis."),
    float("motion.velocity", "m/s", (0.0, -100.0, 100.0),
        "Speed of the part; times the difference of stamps. For free-running cameras with good stamps."),
    text("motion.joint", "",
        "For joint_state: name of the joint. Empty: the only one that the messages hold."),
    choice("motion.axis", "auto", AxisChoice::NAMES,
        "What the axis does. auto: what the calibration says of it; shift the part, where it says nothing. prismatic: \
         positions are metres; revolute: radians, and a turn that begins again at 0 goes on. Another axis than the \
         calibration's is refused."),
    float("motion.scale", "m or rad a unit", (0.0, -1e6, 1e6),
        "What one unit of a joint or one count of an encoder means; negative turns the axis round. 0: as the messages say, \
         1 for joints. The scale of the calibration's axis counts as well."),
    integer("motion.encoder_bits", "bits", (0, 0, 63),
        "Width of the encoder's counter, where its counts begin again at 0 after it; the axis must not move half the range \
         between two samples. 0: counts are unwrapped already, as EncoderStamped wants them."),
    choice("motion.direction", "auto", ScanDirection::NAMES,
        "Which way positions should go; what goes the other way is flagged REVERSED. auto: the way that a scan goes first; \
         forward: up; backward: down; both: to and fro, nothing is flagged. Set it where an axis may run the wrong way."),
    float("motion.backlash", "m or rad", (1e-5, 0.0, 1.0),
        "How far the axis may move back and yet stand still: some counts of the encoder."),
    float("motion.max_step", "m or rad", (0.0, 0.0, 1e6),
        "Frames between two samples that lie further apart are flagged GAP: a counter that was reset, an axis that slipped. \
         0: any distance is believed."),
    float("motion.max_gap", "s", (0.0, 0.0, 3600.0),
        "Longest time between two samples: frames between those further apart are flagged STALE, and a motion is thought to \
         go on (EXTRAPOLATED) no longer than this. 0: four times the usual time between samples."),
    integer("motion.max_wait", "frames", (32, 0, 1000),
        "Frames that wait at most for a sample taken after them, 256 MiB of them and at least a second. Raise it where \
         positions come much later than images."),
    float("motion.exposure_offset", "s", (0.0, -10.0, 10.0),
        "From the stamp of a frame to the middle of its exposure: half the exposure time, where cameras stamp its beginning. \
         An axis that stands still while exposing may be looked up where its position was taken."),
    text("motion.part_frame", "",
        "Frame of the point clouds and height maps. For tf: the frame that is scanned in, as in base_link; it must be set. \
         Otherwise its name; empty: part where the calibration has an axis or a level, else the laser plane's own frame."),
    text("motion.sensor_frame", "",
        "For tf: the frame whose pose is looked up. Empty: the frame of the images, the camera's optical frame. The laser \
         plane's frame may stand here, where somebody publishes it."),
    integer("slice.profiles", "profiles", (100, 1, 10_000),
        "Profiles in one published slice of the point cloud. Fewer: less delay and smaller messages; 100 is a slice \
         of some megabytes. A slice also ends before it has 2^26 points, 1 GiB."),
    integer("points.max_bytes", "bytes", (0, 0, 1024 * MIB),
        "Largest message of the point cloud: a slice ends before its own would be larger, but holds one profile at least. \
         0: what the transport carries to every peer with stock settings, 96 KiB on DDS and any size elsewhere."),
    integer("scan.max_profiles", "profiles", (5_000, 1, 1_000_000),
        "Profiles in a scan; the next one begins a new scan with its own height map. Bounds the memory: four bytes a \
         point of every profile. A scan also ends before it has 2^28 points, 1 GiB of heights."),
];
