//! The steps compiled once for every level of vector instructions.

use super::{
    blur::Sample,
    broad::BroadRuns,
    fast::FastExtractor,
    lanes::{Centres, Sections},
    load::Loader,
    measure::Points,
    section::{Levels, LineCandidate},
    tile_blur::BlurInput,
    tiles::BlurredTiles,
    vectors::Work,
};
use fearless_simd::Simd;

/// Step 3: blurs where a blurred sample above the threshold can lie; without a threshold, everywhere.
pub(super) struct Blur<'a, S: Sample> {
    /// Receives the blurred samples.
    pub(crate) tiles: &'a mut BlurredTiles<S>,
    /// The frame and its blur.
    pub(crate) input: BlurInput<'a, S>,
    /// Segment threshold, blurred units.
    pub(crate) threshold: Option<u32>,
}

impl<S: Sample> Work for Blur<'_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, vectors: V) {
        self.tiles.compute(vectors, self.input, self.threshold);
    }
}

/// Step 4: finds the candidates. Open candidates of a horizontal stripe stay with the columns.
pub(super) struct Find<'a, S: Sample> {
    /// The extractor, with blurred tiles.
    pub(crate) extractor: &'a mut FastExtractor<S>,
    /// Segment threshold, blurred units.
    pub(crate) threshold: u32,
}

impl<S: Sample> Work for Find<'_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, vectors: V) {
        self.extractor.segment(vectors, self.threshold);
    }
}

/// Sums up candidates too long for cross-sections.
pub(super) struct AddUp<'a, 'p, S: Sample> {
    /// The frame, by cross-sections.
    pub(crate) loader: &'a Loader<'p, S>,
    /// The candidates.
    pub(crate) batch: &'a [LineCandidate],
    /// Receives the sums.
    pub(crate) runs: &'a mut BroadRuns,
}

impl<S: Sample> Work for AddUp<'_, '_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, _: V) {
        self.loader.add_up(self.batch, self.runs);
    }
}

/// Loads a batch of cross-sections.
pub(super) struct Load<'a, 'p, S: Sample> {
    /// The frame, by cross-sections.
    pub(crate) loader: &'a mut Loader<'p, S>,
    /// The candidates.
    pub(crate) batch: &'a [LineCandidate],
    /// Parameters in the units of the samples.
    pub(crate) levels: &'a Levels<'a>,
    /// Receives the cross-sections, one per lane.
    pub(crate) sections: &'a mut Sections,
}

impl<S: Sample> Work for Load<'_, '_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, vectors: V) {
        self.loader.load(vectors, self.batch, self.levels, self.sections);
    }
}

/// Steps 5 to 8 on a batch of cross-sections.
pub(super) struct Measure<'a, F: FnOnce(&mut Centres)> {
    /// The candidates.
    pub(crate) batch: &'a [LineCandidate],
    /// Parameters in the units of the samples.
    pub(crate) levels: &'a Levels<'a>,
    /// The cross-sections, one per lane.
    pub(crate) sections: &'a Sections,
    /// Correction of the centres.
    pub(crate) refine: F,
}

impl<F: FnOnce(&mut Centres)> Work for Measure<'_, F> {
    type Output = Points;
    #[inline(always)]
    fn run<V: Simd>(self, _: V) -> Points {
        Points::measure(self.batch, self.sections, self.levels, self.refine)
    }
}
