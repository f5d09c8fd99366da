//! The optimized method: costly steps run only where the stripe can be. Equals [`reference`](super::reference) bit for
//! bit.

use super::{
    Centerline, SigmaParts,
    assemble::Assembler,
    background::BackgroundFilter,
    blur::{Kernel, Sample, blurred_at},
    broad::BroadRuns,
    columns::Columns,
    lanes::{Centres, LANES, Sections},
    load::Loader,
    measure::Points,
    misfit::Shapes,
    noise_estimate::NoiseEstimator,
    picture::Picture,
    section::{Candidate, Levels, LineCandidate},
    segment::Regions,
    select::Selector,
    steger::Ridge,
    texture::TextureEstimator,
    threshold::NoiseThreshold,
    tile_blur::BlurInput,
    tiles::BlurredTiles,
    valley::ValleyNoiseEstimator,
    vectors::Vectors,
    work::{AddUp, Blur, Find, Load, Measure},
};
use crate::scanner::{
    channel::{Offset, Plane},
    params::{ExtractionParams, Method, NoiseSource, StripeDirection, Threshold},
};
use fearless_simd::Simd;

/// Extracts centrelines frame after frame. Allocates nothing after the first frame of a size.
#[derive(Debug)]
pub(super) struct FastExtractor<S: Sample> {
    kernel: Kernel,
    params: ExtractionParams,
    direction: StripeDirection,
    tiles: BlurredTiles<S>,
    background: BackgroundFilter<S::Sum>,
    noise_threshold: NoiseThreshold,
    regions: Regions,
    columns: Columns,
    found: Vec<LineCandidate>,
    selector: Selector,
    chosen: Vec<LineCandidate>,
    sections: Sections,
    runs: BroadRuns,
    vectors: Vectors,
    noise: NoiseEstimator,
    valleys: ValleyNoiseEstimator,
    ridge: Ridge,
    shapes: Shapes,
    texture: TextureEstimator,
}

impl<S: Sample> FastExtractor<S> {
    /// Creates an extractor with these settings.
    pub(super) fn new(params: ExtractionParams, direction: StripeDirection) -> Self {
        Self {
            kernel: Kernel::gaussian(params.blur_radius),
            params,
            direction,
            tiles: BlurredTiles::default(),
            background: BackgroundFilter::new(&params),
            noise_threshold: NoiseThreshold::default(),
            regions: Regions::default(),
            columns: Columns::default(),
            found: Vec::new(),
            selector: Selector::new(params),
            chosen: Vec::new(),
            sections: Sections::default(),
            runs: BroadRuns::default(),
            vectors: Vectors::widest(),
            noise: NoiseEstimator::default(),
            valleys: ValleyNoiseEstimator::default(),
            ridge: Ridge::new(params.ridge_sigma_px),
            shapes: Shapes::default(),
            texture: TextureEstimator::new(&params, direction),
        }
    }

    /// Stores a frame without laser light for `background: reference`. It must have the size of the frames that follow.
    pub(super) fn set_ambient(&mut self, plane: &Plane<'_, S>) {
        let Self { kernel, tiles, background, vectors, .. } = self;
        vectors.run(Blur { tiles, input: BlurInput { plane, kernel }, threshold: None });
        background.set_ambient(tiles.samples_mut());
    }

    /// Discards the last frame's stripes: the next frame is searched everywhere.
    pub(super) const fn reset(&mut self) {
        self.selector.reset();
    }

    /// Replaces `centerline` by that of a plane whose top-left sample lies at `offset` in the image. Returns what its
    /// standard deviations consist of; `None` without points.
    pub(super) fn extract(
        &mut self,
        plane: &Plane<'_, S>,
        offset: Offset,
        full_scale: u32,
        centerline: &mut Centerline,
    ) -> Option<SigmaParts> {
        let threshold = self.find(plane, full_scale);
        let Self {
            kernel,
            params,
            direction,
            tiles,
            selector,
            found,
            chosen,
            sections,
            runs,
            vectors,
            noise,
            valleys,
            ridge,
            shapes,
            texture,
            ..
        } = self;
        let mut levels = Levels::new(params, kernel, full_scale);
        if params.threshold == Threshold::Adaptive {
            levels = levels.with_segment_threshold(threshold);
        }
        let sample = |line: u32, position: u32| match direction {
            StripeDirection::Horizontal => tiles.known(line as usize, position as usize),
            StripeDirection::Vertical => tiles.known(position as usize, line as usize),
        };
        let picture = Picture { plane, direction: *direction };
        valleys.adapt(&picture, found, &mut levels);
        selector.select(found, &levels, sample, chosen);
        if params.noise == NoiseSource::Estimated {
            noise.estimate(&picture, chosen, full_scale, &mut levels.noise);
        }
        let (_, length) = picture.size();
        let mut assembler = Assembler::new(centerline, shapes, *direction, offset, length);
        let mut loader =
            Loader { input: BlurInput { plane, kernel }, tiles, direction: *direction };
        let levels = &levels;
        let mut rest = &chosen[..];
        while let Some(next) = rest.first() {
            let is_broad = next.candidate.is_broad();
            let alike = (0..).zip(rest).take_while(|(i, found)| {
                let is_next = !is_broad || found.line == next.line + i;
                found.candidate.is_broad() == is_broad && is_next
            });
            let count = alike.take(if is_broad { usize::MAX } else { LANES }).count();
            let (batch, behind) = rest.split_at(count);
            rest = behind;
            if is_broad {
                vectors.run(AddUp { loader: &loader, batch, runs });
                for (i, found) in batch.iter().enumerate() {
                    assembler.push_broad(found, &loader.broad(found, i, runs), levels);
                }
                continue;
            }
            let points = Points::of_batch(batch, |batch| {
                vectors.run(Load { loader: &mut loader, batch, levels, sections });
                let refine = |centres: &mut Centres| {
                    if params.method == Method::Steger {
                        ridge.refine(&picture, batch, levels, centres);
                    }
                };
                vectors.run(Measure { batch, levels, sections, refine })
            });
            assembler.push(batch, &points, levels);
        }
        let sigma_parts = texture.add_to(centerline);
        shapes.judge(centerline, *direction, kernel.weights().len());
        sigma_parts
    }

    /// Finds all candidates, sorted by line and position; returns the segment threshold, blurred units.
    fn find(&mut self, plane: &Plane<'_, S>, full_scale: u32) -> u32 {
        let Self { kernel, params, direction, tiles, background, noise_threshold, vectors, .. } =
            self;
        let mut threshold = Levels::new(params, kernel, full_scale).segment_threshold;
        let is_adaptive = params.threshold == Threshold::Adaptive;
        let mut adapt = |sample: &dyn Fn(usize, usize) -> u32| {
            let size = (plane.width, plane.height);
            noise_threshold.find(size, sample, params.threshold_sigmas)
        };
        if background.is_needed() {
            vectors.run(Blur { tiles, input: BlurInput { plane, kernel }, threshold: None });
            background.subtract(tiles.samples_mut(), plane.width, *direction);
            if is_adaptive {
                threshold = adapt(&|x, y| tiles.known(x, y));
            }
        } else {
            if is_adaptive {
                threshold = adapt(&|x, y| blurred_at(plane, kernel, x, y));
            }
            vectors.run(Blur {
                tiles,
                input: BlurInput { plane, kernel },
                threshold: Some(threshold),
            });
        }
        self.found.clear();
        self.vectors.run(Find { extractor: self, threshold });
        if self.direction == StripeDirection::Horizontal {
            self.columns.finish(&mut self.found);
        }
        threshold
    }

    /// Step 4, after the tiles are blurred.
    #[inline(always)]
    pub(super) fn segment<V: Simd>(&mut self, vectors: V, threshold: u32) {
        self.tiles.segment(vectors, threshold, &mut self.regions);
        match self.direction {
            StripeDirection::Horizontal => self.find_in_columns(),
            StripeDirection::Vertical => self.find_in_rows(),
        }
    }

    /// Returns the candidates of a vertical stripe: the kept runs themselves.
    #[inline(always)]
    fn find_in_rows(&mut self) {
        let Self { tiles, regions, found, params, .. } = self;
        found.extend(regions.larger_than(params.min_segment_area).map(|run| {
            let samples = &tiles.row(run.row as usize)[run.start as usize..run.end as usize];
            let samples = samples.iter().map(|&sample| sample.into());
            LineCandidate { line: run.row, candidate: Candidate::of_run(run.start, samples) }
        }));
    }

    /// Returns the candidates of a horizontal stripe: the kept runs, collected column by column.
    #[inline(always)]
    fn find_in_columns(&mut self) {
        let Self { tiles, regions, found, params, .. } = self;
        self.columns.clear(tiles.width());
        for run in regions.larger_than(params.min_segment_area) {
            let samples = &tiles.row(run.row as usize)[run.start as usize..run.end as usize];
            self.columns.add(run.row, run.start, samples, found);
        }
    }
}

#[cfg(test)]
mod tests;
