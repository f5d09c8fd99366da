//! Where the profiles of a scan were taken.

use super::Results;
use crate::{
    bag::Filter,
    msg::{
        cdr,
        laser_profiler_msgs::{FrameTrace, Profile},
    },
};

impl Results {
    /// The position of each profile of the scan, in the unit of its axis; or why they are not known.
    pub(in crate::cli) fn positions(&self) -> Result<Vec<f64>, String> {
        let missing = || "the recording has no profiles beside its points: where they were taken";
        let topic = self.profile_topic().ok_or_else(missing)?;
        let mut frames = Vec::new();
        for message in self.bag.messages(&Filter::topics([topic.as_str()])).flatten() {
            let Ok(profile) = cdr::decode::<Profile<'_>>(&message.data) else { continue };
            let trace = profile.trace;
            // A frame whose position nobody knew is in no scan.
            let is_unknown = trace.encoder_source == FrameTrace::SOURCE_NONE
                && trace.encoder_status & FrameTrace::ENCODER_STALE != 0;
            if !is_unknown {
                frames.push((trace.frame_number, trace.position));
            }
        }
        let mut positions = Vec::new();
        let accounts = (0_u64..).zip(&self.accounts).filter(|(at, _)| self.slices.contains(at));
        for (number, account) in accounts {
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
