//! The steps that are compiled once for every level of vector instructions.

use super::{
    blur::{Kernel, Sample},
    broad::BroadRuns,
    fast::FastExtractor,
    lanes::{Centres, Sections},
    load::Loader,
    measure::Assembler,
    section::{Levels, LineCandidate},
    tiles::BlurredTiles,
    vectors::Work,
};
use crate::scanner::channel::Plane;
use fearless_simd::Simd;

/// Step 3: where a blurred sample above the threshold can lie; everywhere without one.
pub(super) struct Blur<'a, 'p, S: Sample> {
    /// Where the blurred samples go.
    pub tiles: &'a mut BlurredTiles<S>,
    /// The blur.
    pub kernel: &'a Kernel,
    /// The frame.
    pub plane: &'a Plane<'p, S>,
    /// Blurred units.
    pub threshold: Option<u32>,
}

impl<S: Sample> Work for Blur<'_, '_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, vectors: V) {
        self.tiles.compute(vectors, self.plane, self.kernel, self.threshold);
    }
}

/// Step 4: the candidates; those of a horizontal stripe that have not ended stay with the columns.
pub(super) struct Find<'a, S: Sample> {
    /// Its tiles are blurred.
    pub extractor: &'a mut FastExtractor<S>,
    /// Blurred units.
    pub threshold: u32,
}

impl<S: Sample> Work for Find<'_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, vectors: V) {
        self.extractor.segment(vectors, self.threshold);
    }
}

/// Adds up candidates too long for cross-sections.
pub(super) struct AddUp<'a, 'p, S: Sample> {
    /// The frame, by cross-sections.
    pub loader: &'a Loader<'p, S>,
    /// The candidates.
    pub batch: &'a [LineCandidate],
    /// Where the sums go.
    pub runs: &'a mut BroadRuns,
}

impl<S: Sample> Work for AddUp<'_, '_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, _: V) {
        self.loader.add_up(self.batch, self.runs);
    }
}

/// Takes a batch of cross-sections.
pub(super) struct Load<'a, 'p, S: Sample> {
    /// The frame, by cross-sections.
    pub loader: &'a mut Loader<'p, S>,
    /// The candidates.
    pub batch: &'a [LineCandidate],
    /// Parameters in the units of the samples.
    pub levels: &'a Levels<'a>,
    /// The cross-sections, one a lane.
    pub sections: &'a mut Sections,
}

impl<S: Sample> Work for Load<'_, '_, S> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, vectors: V) {
        self.loader.load(vectors, self.batch, self.levels, self.sections);
    }
}

/// Steps 5 to 8 on a batch of cross-sections.
pub(super) struct Measure<'a, 'c, F: FnOnce(&mut Centres)> {
    /// Where the points go.
    pub assembler: &'a mut Assembler<'c>,
    /// The candidates.
    pub batch: &'a [LineCandidate],
    /// Parameters in the units of the samples.
    pub levels: &'a Levels<'a>,
    /// The cross-sections, one a lane.
    pub sections: &'a Sections,
    /// May move the centres.
    pub refine: F,
}

impl<F: FnOnce(&mut Centres)> Work for Measure<'_, '_, F> {
    type Output = ();
    #[inline(always)]
    fn run<V: Simd>(self, _: V) {
        self.assembler.push(self.batch, self.sections, self.levels, self.refine);
    }
}
