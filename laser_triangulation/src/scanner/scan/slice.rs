//! A slice of a scan, and the account of its frames.

use crate::scanner::axis::RawPosition;

/// A point of the part: x, y, z, metres in the part's frame ([`Placement`](crate::scanner::motion::placement::Placement)); then the
/// grey level at the centreline as a share of full scale, 0 to 1. NaN in all four: not measured.
pub type Point = [f32; 4];

/// Worst state in a slice, as in `SliceInfo.state`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum SliceState {
    /// Every expected frame is in the slice.
    #[default]
    Complete = 0,
    /// Frames are missing or were rejected; positions are still correct.
    Gaps = 1,
    /// Positions are in doubt, or at least half of the profiles lie where the one before lies: no surface.
    Degraded = 2,
    /// The scan ended early.
    Aborted = 3,
}

/// Coverage and losses of a slice. Always `expected = accepted + missing + rejected`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SliceAccount {
    /// Identity of the scan, a UUID of version 8 made from the stream: the same frames give the same bytes.
    pub scan_id: [u8; 16],
    /// Number of this slice in its scan, from 0.
    pub slice_index: u32,
    /// True if the scan ends with this slice.
    pub last_slice: bool,
    /// Number of the first frame in the slice.
    pub first_frame: u64,
    /// Number of the last frame in the slice, inclusive.
    pub last_frame: u64,
    /// Position of the first profile along the scan.
    pub first_position: RawPosition,
    /// Position of the last profile along the scan.
    pub last_position: RawPosition,
    /// Frames between the first and the last, both included.
    pub frames_expected: u32,
    /// Frames whose profile is in the slice.
    pub frames_accepted: u32,
    /// Frames that never reached the scanner.
    pub frames_missing: u32,
    /// Frames that reached the scanner and were rejected.
    pub frames_rejected: u32,
    /// Accepted frames without a single valid point.
    pub profiles_empty: u32,
    /// Profiles that lie where the one before them in the scan lies.
    pub profiles_standing: u32,
    /// Valid points in the slice.
    pub points: u64,
    /// Worst state in the slice.
    pub state: SliceState,
}

impl SliceAccount {
    /// Counts frames. The counters saturate together: their sum stays `frames_expected`, at most 2³² - 1.
    pub(super) fn count(&mut self, accepted: u32, missing: u32, rejected: u32) {
        for (counter, frames) in [
            (&mut self.frames_accepted, accepted),
            (&mut self.frames_missing, missing),
            (&mut self.frames_rejected, rejected),
        ] {
            let counted = frames.min(u32::MAX - self.frames_expected);
            *counter += counted;
            self.frames_expected += counted;
        }
    }

    /// Sets the final state of a full slice from its counters.
    pub(super) fn close(&mut self) {
        if self.frames_missing + self.frames_rejected > 0 {
            self.state = self.state.max(SliceState::Gaps);
        }
        if self.profiles_standing > 0 && self.profiles_standing >= self.frames_accepted.div_ceil(2)
        {
            self.state = self.state.max(SliceState::Degraded);
        }
    }
}

/// Some consecutive profiles of a scan as an organised cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slice {
    /// Stamp of the first profile, nanoseconds.
    pub stamp_ns: i64,
    /// Points of a profile (columns of the cloud).
    pub width: u32,
    /// Profiles (rows of the cloud), 1 or more.
    pub height: u32,
    /// `height * width` points, profile after profile.
    pub points: Vec<Point>,
    /// Coverage and losses.
    pub account: SliceAccount,
}
