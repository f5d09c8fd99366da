//! Step 10 of Yao et al. 2023: stacks profiles along the motion into slices of a scan.

mod slice;

use nalgebra::{Isometry3, Vector3};
use sha2::{Digest, Sha256};

use super::{
    frame_index::FrameIndex, height_map::HeightMap, motion::locator::Located, profile::Profile,
    uuid::uuid_v8,
};

pub use slice::{Point, Slice, SliceAccount, SliceState};

/// Maximum points of a scan, 1 GiB of heights: one message must hold its height map.
pub const MAX_SCAN_POINTS: usize = 1 << 28;
/// Maximum points of a slice, 1 GiB: one message must hold it.
pub const MAX_SLICE_POINTS: usize = 1 << 26;

/// A measured frame, for [`Scan::push`].
#[derive(Clone, Copy, Debug)]
pub struct ScanEntry<'a> {
    /// Profile of the frame.
    pub profile: &'a Profile,
    /// Columns and rows of its image.
    pub image_px: (u32, u32),
    /// Acquisition time, nanoseconds.
    pub stamp_ns: i64,
    /// Place along the scan; `None` if unknown: the frame counts as rejected.
    pub located: Option<Located>,
    /// Number of the frame and losses before it.
    pub index: FrameIndex,
}

/// Frames before the next profile that the scan does not contain.
#[derive(Clone, Copy, Debug, Default)]
struct LeftOut {
    missing: u32,
    /// Rejected, or without a position.
    rejected: u32,
}

/// Stacks profiles. A scan is a sequence of profiles of one length from images of one size; it ends with its last slice
/// and its height map. Positions continue from a scan that reached its limit to the next one.
///
/// Returns a full slice when the next profile arrives or the scan ends, because only then is it known whether it is the
/// last one. Two slices and two height maps alternate: after two scans of a length nothing is allocated.
#[derive(Debug)]
pub struct Scan {
    limits: ScanLimits,
    /// Makes the identities of scans with different calibrations differ.
    seed: String,
    /// Requested identity of the next scan.
    next_id: Option<[u8; 16]>,
    is_stacking: bool,
    left_out: LeftOut,
    /// Columns and rows of the images of the open scan.
    image_px: (u32, u32),
    open: Slice,
    closed: Slice,
    growing: HeightMap,
    finished: HeightMap,
}

/// Limits of slices and scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanLimits {
    /// Profiles a slice.
    pub slice_profiles: u32,
    /// Points a slice, missing ones included; a slice of one profile may have more.
    pub slice_points: usize,
    /// Profiles a scan.
    pub scan_profiles: u32,
}

/// Slice and height map that a push or the end completed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Completed<'a> {
    /// A slice.
    pub slice: Option<&'a Slice>,
    /// The height map of a scan that ended with that slice.
    pub height_map: Option<&'a HeightMap>,
}

impl Scan {
    /// An empty scan with these limits. Slices and scans end earlier where profiles are so long that they would exceed
    /// [`MAX_SLICE_POINTS`] or [`MAX_SCAN_POINTS`]. `seed` makes scans of different calibrations differ.
    pub fn new(limits: ScanLimits, seed: String) -> Self {
        Self {
            limits,
            seed,
            next_id: None,
            is_stacking: true,
            left_out: LeftOut::default(),
            image_px: (0, 0),
            open: Slice::default(),
            closed: Slice::default(),
            growing: HeightMap::default(),
            finished: HeightMap::default(),
        }
    }

    /// Adds a frame to the scan. A frame without a place is left out and counted as rejected; after [`stop`](Self::stop)
    /// every frame is left out. A profile of another length, or from an image of another size, ends the scan: geometries
    /// are never mixed.
    pub fn push(&mut self, entry: &ScanEntry<'_>) -> Completed<'_> {
        let LeftOut { missing, rejected } = std::mem::take(&mut self.left_out);
        let frames_missing = entry.index.frames_missing.saturating_add(missing);
        let frames_rejected = entry.index.frames_rejected.saturating_add(rejected);
        match &entry.located {
            _ if !self.is_stacking => Completed::default(),
            Some(located) => {
                let index = FrameIndex { frames_missing, frames_rejected, ..entry.index };
                self.stack(&ScanEntry { index, ..*entry }, located)
            }
            None => {
                let rejected = frames_rejected.saturating_add(1);
                self.left_out = LeftOut { missing: frames_missing, rejected };
                Completed::default()
            }
        }
    }

    /// Adds a profile to the open scan, which ends first where the profile does not fit.
    fn stack(&mut self, entry: &ScanEntry<'_>, located: &Located) -> Completed<'_> {
        let width = entry.profile.x_m.len() as u32;
        let ends = self.growing.height > 0
            && (self.growing.width != width
                || self.image_px != entry.image_px
                || self.growing.height >= self.scan_limit(width));
        let full = self.open.height > 0 && self.open.height >= self.slice_limit(width);
        if ends {
            self.end();
        } else if full {
            self.close_slice();
        }
        if self.growing.height == 0 {
            self.begin(width, entry);
        }
        self.add(entry, located);
        Completed {
            slice: (ends || full).then_some(&self.closed),
            height_map: ends.then_some(&self.finished),
        }
    }

    /// Ends the scan: returns its last slice and its height map. Of the frames after the last one pushed,
    /// `frames_missing` never arrived and `frames_rejected` were rejected.
    pub fn finish(&mut self, frames_missing: u32, frames_rejected: u32) -> Completed<'_> {
        let LeftOut { missing, rejected } = std::mem::take(&mut self.left_out);
        let frames_missing = frames_missing.saturating_add(missing);
        let frames_rejected = frames_rejected.saturating_add(rejected);
        if self.growing.height == 0 {
            return Completed::default();
        }
        let account = &mut self.open.account;
        account.count(0, frames_missing, frames_rejected);
        account.last_frame += u64::from(frames_missing) + u64::from(frames_rejected);
        self.end();
        Completed { slice: Some(&self.closed), height_map: Some(&self.finished) }
    }

    /// Discards the open scan.
    pub fn discard(&mut self) {
        self.left_out = LeftOut::default();
        self.open.points.clear();
        self.open.height = 0;
        self.growing.z_m.clear();
        self.growing.height = 0;
        self.next_id = None;
    }

    /// Stacks profiles again after [`stop`](Self::stop), as a new scan does.
    pub const fn start(&mut self) {
        self.is_stacking = true;
    }

    /// Leaves out all frames until [`start`](Self::start). Call [`finish`](Self::finish) first.
    pub const fn stop(&mut self) {
        self.is_stacking = false;
        self.next_id = None;
    }

    /// Sets the identity of the next scan; `None`: derived from its first frame.
    pub const fn set_next_id(&mut self, id: Option<[u8; 16]>) {
        self.next_id = id;
    }

    /// Identity of the open scan; `None` before its first profile.
    pub fn open_id(&self) -> Option<[u8; 16]> {
        (self.growing.height > 0).then_some(self.open.account.scan_id)
    }

    /// True if profiles are stacked: not between [`stop`](Self::stop) and [`start`](Self::start).
    pub(crate) const fn is_stacking(&self) -> bool {
        self.is_stacking
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

    fn begin(&mut self, width: u32, entry: &ScanEntry<'_>) {
        self.growing.width = width;
        self.growing.stamp_ns = entry.stamp_ns;
        self.image_px = entry.image_px;
        // Reserved ahead, so that no frame waits for memory. If the system refuses, the buffers grow on demand.
        let (scan, slice) = (self.scan_limit(width) as usize, self.slice_limit(width) as usize);
        self.growing.z_m.try_reserve_exact(scan * width as usize).unwrap_or_default();
        self.open.points.try_reserve_exact(slice * width as usize).unwrap_or_default();
        let scan_id = self.next_id.take().unwrap_or_else(|| self.scan_id(width, entry));
        self.open.account = SliceAccount { scan_id, ..SliceAccount::default() };
    }

    fn add(&mut self, entry: &ScanEntry<'_>, located: &Located) {
        let ScanEntry { profile, stamp_ns, index, .. } = *entry;
        let position = located.position.value;
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
        account.profiles_standing += u32::from(located.stands);
        if located.position.doubts != 0 {
            account.state = account.state.max(SliceState::Degraded);
        }
        let place = Place::new(&located.part_from_laser);
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
        account.close();
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

    /// Derived from the start of the scan, so that a replay gives the same identity.
    fn scan_id(&self, width: u32, first: &ScanEntry<'_>) -> [u8; 16] {
        let mut hash = Sha256::new();
        hash.update(self.seed.as_bytes());
        hash.update(first.stamp_ns.to_le_bytes());
        hash.update(first.index.frame_number.to_le_bytes());
        hash.update(width.to_le_bytes());
        uuid_v8(&hash.finalize().into())
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
