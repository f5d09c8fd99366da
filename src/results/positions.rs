//! Positions of a scan's profiles.

use super::{Results, recorded_profile};
use crate::msg::laser_profiler_msgs::FrameTrace;

impl Results {
    /// Returns the position of each profile of the scan, metres or radians according to the axis.
    ///
    /// # Errors
    /// The reason why positions are unknown: no profiles in the bag, or not as many as the slices have.
    pub(super) fn positions(&self) -> Result<Vec<f64>, String> {
        let topic = self.profile_topic().ok_or(
            "positions are unknown: the recording has no profiles beside its point clouds",
        )?;
        let mut frames = Vec::new();
        for message in self.messages(&topic).flatten() {
            let Ok(profile) = recorded_profile(&message) else { continue };
            let trace = profile.trace;
            // A frame without a position belongs to no scan.
            let is_unknown = trace.encoder_source == FrameTrace::SOURCE_NONE
                && trace.encoder_status & FrameTrace::ENCODER_STALE != 0;
            if !is_unknown {
                frames.push((trace.frame_number, trace.position));
            }
        }
        let mut positions = Vec::new();
        for (number, account) in self.accounts().enumerate() {
            let before = positions.len();
            let [first, last] = account.frames;
            let inside = frames.iter().filter(|(frame, _)| (first..=last).contains(frame));
            positions.extend(inside.map(|(_, position)| *position));
            let found = positions.len() - before;
            if found != account.profiles as usize {
                return Err(format!(
                    "slice {number} has {} profiles, positions are stated for {found}",
                    account.profiles
                ));
            }
        }
        Ok(positions)
    }
}
