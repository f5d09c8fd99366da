//! Camera, laser plane and axis from pictures of boards and markers.

mod axis;
mod axis_distance;
mod axis_response;
mod board;
mod board_axis;
mod board_bend;
mod board_parts;
mod board_shape;
mod bundle;
mod camera;
mod camera_error;
mod camera_response;
mod charuco;
mod charuco_detector;
mod charuco_diagnosis;
mod checkerboard;
mod circle_centres;
mod circle_detector;
mod circle_grid;
mod circle_lattice;
mod components;
mod corner_deviations;
mod ellipses;
mod fields;
mod fisheye_start;
mod homography;
mod joint_fit;
mod laser_finder;
mod laser_lines;
mod laser_plane;
mod least_squares;
mod markers;
mod picture;
mod plane_response;
mod pose;
mod positions;
mod quads;
mod revolute;
mod stripe_line;
mod target;
mod target_detector;
mod view_variety;

pub use axis::{
    AxisError, AxisFit, AxisTarget, AxisTargetDetector, AxisView, MarkerCircles, SeenTarget,
    TargetRejected, calibrate_axis,
};
pub use axis_distance::{DistanceError, DistanceSource, TableDistance};
pub use board::{Board, BoardDetector, BoardRejected, Corner};
pub use board_axis::BoardAxisError;
pub use board_bend::BoardBend;
pub use camera::{
    CameraFit, CameraUncertainty, CameraViews, LensModel, OutlierView, UsedView, calibrate_camera,
};
pub use camera_error::CameraError;
pub use charuco::Charuco;
pub use charuco_diagnosis::CharucoRejected;
pub use checkerboard::{Checkerboard, CheckerboardError};
pub use circle_centres::with_true_centres;
pub use circle_detector::CirclesRejected;
pub use circle_grid::{CircleArrangement, CircleGrid};
pub use laser_finder::{LaserFinder, LaserFinderError, Light, LitCenterline};
pub use laser_lines::{BoardLine, BoardRejection, BoardView, LaserLines, RejectedBoard};
pub use laser_plane::{BoardResidual, LaserPlaneError, LaserPlaneFit, calibrate_plane};
pub use markers::{Marker, MarkerDetector, MarkerError, MarkerKind};
pub use picture::GrayPicture;
pub use pose::BoardPose;
pub use positions::{Agreement, PositionError};
pub use quads::Quad;
pub use revolute::RevoluteError;
pub use stripe_line::{LineRejected, StripeLine};
pub use target::{Target, TargetError};
pub use target_detector::{TargetDetector, TargetDetectorError};
pub use view_variety::MissingViews;
