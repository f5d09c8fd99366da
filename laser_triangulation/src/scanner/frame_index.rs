//! The number of a frame and the losses before it.

/// Number of a frame and the frames lost before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameIndex {
    /// Frame counter, 64 bits, lost frames included.
    pub frame_number: u64,
    /// Frames known to be missing directly before this one.
    pub frames_missing: u32,
    /// Frames that arrived directly before this one and were rejected.
    pub frames_rejected: u32,
}
