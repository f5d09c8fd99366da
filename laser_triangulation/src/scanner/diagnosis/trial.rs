//! Trials: how much of a line an extraction finds in one picture.

use super::super::{
    channel::{AnyPlane, Decoder, SearchedRegion},
    coverage,
    image::Image,
    params::{Background, Params, StripeDirection},
    stripe::{Centerline, Extractor, flag},
};
use crate::statistics::{median, quantile};

/// Shorter unbroken pieces are specks.
const SHORTEST_PIECE: usize = 12;
/// A larger step from one cross-section to the next breaks a piece, pixels, unless the parameters allow larger ones.
const LARGEST_STEP_PX: f64 = 3.0;

/// Returns the share of the cross-sections with a point of an unbroken line, 0 to 1.
pub(crate) fn stripe_share(
    centerline: &Centerline,
    params: &Params,
    searched: &SearchedRegion,
) -> f64 {
    let lines = match params.stripe_direction {
        StripeDirection::Horizontal => searched.width,
        StripeDirection::Vertical => searched.height,
    };
    // Several stripes have several points in a cross-section.
    (points_of_lines(centerline, params) as f64 / lines.max(1) as f64).min(1.0)
}

/// Returns the number of points that lie in unbroken pieces of a line.
fn points_of_lines(centerline: &Centerline, params: &Params) -> usize {
    let largest_step_px = params.extraction.max_step_px.max(LARGEST_STEP_PX);
    let (along, across) = match params.stripe_direction {
        StripeDirection::Horizontal => (&centerline.u_px, &centerline.v_px),
        StripeDirection::Vertical => (&centerline.v_px, &centerline.u_px),
    };
    let (mut total, mut piece) = (0, 0);
    let mut last: Option<(f32, f32)> = None;
    let qualities = centerline.width_px.iter().zip(&centerline.flags);
    for ((&along, &across), (width_px, flags)) in along.iter().zip(across).zip(qualities) {
        // A bright area, not a line.
        if width_px.is_nan() && flags & flag::LOW_CONTRAST != 0 {
            continue;
        }
        let continues = last.is_some_and(|(before, place)| {
            (along - before - 1.0).abs() < 0.5
                && f64::from((across - place).abs()) <= largest_step_px
        });
        if !continues {
            total += long_enough(piece);
            piece = 0;
        }
        piece += 1;
        last = Some((along, across));
    }
    total + long_enough(piece)
}

const fn long_enough(piece: usize) -> usize {
    if piece >= SHORTEST_PIECE { piece } else { 0 }
}

/// A picture that is extracted with different parameters.
pub(crate) struct Trials<'a> {
    image: &'a Image<'a>,
    /// The picture without laser, of the same size and depth.
    reference: Option<&'a Image<'a>>,
    decoder: Decoder,
    centerline: Centerline,
}

/// The result of a trial.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    /// Points in unbroken pieces of a line.
    pub(crate) points: usize,
    /// Share of the cross-sections in which such a point was found, 0 to 1.
    pub(crate) share: f64,
    /// The same of points without a flag of doubt, those with one counted half.
    pub(crate) sound: f64,
    /// Median grey level at the centres, in units of the image; 0 without points.
    pub(crate) level: f64,
    /// Median full width at half maximum, pixels; 0 or NaN without points.
    pub(crate) width_px: f64,
    /// Smallest and largest position across the line of the middle 98 % of the points, pixels.
    pub(crate) range_px: Option<(f32, f32)>,
}

impl<'a> Trials<'a> {
    /// Creates trials on a picture.
    pub(crate) fn new(image: &'a Image<'a>) -> Self {
        let (decoder, centerline) = (Decoder::default(), Centerline::default());
        Self { image, reference: None, decoder, centerline }
    }

    /// Adds the picture without laser that `background: reference` subtracts.
    pub(crate) fn with_reference(self, reference: Option<&'a Image<'a>>) -> Self {
        Self { reference, ..self }
    }

    /// Extracts with these parameters, whose channel must be resolved. Finds nothing if they do not fit the picture.
    pub(crate) fn find(&mut self, params: &Params) -> Found {
        let Some((searched, full_scale)) = fitted(self.image, params) else {
            return Found::default();
        };
        let mut extractor = Extractor::new(params.extraction, params.stripe_direction);
        if let Some(reference) = self.reference
            && params.extraction.background == Background::Reference
        {
            extractor.set_ambient(&self.decoder.decode(reference, params.channel, &searched));
        }
        let plane = self.decoder.decode(self.image, params.channel, &searched);
        let offset = searched.offset();
        extractor.extract_plane(&plane, offset, full_scale, &mut self.centerline);
        let points = points_of_lines(&self.centerline, params);
        let share = stripe_share(&self.centerline, params, &searched);
        let Centerline { u_px, v_px, width_px, intensity, flags, .. } = &mut self.centerline;
        let across = match params.stripe_direction {
            StripeDirection::Horizontal => v_px,
            StripeDirection::Vertical => u_px,
        };
        across.sort_unstable_by(f32::total_cmp);
        let range_px = quantile(across, 0.01).zip(quantile(across, 0.99));
        let doubt = flag::MULTIPLE_PEAKS | flag::MISFIT | flag::CLIPPED;
        let doubted = flags.iter().filter(|flags| *flags & doubt != 0).count();
        let sound = share * (1.0 - 0.5 * doubted as f64 / flags.len().max(1) as f64);
        width_px.retain(|width_px| width_px.is_finite());
        let of = |figures: &mut Vec<f32>| f64::from(median(figures).unwrap_or(0.0));
        let (level, width_px) = (of(intensity), of(width_px));
        Found { points, share, sound, level, width_px, range_px }
    }

    /// Measures the grey levels of the searched picture.
    pub(crate) fn levels(&mut self, params: &Params) -> Option<Levels> {
        let (searched, full_scale) = fitted(self.image, params)?;
        let plane = self.decoder.decode(self.image, params.channel, &searched);
        let above = coverage::share_above_threshold(&plane, &params.extraction, full_scale);
        let mut levels = Levels { full_scale, above, ..Levels::default() };
        match plane {
            AnyPlane::Eight(plane) => plane.rows().for_each(|row| levels.add(row)),
            AnyPlane::Sixteen(plane) => plane.rows().for_each(|row| levels.add(row)),
        }
        Some(levels)
    }
}

fn fitted(image: &Image<'_>, params: &Params) -> Option<(SearchedRegion, u32)> {
    let searched = SearchedRegion::new(params.roi, image.width(), image.height()).ok()?;
    Some((searched, params.full_scale_of(image.format()).ok()?))
}

/// Grey levels of a picture, in its own units.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Levels {
    /// Level of a saturated sample.
    pub(crate) full_scale: u32,
    /// Largest sample.
    pub(crate) brightest: u32,
    /// Share of the samples above a fixed threshold; `None` if there is none.
    pub(crate) above: Option<f64>,
    saturated: u64,
    samples: u64,
}

impl Levels {
    fn add<S: Copy + Into<u32>>(&mut self, row: &[S]) {
        for &sample in row {
            let sample: u32 = sample.into();
            self.brightest = self.brightest.max(sample);
            self.saturated += u64::from(sample >= self.full_scale);
        }
        self.samples += row.len() as u64;
    }

    /// Share of the samples at full scale, 0 to 1.
    pub(crate) fn saturated(&self) -> f64 {
        self.saturated as f64 / self.samples.max(1) as f64
    }
}
