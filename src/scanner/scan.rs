//! Profiles pushed along the motion into slices of a scan.

/// A point of the part: x along the stripe, y along the motion, z up, metres in the scan frame; then the grey level at
/// the centreline as a share of full scale, 0 to 1. NaN in all four: not measured.
pub type Point = [f32; 4];

/// Worst state in a slice, as in `SliceInfo.state`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum SliceState {
    /// Every expected frame is in.
    #[default]
    Complete = 0,
    /// Frames are missing or were rejected; positions are still right.
    Gaps = 1,
    /// Positions are in doubt.
    Degraded = 2,
    /// The scan ended early.
    Aborted = 3,
}

/// What a slice covers and what is missing from it: `expected = accepted + missing + rejected`, always.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SliceAccount {
    /// Identity of the scan, a UUID of version 8 made from the stream: the same frames give the same bytes.
    pub scan_id: [u8; 16],
    /// Number of this slice in its scan, from 0.
    pub slice_index: u32,
    /// Whether the scan ends with this slice.
    pub last_slice: bool,
    /// Number of the first frame in the slice.
    pub first_frame: u64,
    /// Number of the last frame in the slice, inclusive.
    pub last_frame: u64,
    /// Position of the first profile along the scan, metres.
    pub first_position_m: f64,
    /// Position of the last profile along the scan, metres.
    pub last_position_m: f64,
    /// Frames that the range should hold.
    pub frames_expected: u32,
    /// Frames whose profile is in the slice.
    pub frames_accepted: u32,
    /// Frames that never reached the scanner.
    pub frames_missing: u32,
    /// Frames that reached it and were not used.
    pub frames_rejected: u32,
    /// Accepted frames without a single valid point.
    pub profiles_empty: u32,
    /// Valid points in the slice.
    pub points: u64,
    /// Worst state in the slice.
    pub state: SliceState,
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
    /// What it covers and what is missing.
    pub account: SliceAccount,
}
