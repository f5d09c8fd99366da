//! Heights of a whole scan as an image.

/// One row per profile, one column per point of a profile. Not resampled: rows follow the frames, and their distances may
/// differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeightMap {
    /// Stamp of the first profile, nanoseconds.
    pub stamp_ns: i64,
    /// Points of a profile.
    pub width: u32,
    /// Profiles.
    pub height: u32,
    /// `height * width` heights: z in the part's frame, metres; NaN where nothing was measured.
    pub z_m: Vec<f32>,
}
