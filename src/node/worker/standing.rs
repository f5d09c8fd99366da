//! Reports scans whose profiles lie at one place, with the parameter that moves them apart.

use super::measurer::Outcome;
use crate::{
    msg::diagnostic_msgs::DiagnosticStatus,
    node::status::{Interval, Note},
    scanner::pipeline::Pipeline,
};

/// Profiles after which an open scan is judged for the first time: a scan may begin before the motion does.
const PATIENCE: u32 = 16;

/// Counts the profiles of the open scan that lie where the one before lies.
#[derive(Debug, Default)]
pub(super) struct Standing {
    profiles: u32,
    standing: u32,
    was_logged: bool,
    remedy: &'static str,
}

impl Standing {
    /// Notes a measured frame, and judges the scan whenever its length has doubled.
    pub(super) fn note_profile(&mut self, outcome: &Outcome, pipeline: &Pipeline) {
        if outcome.position.is_none() || pipeline.scan_id().is_none() {
            return;
        }
        self.profiles = self.profiles.saturating_add(1);
        self.standing += u32::from(outcome.stands);
        self.remedy = pipeline.standstill_remedy();
        if self.profiles >= PATIENCE && self.profiles.is_power_of_two() {
            self.judge();
        }
    }

    /// Judges the scan at its end.
    pub(super) fn end_scan(&mut self) {
        self.judge();
        (self.profiles, self.standing) = (0, 0);
    }

    /// Warns once if at least half of the profiles stand.
    fn judge(&mut self) {
        let &mut Self { profiles, standing, remedy, .. } = self;
        if standing == 0 || standing < profiles / 2 || self.was_logged {
            return;
        }
        self.was_logged = true;
        tracing::warn!(
            "{standing} of {profiles} profiles lie where the one before lies, which is no surface: {remedy}; their slices are \
             DEGRADED; further ones are only counted"
        );
    }

    /// Returns a note for the diagnostics of an interval in which the profiles stood.
    pub(super) fn note(&self, interval: Interval) -> Option<Note> {
        interval.stands.then(|| Note {
            level: DiagnosticStatus::WARN,
            key: "motion",
            text: format!("profiles lie at one place, which is no surface: {}", self.remedy),
        })
    }
}
