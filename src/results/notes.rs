//! Notes on what is missing from a recording or could not be read.

/// Distinct notes for the reader of a report, and the number of losses among them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    texts: Vec<String>,
    num_lost: u64,
}

impl Notes {
    /// Maximum number of notes; further ones are dropped.
    const MAX_NOTES: usize = 24;

    /// Adds a note unless it exists already.
    pub(crate) fn add(&mut self, note: impl Into<String>) {
        let note = note.into();
        if !self.texts.contains(&note) && self.texts.len() < Self::MAX_NOTES {
            self.texts.push(note);
        }
    }

    /// Adds a note on data that could not be read. A repeated note is one loss.
    pub(crate) fn add_loss(&mut self, note: impl Into<String>) {
        let note = note.into();
        if !self.texts.contains(&note) {
            self.num_lost += 1;
            self.add(note);
        }
    }

    /// Logs all notes as warnings.
    pub(crate) fn log(&self) {
        self.texts.iter().for_each(|note| tracing::warn!("{note}"));
    }

    /// Returns the notes in the order in which they were added.
    #[must_use]
    pub(crate) fn texts(&self) -> &[String] {
        &self.texts
    }

    /// Returns the number of different losses.
    #[must_use]
    pub(crate) const fn num_lost(&self) -> u64 {
        self.num_lost
    }
}
