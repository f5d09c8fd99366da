//! Why a picture has no stripe: the likely reason, from the picture itself and the parameters.
//!
//! The picture is extracted again with one parameter after the other changed, the most common mistakes first. The first
//! change that makes a line appear is the reason. This takes some ten times as long as a measurement, so it is for a few
//! frames only.

mod reason;
mod trial;

pub use reason::{Diagnosis, REASONS, Reason};
use trial::Levels;
pub(super) use trial::stripe_share;
pub(super) use trial::{Found, Trials};

use super::{
    image::Image,
    params::{
        Background, Channel, ExtractionParams, Params, RegionOfInterest, StripeDirection, Threshold,
    },
};

/// A line fills at least this share of the cross-sections.
const LEAST_SHARE: f64 = 0.1;
/// A change must find this multiple of the points that were found without it.
const LEAST_GAIN: f64 = 3.0;
/// Most of the points of a short line have the shape of one.
const MOST_UNLIKE: f64 = 0.5;
/// More of a picture at full scale hides any line.
const MOST_SATURATED: f64 = 0.5;
/// Bits of cameras that store fewer than 16.
const BITS: [u32; 3] = [10, 12, 14];
/// Areas to try, pixels.
const AREAS_PX: [u32; 3] = [200, 50, 20];
/// Standard deviations of the adaptive threshold in trials.
const SIGMAS: f64 = 6.0;

/// Returns the likely reason why these parameters find no stripe, or hardly any, in a picture. Their channel must not be
/// `auto` for a colour image. `reference` is the picture without laser that `background: reference` subtracts; without
/// one of the same size and depth, a local background takes its place.
#[must_use]
pub fn diagnose(image: &Image<'_>, params: &Params, reference: Option<&Image<'_>>) -> Diagnosis {
    Search::new(image, params, reference).reason()
}

/// The search for a change that makes a line appear.
struct Search<'a> {
    trials: Trials<'a>,
    image: &'a Image<'a>,
    params: Params,
    /// Result with the parameters themselves.
    now: Found,
}

/// Returns the other direction.
const fn turned(direction: StripeDirection) -> StripeDirection {
    match direction {
        StripeDirection::Horizontal => StripeDirection::Vertical,
        StripeDirection::Vertical => StripeDirection::Horizontal,
    }
}

impl<'a> Search<'a> {
    fn new(image: &'a Image<'a>, params: &Params, reference: Option<&'a Image<'a>>) -> Self {
        let fits = |reference: &&Image<'_>| {
            let kind =
                |image: &Image<'_>| (image.width(), image.height(), image.format().max_level());
            kind(reference) == kind(image)
        };
        let reference = reference.filter(fits);
        let mut params = *params;
        if params.extraction.background == Background::Reference && reference.is_none() {
            params.extraction.background = Background::Local;
        }
        let mut trials = Trials::new(image).with_reference(reference);
        let now = trials.find(&params);
        Self { trials, image, params, now }
    }

    fn reason(mut self) -> Diagnosis {
        let none = |reason| Diagnosis { reason, turned: None };
        let Some(levels) = self.trials.levels(&self.params) else { return none(Reason::NoLine) };
        if let Some(found) = self.full_scale(&levels) {
            return found;
        }
        if levels.saturated() > MOST_SATURATED {
            return none(Reason::Saturated { percent: percent(levels.saturated()) });
        }
        if let Some((turned, _)) = self.with(|params| params) {
            return Diagnosis { reason: Reason::Direction, turned };
        }
        let changed =
            self.reference().or_else(|| self.limits()).or_else(|| self.threshold(&levels));
        let changed = changed.or_else(|| self.elsewhere()).or_else(|| self.short());
        changed.unwrap_or_else(|| {
            none(if is_dark(&levels) {
                Reason::Dark { brightest: levels.brightest, full_scale: levels.full_scale }
            } else {
                Reason::NoLine
            })
        })
    }

    /// Tries changed parameters in both directions; returns the other direction if the line has that one.
    fn with(
        &mut self,
        change: impl Fn(Params) -> Params,
    ) -> Option<(Option<StripeDirection>, Found)> {
        let changed = change(self.params);
        let direction = self.params.stripe_direction;
        let other = turned(direction);
        let straight = self.trials.find(&changed);
        let across = self.trials.find(&Params { stripe_direction: other, ..changed });
        let enough = |found: &Found| {
            found.share >= LEAST_SHARE && found.share >= LEAST_GAIN * self.now.share
        };
        if enough(&across) && across.points as f64 > LEAST_GAIN * straight.points as f64 {
            return Some((Some(other), across));
        }
        enough(&straight).then_some((None, straight))
    }

    fn with_extraction(
        &mut self,
        change: impl Fn(ExtractionParams) -> ExtractionParams,
    ) -> Option<(Option<StripeDirection>, Found)> {
        self.with(|params| Params { extraction: change(params.extraction), ..params })
    }

    /// Samples of 10, 12 or 14 bits in 16, or above the stated full scale.
    fn full_scale(&mut self, levels: &Levels) -> Option<Diagnosis> {
        let max_level = self.image.format().max_level();
        let &Levels { brightest, full_scale: stated, .. } = levels;
        if max_level <= 255 {
            return None;
        }
        let ends = BITS.map(|bits| (1 << bits) - 1).into_iter().chain([max_level]);
        let full_scale = ends.into_iter().find(|&end| brightest <= end)?;
        if full_scale == stated {
            return None;
        }
        let (turned, _) = self.with(|params| Params { full_scale: Some(full_scale), ..params })?;
        Some(Diagnosis { reason: Reason::FullScale { brightest, stated, full_scale }, turned })
    }

    /// A reference without laser that contains the line, or light that is no longer there.
    fn reference(&mut self) -> Option<Diagnosis> {
        if self.params.extraction.background != Background::Reference {
            return None;
        }
        let local = |params| ExtractionParams { background: Background::Local, ..params };
        let (turned, _) = self.with_extraction(local)?;
        Some(Diagnosis { reason: Reason::Reference, turned })
    }

    /// Limits that reject a line above the threshold.
    fn limits(&mut self) -> Option<Diagnosis> {
        let limit_px = self.params.extraction.min_segment_area;
        for area_px in AREAS_PX.into_iter().filter(|&area_px| area_px < limit_px) {
            let smaller = |params| ExtractionParams { min_segment_area: area_px, ..params };
            if let Some((turned, _)) = self.with_extraction(smaller) {
                return Some(Diagnosis { reason: Reason::Area { limit_px, area_px }, turned });
            }
        }
        let relaxed = |params| ExtractionParams {
            min_width_px: 1,
            max_width_px: None,
            min_contrast: 0.0,
            tracking_margin_px: None,
            ..params
        };
        let (turned, _) = self.with_extraction(relaxed)?;
        Some(Diagnosis { reason: Reason::Limits, turned })
    }

    /// A line that fills less of the cross-sections than any other reason requires, but lies above the threshold in one
    /// piece.
    fn short(&mut self) -> Option<Diagnosis> {
        let Params { stripe_direction, extraction, .. } = self.params;
        let limit_px = extraction.min_segment_area;
        if self.now.points > 0 {
            return None;
        }
        for area_px in AREAS_PX.into_iter().filter(|&area_px| area_px < limit_px) {
            let extraction = ExtractionParams { min_segment_area: area_px, ..extraction };
            for turned in [None, Some(turned(stripe_direction))] {
                let stripe_direction = turned.unwrap_or(stripe_direction);
                let params = Params { stripe_direction, extraction, ..self.params };
                let found = self.trials.find(&params);
                if found.points > 0 && found.unlike <= MOST_UNLIKE {
                    let reason = Reason::Area { limit_px, area_px };
                    return Some(Diagnosis { reason, turned });
                }
            }
        }
        None
    }

    /// A threshold above the line, or below its surroundings.
    fn threshold(&mut self, levels: &Levels) -> Option<Diagnosis> {
        let flooded = levels.above.filter(|&above| above > super::coverage::LARGEST_SHARE);
        if flooded.is_none()
            && let Some((turned, found)) = self.with_extraction(|params| ExtractionParams {
                threshold: Threshold::Adaptive,
                threshold_sigmas: SIGMAS,
                ..params
            })
        {
            let (line, full_scale) = (found.level.round() as u32, levels.full_scale);
            return Some(Diagnosis {
                reason: Reason::ThresholdTooHigh { line, full_scale },
                turned,
            });
        }
        let (turned, _) = self.with_extraction(above_background)?;
        let reason = match flooded {
            Some(above) => Reason::ThresholdTooLow { percent: percent(above) },
            None => Reason::Background,
        };
        Some(Diagnosis { reason, turned })
    }

    /// A line outside the region, or in another channel.
    fn elsewhere(&mut self) -> Option<Diagnosis> {
        if self.params.roi != RegionOfInterest::default() {
            let whole = |params| Params { roi: RegionOfInterest::default(), ..params };
            if let Some((turned, _)) = self.with(whole) {
                return Some(Diagnosis { reason: Reason::Region, turned });
            }
        }
        if !self.image.format().has_colors() {
            return None;
        }
        let others = [Channel::Green, Channel::Red, Channel::Blue];
        others.into_iter().find_map(|channel| self.in_channel(channel))
    }

    /// A line in another channel, above the background of the parameters or a local one.
    fn in_channel(&mut self, channel: Channel) -> Option<Diagnosis> {
        if channel == self.params.channel {
            return None;
        }
        let mut tried = |background: Option<Background>| {
            let (turned, _) = self.with(|params| {
                let own = params.extraction;
                let background = background.unwrap_or(own.background);
                Params { channel, extraction: ExtractionParams { background, ..own }, ..params }
            })?;
            Some(Diagnosis { reason: Reason::Channel { channel, background }, turned })
        };
        tried(None).or_else(|| tried(Some(Background::Local)))
    }
}

/// True if nothing in a picture is brighter than a tenth of full scale.
fn is_dark(levels: &Levels) -> bool {
    f64::from(levels.brightest) < 0.1 * f64::from(levels.full_scale)
}

fn above_background(params: ExtractionParams) -> ExtractionParams {
    ExtractionParams {
        background: Background::Local,
        threshold: Threshold::Adaptive,
        threshold_sigmas: SIGMAS,
        ..params
    }
}

fn percent(share: f64) -> u32 {
    (100.0 * share).round() as u32
}

#[cfg(test)]
mod tests;
