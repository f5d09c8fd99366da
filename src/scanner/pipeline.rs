//! The whole measurement on one screen: extract → triangulate → push.

use super::{height_map::HeightMap, profile::Profile, scan::Slice, stripe::Centerline};

/// What is known about a frame besides its picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameIndex {
    /// Frame counter, 64 bit, gaps included.
    pub frame_number: u64,
    /// Frames known to be missing directly before this one.
    pub frames_missing: u32,
    /// Frames that arrived directly before this one and were refused.
    pub frames_rejected: u32,
}

/// End of a stage, told to the observer of [`Pipeline`] so that an outer layer with a clock can time it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The samples are one channel of numbers.
    Decode,
    /// The centreline is known.
    Extract,
    /// The profile is metric and lies in the scan.
    Triangulate,
}

/// What one frame gave. Borrowed from the pipeline, valid until the next frame.
#[derive(Clone, Copy, Debug)]
pub struct Output<'a> {
    /// The centreline, perhaps without points.
    pub centerline: &'a Centerline,
    /// Position along the scan, metres.
    pub position_m: f64,
    /// The metric profile, when calibrated.
    pub profile: Option<&'a Profile>,
    /// Slices that this frame completed: at most two (a change of geometry ends one early).
    pub slices: &'a [Slice],
    /// The height map of a scan that ended with this frame.
    pub height_map: Option<&'a HeightMap>,
}
