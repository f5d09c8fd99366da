//! The likely reasons for a picture without a stripe, in words.

use std::fmt;

use super::{
    super::params::{Background, Channel, StripeDirection},
    SIGMAS,
};

/// The likely reason for a picture without a stripe. Levels are those of the image, in whole grey levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// Most of the picture is at full scale.
    Saturated {
        /// Share of the samples at full scale, percent.
        percent: u32,
    },
    /// Nothing in the picture is brighter than its noise.
    Dark {
        /// Largest sample.
        brightest: u32,
        /// Level of a saturated sample.
        full_scale: u32,
    },
    /// The samples use another range than the parameter `full_scale` states.
    FullScale {
        /// Largest sample.
        brightest: u32,
        /// Largest level of the encoding or of the parameter.
        stated: u32,
        /// The value of `full_scale` under which the line is found.
        full_scale: u32,
    },
    /// The line runs in the other direction.
    Direction,
    /// The line is darker than the threshold.
    ThresholdTooHigh {
        /// Level of the line.
        line: u32,
        /// Level of a saturated sample.
        full_scale: u32,
    },
    /// The surroundings are brighter than the threshold.
    ThresholdTooLow {
        /// Share of the searched pixels above the threshold, percent.
        percent: u32,
    },
    /// The line is found above a local background only.
    Background,
    /// The reference without laser contains the line, or is brighter than the picture.
    Reference,
    /// The line is smaller than `extraction.min_segment_area`.
    Area {
        /// The parameter, pixels.
        limit_px: u32,
        /// The value under which the line is found, pixels.
        area_px: u32,
    },
    /// The limits of width or contrast reject the line.
    Limits,
    /// The line lies outside the region of interest.
    Region,
    /// Another channel shows the line.
    Channel {
        /// The channel.
        channel: Channel,
        /// The background above which it shows the line, if that is not the one of the parameters.
        background: Option<Background>,
    },
    /// The line that was found hardly looks like one.
    Doubtful {
        /// Share of its points that do not, percent.
        percent: u32,
    },
    /// No line was found with any parameter.
    NoLine,
}

/// The likely reason for a picture without a stripe, and the parameters that mend it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// The reason.
    pub reason: Reason,
    /// The direction in which the line was found, if it is not that of the parameters.
    pub turned: Option<StripeDirection>,
}

/// Number of the kinds of [`Reason`].
pub const REASONS: usize = 14;

impl Reason {
    /// Returns the place of its kind in a list of [`REASONS`] kinds.
    #[must_use]
    pub const fn index(&self) -> usize {
        match self {
            Self::Saturated { .. } => 0,
            Self::Dark { .. } => 1,
            Self::FullScale { .. } => 2,
            Self::Direction => 3,
            Self::ThresholdTooHigh { .. } => 4,
            Self::ThresholdTooLow { .. } => 5,
            Self::Background => 6,
            Self::Reference => 7,
            Self::Area { .. } => 8,
            Self::Limits => 9,
            Self::Region => 10,
            Self::Channel { .. } => 11,
            Self::NoLine => 12,
            Self::Doubtful { .. } => 13,
        }
    }

    /// Returns the name of its kind.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Saturated { .. } => "saturated",
            Self::Dark { .. } => "too_dark",
            Self::FullScale { .. } => "full_scale",
            Self::Direction => "stripe_direction",
            Self::ThresholdTooHigh { .. } => "threshold_too_high",
            Self::ThresholdTooLow { .. } => "threshold_too_low",
            Self::Background => "background",
            Self::Reference => "reference",
            Self::Area { .. } => "min_segment_area",
            Self::Limits => "limits",
            Self::Region => "roi",
            Self::Channel { .. } => "channel",
            Self::NoLine => "no_line",
            Self::Doubtful { .. } => "doubtful",
        }
    }
}

impl Reason {
    /// Writes the reason and what mends it.
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Saturated { percent } => write!(
                f,
                "{percent} % of the picture is at full scale: shorten the exposure, or close the aperture"
            ),
            Self::Dark { brightest, full_scale } => write!(
                f,
                "the picture is dark, its brightest sample is {brightest} of {full_scale}: switch the laser on, or expose \
                 longer"
            ),
            Self::FullScale { brightest, stated, full_scale } => write!(
                f,
                "the largest sample is {brightest}, but full scale is {stated}: unless the camera's largest level is higher still, \
                 set full_scale: {full_scale}"
            ),
            Self::ThresholdTooHigh { line, full_scale } => write!(
                f,
                "the line is only about {line} of {full_scale} grey levels bright, too dark for the threshold: expose longer, \
                 or set extraction.threshold: adaptive and extraction.threshold_sigmas: {SIGMAS:.1}"
            ),
            Self::ThresholdTooLow { percent } => write!(
                f,
                "{percent} % of the picture is above extraction.segment_threshold: set extraction.background: local, \
                 extraction.threshold: adaptive and extraction.threshold_sigmas: {SIGMAS:.1}"
            ),
            Self::Background => write!(
                f,
                "the surroundings are as bright as the line: set extraction.background: local, extraction.threshold: adaptive and \
                 extraction.threshold_sigmas: {SIGMAS:.1}"
            ),
            Self::Direction => f.write_str("the line runs in the other direction: set"),
            Self::Reference => f.write_str(
                "the reference picture (extraction.background_file) hides the line: take it again without laser",
            ),
            Self::Area { limit_px, area_px } => write!(
                f,
                "the line covers at most extraction.min_segment_area ({limit_px}) pixels: set it to {area_px}"
            ),
            Self::Limits => f.write_str(
                "the line does not meet extraction.min_width, max_width and min_contrast: relax them",
            ),
            Self::Region => {
                f.write_str("the line lies outside the region of interest: correct roi.*")
            }
            Self::Channel { channel, background } => {
                write!(f, "another channel shows the line: set channel: {}", channel.name())?;
                background.map_or(Ok(()), |background| {
                    write!(f, " and extraction.background: {}", background.name())
                })
            }
            Self::Doubtful { percent } => write!(
                f,
                "something bright was found, but {percent} % of its points do not look like a line: another line or a glow \
                 beside it (roi.*, extraction.max_stripes), the border of the picture, or no laser"
            ),
            Self::NoLine => f.write_str(
                "no line was found in either direction: is the laser on, and the line in the picture and in focus?",
            ),
        }
    }
}

impl fmt::Display for Diagnosis {
    /// One clause with the reason and, behind a colon, what mends it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.reason.write(f)?;
        match (self.turned, self.reason) {
            (None, _) | (_, Reason::NoLine | Reason::Doubtful { .. }) => Ok(()),
            (Some(direction), Reason::Direction) => {
                write!(f, " stripe_direction: {}", direction.name())
            }
            (Some(direction), _) => {
                write!(f, "; and set stripe_direction: {}", direction.name())
            }
        }
    }
}
