//! Two results of one recording, compared frame by frame.

use anyhow::ensure;

use super::{comparison_page, difference::Differences, page::Page, spread::Figures};
use crate::results::{Notes, Reason, ResultsRecording, for_each_pair, reasons};

/// Differences of two results, B minus A, and the reasons for them.
pub(crate) struct Comparison<'a> {
    /// A and B.
    pub(crate) recordings: [&'a ResultsRecording; 2],
    /// Method and hash of the first frame of A and of B.
    pub(crate) methods: [String; 2],
    pub(crate) differences: Differences,
    pub(crate) reasons: Vec<Reason>,
}

impl<'a> Comparison<'a> {
    /// Reads both recordings once.
    ///
    /// # Errors
    /// Results without centrelines or without a common frame.
    pub(crate) fn read(
        recordings: [&'a ResultsRecording; 2],
        notes: &mut Notes,
    ) -> anyhow::Result<Self> {
        let mut differences = Differences::default();
        let mut methods = [String::new(), String::new()];
        let [only_a, only_b] = for_each_pair(recordings, notes, |pair| {
            let unknown = methods.iter_mut().zip(pair.lines).filter(|(known, _)| known.is_empty());
            for (method, line) in unknown {
                *method = line.method.to_string();
            }
            differences.add(pair);
        })?;
        let [both, _, _] = differences.num_frames;
        differences.num_frames = [both, only_a, only_b];
        ensure!(both > 0, "no frame is in both: {only_a} frames only in A, {only_b} only in B");
        let reasons = reasons(recordings.map(ResultsRecording::provenance));
        Ok(Self { recordings, methods, differences, reasons })
    }

    /// A recorded text of A (0) or B (1); a dash where it is missing.
    pub(crate) fn recorded(&self, which: usize, key: &str) -> &str {
        self.recordings[which].provenance().recorded(key).unwrap_or("–")
    }

    /// Figures of the differences in the image, pixels; `None` without points in both.
    pub(crate) fn figures_px(&self) -> Option<Figures> {
        Some(self.differences.pixels.figures()).filter(|figures| figures.num > 0)
    }

    /// Figures of the differences in height, micrometres; `None` without profiles in both.
    pub(crate) fn figures_um(&self) -> Option<Figures> {
        Some(self.differences.heights.figures()).filter(|figures| figures.num > 0)
    }

    /// The page, for which both recordings are read again.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub(crate) fn page(&self, notes: &mut Notes) -> anyhow::Result<Page> {
        comparison_page::page(self, notes)
    }
}
