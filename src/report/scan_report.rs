//! The report of one scan: everything that its page, its figures and its summary show.

use super::{
    chart::{Chart, Curve},
    described,
    frames::{self, FrameSelection},
    gathered::Gathered,
    grid::Extent,
    map::{self, Measured},
    overlay::Overlay,
    page::Page,
    quality::Quality,
};
use crate::results::{Notes, ResultsRecording, ScanSelection};

/// The scan of a report.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReportSelection<'a> {
    /// The scan that the map shows.
    pub(crate) scan: &'a ScanSelection,
    /// Frames that are shown with their centrelines.
    pub(crate) frames: &'a FrameSelection,
}

/// Figures of one scan.
pub(crate) struct ScanReport<'a> {
    recording: &'a ResultsRecording,
    gathered: Gathered,
    /// Frames with their centrelines.
    pub(crate) overlays: Vec<Overlay>,
    /// The map; `None` without a point or a centreline.
    pub(crate) measured: Option<Measured>,
    /// Curves over frames and time.
    pub(crate) charts: Vec<Chart>,
}

impl<'a> ScanReport<'a> {
    /// Reads a recording. Notes what is missing; calls `on_frame` after each centreline.
    ///
    /// # Errors
    /// [`SelectionError`](crate::results::SelectionError) for a topic or a scan that is not there.
    pub(crate) fn read(
        recording: &'a ResultsRecording,
        selection: ReportSelection<'_>,
        notes: &mut Notes,
        on_frame: impl FnMut(),
    ) -> anyhow::Result<Self> {
        let gathered = Gathered::read(recording, notes, on_frame);
        let overlays = frames::overlays(selection.frames, recording, &gathered, notes);
        let measured = map::read(selection.scan, recording, notes)?;
        let mut charts = gathered.quality.charts();
        charts.extend(gathered.charts());
        charts.retain(|chart| chart.curves.iter().any(Curve::is_something));
        Ok(Self { recording, gathered, overlays, measured, charts })
    }

    /// Quality of the centrelines.
    pub(crate) const fn quality(&self) -> &Quality {
        &self.gathered.quality
    }

    /// Extent of the map; `None` without a map.
    pub(crate) fn extent(&self) -> Option<&Extent> {
        self.measured.as_ref().map(|measured| &measured.extent)
    }

    /// The page.
    pub(crate) fn page(self, notes: &Notes) -> Page {
        Page {
            title: described::title(self.recording),
            subtitle: described::subtitle(self.recording, &self.gathered),
            facts: described::facts(&self.gathered, self.extent()),
            notes: notes.texts().to_vec(),
            tables: described::tables(self.recording, &self.gathered),
            documents: described::documents(self.recording),
            map: self.measured.map(|measured| measured.map),
            overlays: self.overlays,
            charts: self.charts,
            program: super::PROGRAM.to_owned(),
        }
    }
}
