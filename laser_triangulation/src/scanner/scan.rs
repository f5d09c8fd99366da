//! Step 10 of Yao et al. 2023: profiles pushed along the motion into slices of a scan.

use super::{height_map::HeightMap, pipeline::FrameIndex, profile::Profile};
use nalgebra::{Isometry3, Vector3};
use sha2::{Digest, Sha256};

/// Most points of a scan, 1 GiB of heights: one message must hold its height map. A scan ends before it has more.
pub const MAX_SCAN_POINTS: usize = 1 << 28;
/// Most points of a slice, 1 GiB of points: one message must hold it. A slice is full before it has more.
pub const MAX_SLICE_POINTS: usize = 1 << 26;

/// A point of the part: x, y, z, metres in the part's frame ([`Placement`](super::motion::placement::Placement)); then the
/// grey level at the centreline as a share of full scale, 0 to 1. NaN in all four: not measured.
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
    /// Position of the first profile along the scan, metres; radians on a rotary axis.
    pub first_position: f64,
    /// Position of the last profile along the scan, metres; radians on a rotary axis.
    pub last_position: f64,
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

impl SliceAccount {
    /// Counts frames. Counters that reach 2³² - 1 stop there, and still add up.
    fn count(&mut self, accepted: u32, missing: u32, rejected: u32) {
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

/// A profile and where it belongs.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// The profile.
    pub profile: &'a Profile,
    /// Columns and rows of the image that it was measured in.
    pub image_px: (u32, u32),
    /// Acquisition time of its frame, nanoseconds.
    pub stamp_ns: i64,
    /// Position along the scan, metres; radians on a rotary axis.
    pub position: f64,
    /// Whether that position is in doubt.
    pub is_doubtful: bool,
    /// The laser plane's frame in the part's, metres.
    pub part_from_laser: Isometry3<f64>,
    /// Which frame it is and what is missing before it.
    pub index: FrameIndex,
}

/// Stacks profiles. A scan is a sequence of profiles of one length from images of one size; it ends with its last slice and its height map.
/// Positions come with the profiles: they go on from a scan that reached its limit to the next.
///
/// A full slice is handed out when the next profile arrives or the scan ends: only then is it known whether it is the
/// last one. Two slices and two height maps take turns and are kept: after two scans of a length nothing is allocated.
#[derive(Debug)]
pub struct Scan {
    limits: ScanLimits,
    /// Makes scan ids of different calibrations differ.
    seed: String,
    /// Identity of the scan that begins next, where somebody has chosen one.
    next_id: Option<[u8; 16]>,
    /// Columns and rows of the images of the open scan.
    image_px: (u32, u32),
    open: Slice,
    closed: Slice,
    growing: HeightMap,
    finished: HeightMap,
}

/// Where slices and scans end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanLimits {
    /// Profiles a slice.
    pub slice_profiles: u32,
    /// Points a slice, missing ones included; a slice of one profile may have more.
    pub slice_points: usize,
    /// Profiles a scan.
    pub scan_profiles: u32,
}

/// What a push or the end completed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Completed<'a> {
    /// A slice.
    pub slice: Option<&'a Slice>,
    /// The height map of a scan that ended with that slice.
    pub height_map: Option<&'a HeightMap>,
}

impl Scan {
    /// An empty scan, whose slices and itself end at these limits, and earlier where the profiles are so long that
    /// [`MAX_SLICE_POINTS`] or [`MAX_SCAN_POINTS`] would be passed. `seed` tells scans of different calibrations apart.
    pub fn new(limits: ScanLimits, seed: String) -> Self {
        Self {
            limits,
            seed,
            next_id: None,
            image_px: (0, 0),
            open: Slice::default(),
            closed: Slice::default(),
            growing: HeightMap::default(),
            finished: HeightMap::default(),
        }
    }

    /// Adds a profile. A profile of another length, or from an image of another size, ends the scan: geometries are never
    /// mixed.
    pub fn push(&mut self, placed: &Placed<'_>) -> Completed<'_> {
        let width = placed.profile.x_m.len() as u32;
        let ends = self.growing.height > 0
            && (self.growing.width != width
                || self.image_px != placed.image_px
                || self.growing.height >= self.scan_limit(width));
        let full = self.open.height > 0 && self.open.height >= self.slice_limit(width);
        if ends {
            self.end();
        } else if full {
            self.close_slice();
        }
        if self.growing.height == 0 {
            self.begin(width, placed);
        }
        self.add(placed);
        Completed {
            slice: (ends || full).then_some(&self.closed),
            height_map: ends.then_some(&self.finished),
        }
    }

    /// Ends the scan. Of the frames after the last profile, `frames_missing` never arrived and `frames_rejected` were
    /// refused.
    pub fn finish(&mut self, frames_missing: u32, frames_rejected: u32) -> Completed<'_> {
        if self.growing.height == 0 {
            return Completed::default();
        }
        let account = &mut self.open.account;
        account.count(0, frames_missing, frames_rejected);
        account.last_frame += u64::from(frames_missing) + u64::from(frames_rejected);
        self.end();
        Completed { slice: Some(&self.closed), height_map: Some(&self.finished) }
    }

    /// Throws the open scan away, as if it had never begun.
    pub fn discard(&mut self) {
        self.open.points.clear();
        self.open.height = 0;
        self.growing.z_m.clear();
        self.growing.height = 0;
        self.next_id = None;
    }

    /// Chooses the identity of the scan that begins next; `None`: made from its first frame.
    pub const fn set_next_id(&mut self, id: Option<[u8; 16]>) {
        self.next_id = id;
    }

    /// Identity of the open scan; `None` before its first profile.
    pub fn open_id(&self) -> Option<[u8; 16]> {
        (self.growing.height > 0).then_some(self.open.account.scan_id)
    }

    /// New limits, from the next profile on; see [`new`](Self::new).
    pub const fn set_limits(&mut self, limits: ScanLimits) {
        self.limits = limits;
    }

    /// Profiles of that length at which a scan ends, at least 1.
    fn scan_limit(&self, width: u32) -> u32 {
        limit(self.limits.scan_profiles, MAX_SCAN_POINTS, width)
    }

    /// Profiles of that length at which a slice is full, at least 1.
    fn slice_limit(&self, width: u32) -> u32 {
        let ScanLimits { slice_profiles, slice_points, scan_profiles } = self.limits;
        limit(slice_profiles.min(scan_profiles), slice_points.min(MAX_SLICE_POINTS), width)
    }

    fn begin(&mut self, width: u32, placed: &Placed<'_>) {
        self.growing.width = width;
        self.growing.stamp_ns = placed.stamp_ns;
        self.image_px = placed.image_px;
        // Ahead, so that no frame waits for memory. Where the system does not promise so much, the buffers grow.
        let (scan, slice) = (self.scan_limit(width) as usize, self.slice_limit(width) as usize);
        self.growing.z_m.try_reserve_exact(scan * width as usize).unwrap_or_default();
        self.open.points.try_reserve_exact(slice * width as usize).unwrap_or_default();
        let scan_id = self.next_id.take().unwrap_or_else(|| self.scan_id(width, placed));
        self.open.account = SliceAccount { scan_id, ..SliceAccount::default() };
    }

    fn add(&mut self, placed: &Placed<'_>) {
        let Placed { profile, stamp_ns, position, index, .. } = *placed;
        let slice = &mut self.open;
        let account = &mut slice.account;
        if slice.height == 0 {
            slice.stamp_ns = stamp_ns;
            slice.width = profile.x_m.len() as u32;
            let lost = u64::from(index.frames_missing) + u64::from(index.frames_rejected);
            account.first_frame = index.frame_number.saturating_sub(lost);
            account.first_position = position;
        }
        slice.height += 1;
        account.last_frame = index.frame_number;
        account.last_position = position;
        account.count(1, index.frames_missing, index.frames_rejected);
        account.profiles_empty += u32::from(profile.valid_count == 0);
        account.points += u64::from(profile.valid_count);
        if placed.is_doubtful {
            account.state = account.state.max(SliceState::Degraded);
        }
        let place = Place::new(&placed.part_from_laser);
        let (width, first) = (profile.x_m.len(), slice.points.len());
        slice.points.extend((0..width).map(|i| match (profile.x_m[i], profile.z_m[i]) {
            (x_m, z_m) if z_m.is_finite() => {
                let [x_m, y_m, z_m] = place.point(x_m, z_m);
                [x_m, y_m, z_m, profile.intensity[i]]
            }
            _ => [f32::NAN; 4],
        }));
        self.growing.height += 1;
        self.growing.z_m.extend(slice.points[first..].iter().map(|[_, _, z_m, _]| z_m));
    }

    fn close_slice(&mut self) {
        let account = &mut self.open.account;
        if account.frames_missing + account.frames_rejected > 0 {
            account.state = account.state.max(SliceState::Gaps);
        }
        let next = SliceAccount {
            scan_id: account.scan_id,
            slice_index: account.slice_index + 1,
            ..SliceAccount::default()
        };
        std::mem::swap(&mut self.open, &mut self.closed);
        self.open.points.clear();
        self.open.points.try_reserve_exact(self.closed.points.capacity()).unwrap_or_default();
        self.open.height = 0;
        self.open.account = next;
    }

    fn end(&mut self) {
        self.open.account.last_slice = true;
        self.close_slice();
        std::mem::swap(&mut self.growing, &mut self.finished);
        self.growing.z_m.clear();
        self.growing.height = 0;
    }

    /// A UUID of version 8 (RFC 9562): a hash of where and when the scan began, so that a replay gives the same one.
    fn scan_id(&self, width: u32, placed: &Placed<'_>) -> [u8; 16] {
        let mut hash = Sha256::new();
        hash.update(self.seed.as_bytes());
        hash.update(placed.stamp_ns.to_le_bytes());
        hash.update(placed.index.frame_number.to_le_bytes());
        hash.update(width.to_le_bytes());
        let mut id = [0; 16];
        id.copy_from_slice(&hash.finalize()[..16]);
        id[6] = id[6] & 0x0f | 0x80;
        id[8] = id[8] & 0x3f | 0x80;
        id
    }
}

/// A pose for points of the laser plane, whose y is 0.
struct Place {
    x: Vector3<f64>,
    z: Vector3<f64>,
    origin_m: Vector3<f64>,
}

impl Place {
    fn new(pose: &Isometry3<f64>) -> Self {
        let axes = pose.rotation.to_rotation_matrix().into_inner();
        let axis = |number: usize| axes.column(number).into_owned();
        Self { x: axis(0), z: axis(2), origin_m: pose.translation.vector }
    }

    fn point(&self, x_m: f32, z_m: f32) -> [f32; 3] {
        let point = self.x * f64::from(x_m) + self.z * f64::from(z_m) + self.origin_m;
        [point.x as f32, point.y as f32, point.z as f32]
    }
}

/// `wanted` profiles of `width` points, or as many as make `max_points`; at least 1.
fn limit(wanted: u32, max_points: usize, width: u32) -> u32 {
    let possible = u32::try_from(max_points / width.max(1) as usize).unwrap_or(u32::MAX);
    wanted.min(possible).max(1)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "values are copied, not computed")]
mod tests;
