//! Parameters for a recording, suggested from some of its pictures.
//!
//! The pictures are extracted with a few sets of parameters in both directions, the simplest set first. The first one that
//! finds nearly as much of a line as the best one is suggested; its line states width, region and motion.

use super::{
    auto_channel::AutoChannel,
    channel::SearchedRegion,
    diagnosis::{Diagnosis, Found, Trials, diagnose},
    image::{Image, OwnedImage},
    params::{
        Background, Channel, ExtractionParams, Params, PeakSelection, RegionOfInterest,
        StripeDirection, Threshold,
    },
};

/// A simpler set needs this share of what the best one finds.
const NEARLY: f64 = 0.97;
/// Less of a line than this is none.
const LEAST_SHARE: f64 = 0.05;
/// The region extends this share of the picture beyond the line on either side, at least.
const MARGIN: f64 = 0.1;
/// A region that leaves out less of the picture is not worth it.
const LEAST_SAVING: f64 = 0.3;

/// Parameters that suit some pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggestion {
    /// The parameters; those that matter differ from the defaults.
    pub params: Params,
    /// Share of the cross-sections with a point of an unbroken line, mean over the pictures, 0 to 1.
    pub share: f64,
    /// The same with the default parameters.
    pub share_of_defaults: f64,
    /// Median full width at half maximum of the line, pixels; NaN without a line.
    pub width_px: f64,
    /// First and last position across the line in all pictures, pixels; `None` without a line.
    pub range_px: Option<(f32, f32)>,
    /// The likely reason if no parameters find a line.
    pub diagnosis: Option<Diagnosis>,
}

/// Suggests parameters for pictures of one size and format, spread over a recording. Nothing is suggested without a
/// picture.
#[must_use]
pub fn suggest(pictures: &[OwnedImage]) -> Option<Suggestion> {
    let views: Vec<Image<'_>> = pictures.iter().map(OwnedImage::view).collect();
    let first = views.first()?;
    let base = Params { full_scale: full_scale(&views), ..Params::default() };
    let directions = [StripeDirection::Horizontal, StripeDirection::Vertical];
    let bases = directions.map(|stripe_direction| {
        let params = Params { stripe_direction, ..base };
        Params { channel: channel(&views, &params), ..params }
    });
    let sets = || bases.iter().flat_map(candidates);
    let scored: Vec<(Params, Found)> =
        sets().map(|params| (params, mean(&views, &params))).collect();
    let best = scored.iter().map(|(_, found)| found.sound).fold(0.0, f64::max);
    let share_of_defaults = mean(&views, &default_of(&views)).share;
    if best < LEAST_SHARE {
        return Some(Suggestion {
            params: base,
            share: 0.0,
            share_of_defaults,
            width_px: f64::NAN,
            range_px: None,
            diagnosis: Some(diagnose(first, &default_of(&views), None)),
        });
    }
    // The sets of both directions have the same order: the simplest of either comes first.
    let half = scored.len() / 2;
    let in_turn = (0..half).flat_map(|at| [at, at + half]);
    let (params, found) =
        in_turn.filter_map(|at| scored.get(at)).find(|(_, found)| found.sound >= NEARLY * best)?;
    let (params, found) = (fitted(params, found, first), *found);
    Some(Suggestion {
        params,
        share: mean(&views, &params).share,
        share_of_defaults,
        width_px: found.width_px,
        range_px: found.range_px,
        diagnosis: None,
    })
}

/// The default parameters, with the channel that they stand for.
fn default_of(views: &[Image<'_>]) -> Params {
    let params = Params::default();
    Params { channel: channel(views, &params), ..params }
}

/// Sets of parameters, the simplest first.
fn candidates(params: &Params) -> Vec<Params> {
    let plain = params.extraction;
    let small = ExtractionParams { min_segment_area: 100, ..plain };
    let adaptive = ExtractionParams { threshold: Threshold::Adaptive, ..small };
    let local = |background_window_px, blur_radius, threshold_sigmas| ExtractionParams {
        background: Background::Local,
        background_window_px,
        blur_radius,
        threshold_sigmas,
        min_segment_area: 20,
        peak_selection: PeakSelection::Continuity,
        max_step_px: 6.0,
        ..adaptive
    };
    let sets = [
        plain,
        small,
        adaptive,
        ExtractionParams { peak_selection: PeakSelection::Continuity, ..adaptive },
        local(31, 1, 8.0),
        local(31, 3, 4.0),
        local(13, 1, 4.0),
    ];
    sets.into_iter().map(|extraction| Params { extraction, ..*params }).collect()
}

/// Mean of what the parameters find.
fn mean(views: &[Image<'_>], params: &Params) -> Found {
    let all: Vec<Found> = views.iter().map(|view| Trials::new(view).find(params)).collect();
    let mut sum = Found::default();
    let mut widths: Vec<f64> = Vec::new();
    for found in &all {
        sum.points += found.points;
        sum.share += found.share;
        sum.sound += found.sound;
        sum.level += found.level;
        if found.width_px > 0.0 {
            widths.push(found.width_px);
        }
        sum.range_px = match (sum.range_px, found.range_px) {
            (Some((low, high)), Some((from, to))) => Some((low.min(from), high.max(to))),
            (range, None) | (None, range) => range,
        };
    }
    let count = all.len().max(1) as f64;
    sum.share /= count;
    sum.sound /= count;
    sum.level /= count;
    sum.width_px = crate::statistics::median(&mut widths).unwrap_or(f64::NAN);
    sum
}

/// Adds region, limits of the width and tracking to parameters that find the line.
fn fitted(params: &Params, found: &Found, image: &Image<'_>) -> Params {
    let mut params = *params;
    if let Some((low, high)) = found.range_px {
        let length = match params.stripe_direction {
            StripeDirection::Horizontal => image.height(),
            StripeDirection::Vertical => image.width(),
        };
        let margin = (MARGIN * f64::from(length)).max(8.0 * found.width_px.max(1.0));
        let from = (f64::from(low) - margin).max(0.0).floor();
        let to = (f64::from(high) + margin).min(f64::from(length)).ceil();
        if to - from <= (1.0 - LEAST_SAVING) * f64::from(length) {
            let (offset, size) = (from as u32, Some((to - from) as u32));
            params.roi = match params.stripe_direction {
                StripeDirection::Horizontal => {
                    RegionOfInterest { y_offset: offset, height: size, ..params.roi }
                }
                StripeDirection::Vertical => {
                    RegionOfInterest { x_offset: offset, width: size, ..params.roi }
                }
            };
        }
    }
    params
}

/// The channel that `auto` stands for in the first picture that shows a line; `auto` for grey pictures.
fn channel(views: &[Image<'_>], params: &Params) -> Channel {
    let mut chosen = AutoChannel::default();
    for view in views.iter().filter(|view| view.format().has_colors()) {
        let Ok(full_scale) = params.full_scale_of(view.format()) else { continue };
        chosen.channel(view, &SearchedRegion::whole(view), params, full_scale);
        if let Some(choice) = chosen.choice() {
            return choice.channel;
        }
    }
    match views.first() {
        Some(view) if view.format().has_colors() => Channel::Max,
        _ => Channel::Auto,
    }
}

/// 10, 12 or 14 bits if no sample of 16 needs more.
fn full_scale(views: &[Image<'_>]) -> Option<u32> {
    let params = Params { channel: Channel::Max, ..Params::default() };
    let brightest = views
        .iter()
        .filter(|view| view.format().max_level() > 255)
        .filter_map(|view| Trials::new(view).levels(&params))
        .map(|levels| levels.brightest)
        .max()?;
    [10, 12, 14].map(|bits| (1 << bits) - 1).into_iter().find(|&end| brightest <= end)
}
