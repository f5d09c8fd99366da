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
    (Pieces::of(centerline, params).points as f64 / lines.max(1) as f64).min(1.0)
}

/// The unbroken pieces of a line.
#[derive(Clone, Copy, Debug, Default)]
struct Pieces {
    count: usize,
    /// Points of all pieces.
    points: usize,
}

impl Pieces {
    fn add(&mut self, points: usize) {
        if points >= SHORTEST_PIECE {
            self.count += 1;
            self.points += points;
        }
    }

    fn of(centerline: &Centerline, params: &Params) -> Self {
        let largest_step_px = params.extraction.max_step_px.max(LARGEST_STEP_PX);
        let (along, across) = centerline.along_and_across(params.stripe_direction);
        let (mut all, mut piece) = (Self::default(), 0);
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
                all.add(piece);
                piece = 0;
            }
            piece += 1;
            last = Some((along, across));
        }
        all.add(piece);
        all
    }
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
    /// That share less what speaks against the line, see [`score`]; 0 to 1.
    pub(crate) score: f64,
    /// Median grey level at the centres, in units of the image; 0 without points.
    pub(crate) level: f64,
    /// Median full width at half maximum, pixels; 0 or NaN without points.
    pub(crate) width_px: f64,
    /// The width that three quarters of the points do not exceed, pixels; 0 without points.
    pub(crate) wide_px: f64,
    /// Share of the points with a sample at full scale, 0 to 1.
    pub(crate) saturated: f64,
    /// Share of the points whose cross-sections do not look like a line, see [`unlike`]; 0 to 1.
    pub(crate) unlike: f64,
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
        let share = stripe_share(&self.centerline, params, &searched);
        let pieces = Pieces::of(&self.centerline, params);
        let unlike = unlike(&self.centerline);
        let score = score(&mut self.centerline, pieces, share);
        let saturated = share_of(&self.centerline, flag::SATURATED);
        let Centerline { u_px, v_px, width_px, intensity, .. } = &mut self.centerline;
        let across = match params.stripe_direction {
            StripeDirection::Horizontal => v_px,
            StripeDirection::Vertical => u_px,
        };
        across.sort_unstable_by(f32::total_cmp);
        let range_px = quantile(across, 0.01).zip(quantile(across, 0.99));
        let level = f64::from(median(intensity).unwrap_or(0.0));
        let width = |of| f64::from(quantile(width_px, of).unwrap_or(0.0));
        let (points, width_px, wide_px) = (pieces.points, width(0.5), width(0.75));
        Found { points, share, score, level, width_px, wide_px, saturated, unlike, range_px }
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

/// Returns the share of the points that carry any of these bits.
fn share_of(centerline: &Centerline, bits: u8) -> f64 {
    centerline.num_flagged(bits) as f64 / centerline.len().max(1) as f64
}

/// Returns the share of the points whose cross-sections do not look like a line: they have no edge on one side, or neither
/// the shape of a single stripe nor a candidate of their own. A laser line in a cluttered or glowing scene has one of
/// these faults in many places; an edge, a pattern or a bright area has them nearly everywhere.
fn unlike(centerline: &Centerline) -> f64 {
    let is_unlike = |(width_px, flags): (&f32, &u8)| {
        width_px.is_nan() || (flags & flag::MISFIT != 0 && flags & flag::MULTIPLE_PEAKS != 0)
    };
    let points = centerline.width_px.iter().zip(&centerline.flags);
    let num_unlike = points.filter(|&point| is_unlike(point)).count();
    num_unlike as f64 / centerline.len().max(1) as f64
}

/// Judges a line: the share of the cross-sections that it fills, less what a search that leaves the line for clutter shows.
/// It breaks more often, each time for the length of a piece too short to count. It is narrower than half or wider than
/// twice the median width in places. More of its points are in doubt; other candidates beside them count least, because
/// the line may have been selected rightly. Sorts the widths of the points, and drops those that are not known.
fn score(centerline: &mut Centerline, pieces: Pieces, share: f64) -> f64 {
    let doubted = share_of(centerline, flag::MISFIT | flag::CLIPPED);
    let rivalled = share_of(centerline, flag::MULTIPLE_PEAKS);
    let num_points = centerline.len().max(1) as f64;
    let widths_px = &mut centerline.width_px;
    widths_px.retain(|width_px| width_px.is_finite());
    widths_px.sort_unstable_by(f32::total_cmp);
    let median_px = quantile(widths_px, 0.5).unwrap_or(0.0);
    let is_usual = |width_px: &&f32| (0.5 * median_px..=2.0 * median_px).contains(*width_px);
    let num_unusual = widths_px.len() - widths_px.iter().filter(is_usual).count();
    let broken = share * (pieces.count * SHORTEST_PIECE) as f64 / pieces.points.max(1) as f64;
    let sound = share * (1.0 - 0.25 * doubted - 0.125 * rivalled);
    (sound - broken - 0.5 * num_unusual as f64 / num_points).max(0.0)
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
