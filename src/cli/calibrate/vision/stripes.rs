//! Extraction of the stripe from pictures of boards and markers, with the user's parameters.

use crate::{
    calibrate::LaserFinder, cli::settings::Settings, ros::camera_params::CameraParams,
    scanner::params::Params,
};

/// Returns the node's extraction. Defaults of unset parameters are suited to a line on a printed board in room light.
pub(super) fn finder(settings: &Settings, camera: &CameraParams) -> LaserFinder {
    let is_set = |name: &str| settings.values.is_set(&camera.full_name(name));
    let given = camera.scanner.extraction;
    let mut extraction = LaserFinder::extraction_on_board(given);
    if is_set("extraction.background") {
        extraction.background = given.background;
    }
    if is_set("extraction.threshold_sigmas") {
        extraction.threshold_sigmas = given.threshold_sigmas;
    }
    if is_set("extraction.threshold") || is_set("extraction.segment_threshold") {
        extraction.threshold = given.threshold;
    }
    if is_set("extraction.min_segment_area") {
        extraction.min_segment_area = given.min_segment_area;
    }
    if is_set("extraction.peak_selection") {
        extraction.peak_selection = given.peak_selection;
    }
    if is_set("extraction.method") {
        extraction.method = given.method;
    }
    let channel = is_set("channel").then_some(camera.scanner.channel);
    LaserFinder::new(Params { extraction, ..camera.scanner }, channel)
}
