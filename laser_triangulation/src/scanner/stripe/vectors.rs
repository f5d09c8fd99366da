//! Selects the machine's vector instructions. Every level gives the same bits: Rust neither contracts nor reorders.

use fearless_simd::{Level, Simd, dispatch};

/// Work that is compiled once for every level.
pub(super) trait Work {
    /// Result of the work.
    type Output;
    /// Does the work. Mark it `#[inline(always)]`, like everything below it that should use the wider instructions.
    fn run<V: Simd>(self, vectors: V) -> Self::Output;
}

/// A level of vector instructions that this machine has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vectors(Level);

impl Vectors {
    /// Returns the widest level.
    pub(super) fn widest() -> Self {
        Self(Level::new())
    }

    /// Returns all levels, narrowest first.
    #[cfg(test)]
    pub(super) fn all() -> Vec<Self> {
        let widest = Level::new();
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        let wider = [widest.as_sse4_2().map(Level::Sse4_2), widest.as_avx2().map(Level::Avx2)];
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let wider = [];
        let levels = [Some(Level::baseline())].into_iter().chain(wider).chain([Some(widest)]);
        levels.flatten().map(Self).collect()
    }

    /// Does the work with the instructions of this level.
    pub(super) fn run<W: Work>(self, work: W) -> W::Output {
        dispatch!(self.0, vectors => work.run(vectors))
    }
}
