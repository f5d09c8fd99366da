//! Recordings of a live node that failed.

/// Recordings that failed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Failures {
    /// Number of recordings that could not start, ended early or were not closed.
    pub(crate) num: u64,
    /// Reason of the first one.
    pub(crate) first: Option<String>,
}

impl Failures {
    /// Adds later failures.
    pub(crate) fn add(&mut self, later: &Self) {
        self.num += later.num;
        if self.first.is_none() {
            self.first.clone_from(&later.first);
        }
    }
}
