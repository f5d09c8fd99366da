//! Parameters for a recording, suggested from some of its pictures.
//!
//! The pictures are extracted with a few sets of parameters in both directions, the simplest set first. The first one whose
//! line is judged nearly as good as the best one's, or that finds the same line, is suggested. Where only a local
//! background shows the line, its window, blur and threshold, the channel and a limit of the width are chosen by the same
//! judgement. Tracking is not suggested: pictures that were not looked at may show a part that lifts the line further
//! than any margin.

mod candidates;

use super::{
    auto_channel::AutoChannel,
    channel::SearchedRegion,
    diagnosis::{Diagnosis, Found, Reason, Trials, diagnose},
    image::{Image, OwnedImage},
    params::{Channel, Params, RegionOfInterest, StripeDirection},
};

/// A simpler set needs this share of the best one's score.
const NEARLY: f64 = 0.97;
/// Up to this share of saturated points, the colours of a line are true.
const FEW_SATURATED: f64 = 0.05;
/// A limit of the width must raise the score by this factor: it is worth something only beside clutter.
const LEAST_GAIN: f64 = 1.01;
/// A limit of the width, or a simpler set, must keep this share of the line.
const KEPT: f64 = 0.98;
/// Two sets find the same line if its ends differ by less than this share of its width.
const SAME_PLACE: f64 = 0.5;
/// The least blur needs this share of the score with more.
const ENOUGH_SHARP: f64 = 0.95;
/// Less of a line than this is none.
const LEAST_SHARE: f64 = 0.05;
/// Nor is it a line if more of its points do not look like one. On lines of real recordings they are up to 76 %.
const MOST_UNLIKE: f64 = 0.9;
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
    let tried = bases.each_ref().map(|base| Tried::all(&views, base));
    let share_of_defaults = mean(&views, &default_of(&views)).share;
    let nothing = |diagnosis| Suggestion {
        params: base,
        share: 0.0,
        share_of_defaults,
        width_px: f64::NAN,
        range_px: None,
        diagnosis: Some(diagnosis),
    };
    let best_score = tried.iter().map(Tried::best_score).fold(0.0, f64::max);
    if best_score <= 0.0 {
        return Some(nothing(diagnose(first, &default_of(&views), None)));
    }
    let (params, found) = chosen(&views, &tried, best_score)?;
    if found.share < LEAST_SHARE {
        return Some(nothing(Diagnosis { reason: Reason::NoLine, turned: None }));
    }
    if found.unlike > MOST_UNLIKE {
        let percent = (100.0 * found.unlike) as u32;
        return Some(nothing(Diagnosis { reason: Reason::Doubtful { percent }, turned: None }));
    }
    let params = fitted(&params, &found, first);
    Some(Suggestion {
        params,
        share: mean(&views, &params).share,
        share_of_defaults,
        width_px: found.width_px,
        range_px: found.range_px,
        diagnosis: None,
    })
}

/// Sets of parameters, and what they find.
type Scored = Vec<(Params, Found)>;

/// Trials in one direction.
struct Tried {
    base: Params,
    simple: Scored,
    local: Scored,
}

impl Tried {
    fn all(views: &[Image<'_>], base: &Params) -> Self {
        let simple = scored(views, candidates::simple(base));
        Self { base: *base, simple, local: scored(views, candidates::local(base)) }
    }

    fn best_score(&self) -> f64 {
        self.simple.iter().chain(&self.local).map(|(_, found)| found.score).fold(0.0, f64::max)
    }
}

fn scored(views: &[Image<'_>], sets: Vec<Params>) -> Scored {
    sets.into_iter().map(|params| (params, mean(views, &params))).collect()
}

/// The first of the best.
fn best(scored: &[(Params, Found)]) -> Option<&(Params, Found)> {
    scored.iter().reduce(|best, other| if other.1.score > best.1.score { other } else { best })
}

/// Chooses among what was tried, and refines it if only a local background shows the line.
fn chosen(views: &[Image<'_>], tried: &[Tried; 2], best_score: f64) -> Option<(Params, Found)> {
    let [first, second] = tried;
    let in_turn = || first.simple.iter().zip(&second.simple).flat_map(|(one, other)| [one, other]);
    if let Some(simple) = in_turn().find(|(_, found)| found.score >= NEARLY * best_score) {
        return Some(*simple);
    }
    let of_direction = if first.best_score() >= best_score { first } else { second };
    let refined = refined(views, of_direction)?;
    let simple = of_direction.simple.iter().find(|(_, found)| finds_same(found, &refined.1));
    Some(simple.copied().unwrap_or(refined))
}

/// Returns true if a simpler set finds the same line as another. The other may be judged better only because its background
/// hides what makes the points doubtful.
fn finds_same(simple: &Found, other: &Found) -> bool {
    let (Some((low, high)), Some((from, to))) = (simple.range_px, other.range_px) else {
        return false;
    };
    let off_px = (low - from).abs().max((high - to).abs());
    simple.share >= KEPT * other.share
        && simple.unlike <= MOST_UNLIKE
        && f64::from(off_px) <= SAME_PLACE * other.width_px
}

/// The best set with a local background, of any channel, with a limit of the width if that is better still.
fn refined(views: &[Image<'_>], tried: &Tried) -> Option<(Params, Found)> {
    let mut channels = vec![(tried.base, tried.local.clone())];
    if views.first().is_some_and(|view| view.format().has_colors()) {
        channels.extend(in_colours(views, &tried.base));
    }
    let score = |(_, scored): &(Params, Scored)| best(scored).map_or(0.0, |(_, found)| found.score);
    let (base, scored_before) = channels
        .into_iter()
        .reduce(|best, other| if score(&other) > score(&best) { other } else { best })?;
    let wide_px = best(&scored_before)?.1.wide_px;
    // Blur rounds edges, so more of it must be worth it.
    let [sharp, smooth] = [1, 3].map(|blur_radius| {
        let sets = candidates::all_local(&base, wide_px, blur_radius);
        let sets = scored(views, sets);
        let sets: Scored =
            sets.iter().map(|(params, found)| limited(views, params, found)).collect();
        best(&sets).copied()
    });
    let score = |set: &Option<(Params, Found)>| set.as_ref().map_or(0.0, |(_, found)| found.score);
    if score(&sharp) >= ENOUGH_SHARP * score(&smooth) { sharp } else { smooth }
}

/// The set with a limit of the width, if clutter makes it better and the line is hardly wider anywhere; else as it was.
fn limited(views: &[Image<'_>], params: &Params, found: &Found) -> (Params, Found) {
    let narrow = candidates::limited(params, found.width_px);
    let of_narrow = mean(views, &narrow);
    let is_better = of_narrow.score >= LEAST_GAIN * found.score;
    if is_better && of_narrow.share >= KEPT * found.share {
        (narrow, of_narrow)
    } else {
        (*params, *found)
    }
}

/// Sets with a local background in the colours that show the line unsaturated.
fn in_colours(views: &[Image<'_>], base: &Params) -> Vec<(Params, Scored)> {
    let mut all = Vec::new();
    for [colour, excess] in candidates::COLOURS {
        let of_channel = |channel| {
            let base = Params { channel, ..*base };
            (base, scored(views, candidates::local(&base)))
        };
        let plain = of_channel(colour);
        let saturated = best(&plain.1).map_or(1.0, |(_, found)| found.saturated);
        if saturated <= FEW_SATURATED {
            all.extend([plain, of_channel(excess)]);
        }
    }
    all
}

/// The default parameters, with the channel that they stand for.
fn default_of(views: &[Image<'_>]) -> Params {
    let params = Params::default();
    Params { channel: channel(views, &params), ..params }
}

/// Mean of what the parameters find.
fn mean(views: &[Image<'_>], params: &Params) -> Found {
    let all: Vec<Found> = views.iter().map(|view| Trials::new(view).find(params)).collect();
    let mut sum = Found::default();
    let (mut widths, mut wide): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for found in &all {
        sum.points += found.points;
        sum.share += found.share;
        sum.score += found.score;
        sum.level += found.level;
        sum.saturated += found.saturated;
        sum.unlike += found.unlike;
        if found.width_px > 0.0 {
            widths.push(found.width_px);
            wide.push(found.wide_px);
        }
        sum.range_px = match (sum.range_px, found.range_px) {
            (Some((low, high)), Some((from, to))) => Some((low.min(from), high.max(to))),
            (range, None) | (None, range) => range,
        };
    }
    let count = all.len().max(1) as f64;
    let Found { share, score, level, saturated, unlike, .. } = &mut sum;
    for figure in [share, score, level, saturated, unlike] {
        *figure /= count;
    }
    sum.width_px = crate::statistics::median(&mut widths).unwrap_or(f64::NAN);
    sum.wide_px = crate::statistics::median(&mut wide).unwrap_or(f64::NAN);
    sum
}

/// Adds a region of interest to parameters that find the line.
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
