//! Sets of parameters to try.

use crate::scanner::{
    params::{Background, Channel, ExtractionParams, Params, PeakSelection, Threshold},
    stripe::blur,
};

/// A background window must be this multiple of the line's width: what is wider counts as background.
const LEAST_WINDOW: f64 = 2.0;
/// Windows of a local background, pixels.
const WINDOWS_PX: [u32; 2] = [31, 13];
/// Largest step of a line along its direction, pixels.
const MAX_STEP_PX: f64 = 6.0;
/// Everything above this multiple of the line's width is no part of it.
const MOST_WIDTHS: f64 = 2.0;
/// Full width at half maximum of a Gaussian, standard deviations.
const FULL_WIDTH: f64 = 2.355;

/// Sets for dark surroundings, the simplest first.
pub(super) fn simple(params: &Params) -> Vec<Params> {
    let plain = params.extraction;
    let small = ExtractionParams { min_segment_area: 100, ..plain };
    let adaptive = ExtractionParams { threshold: Threshold::Adaptive, ..small };
    let continuous = ExtractionParams { peak_selection: PeakSelection::Continuity, ..adaptive };
    with_extractions(params, &[plain, small, adaptive, continuous])
}

/// Sets with a local background, for bright and cluttered surroundings: few that differ much.
pub(super) fn local(params: &Params) -> Vec<Params> {
    let plain = params.extraction;
    let sets =
        [local_set(plain, 31, 1, 8.0), local_set(plain, 31, 3, 4.0), local_set(plain, 13, 1, 4.0)];
    with_extractions(params, &sets)
}

/// All sets with a local background and that blur whose window suits a line of that width.
pub(super) fn all_local(params: &Params, wide_px: f64, blur_radius: u32) -> Vec<Params> {
    let [wide_window_px, narrow_window_px] = WINDOWS_PX;
    let is_narrow_enough = f64::from(narrow_window_px) >= LEAST_WINDOW * wide_px;
    let windows_px = [Some(wide_window_px), is_narrow_enough.then_some(narrow_window_px)];
    let mut sets = Vec::new();
    for window_px in windows_px.into_iter().flatten() {
        for threshold_sigmas in [14.0, 8.0, 4.0] {
            sets.push(local_set(params.extraction, window_px, blur_radius, threshold_sigmas));
        }
    }
    with_extractions(params, &sets)
}

fn local_set(
    plain: ExtractionParams,
    background_window_px: u32,
    blur_radius: u32,
    threshold_sigmas: f64,
) -> ExtractionParams {
    ExtractionParams {
        background: Background::Local,
        background_window_px,
        blur_radius,
        threshold: Threshold::Adaptive,
        threshold_sigmas,
        min_segment_area: 20,
        peak_selection: PeakSelection::Continuity,
        max_step_px: MAX_STEP_PX,
        ..plain
    }
}

fn with_extractions(params: &Params, sets: &[ExtractionParams]) -> Vec<Params> {
    sets.iter().map(|&extraction| Params { extraction, ..*params }).collect()
}

/// A colour, and the channel that holds it without white light.
pub(super) const COLOURS: [[Channel; 2]; 3] = [
    [Channel::Red, Channel::RedExcess],
    [Channel::Green, Channel::GreenExcess],
    [Channel::Blue, Channel::BlueExcess],
];

/// The set with a limit of the width that suits a line of that width before the blur.
pub(super) fn limited(params: &Params, width_px: f64) -> Params {
    let blur_px = FULL_WIDTH * blur::sigma_px(params.extraction.blur_radius);
    let max_width_px = (MOST_WIDTHS * width_px.hypot(blur_px)).ceil() as u32;
    let extraction = ExtractionParams { max_width_px: Some(max_width_px), ..params.extraction };
    Params { extraction, ..*params }
}
