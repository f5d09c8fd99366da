//! Poses of coordinate frames relative to one another, from `/tf` and `/tf_static`, interpolated in time.

use nalgebra::Isometry3;
use thiserror::Error;

use super::track::{Found, Limits, Measured, Refused, Track};

/// Maximum number of frames: a robot has some dozens.
const MAX_FRAMES: usize = 256;
/// Maximum number of poses kept per frame.
const MAX_POSES: usize = 1024;
/// Maximum number of frames named in a message.
const MAX_NAMED: usize = 20;
/// Largest deviation of a rotation quaternion's length from 1.
const MAX_LENGTH_ERROR: f64 = 0.01;

impl Measured for Isometry3<f64> {
    /// Interpolates the origin linearly and the rotation about one axis at constant speed, the short way (Shoemake
    /// 1985, doi 10.1145/325334.325242).
    fn between(&self, later: &Self, share: f64) -> Self {
        let origin = self.translation.vector.lerp(&later.translation.vector, share);
        let turned = self.rotation.rotation_to(&later.rotation).powf(share);
        Self::from_parts(origin.into(), turned * self.rotation)
    }

    fn distance(&self, other: &Self) -> f64 {
        (self.translation.vector - other.translation.vector).norm()
    }
}

/// A pose of `child` in `parent`: `point_in_parent = parent_from_child * point_in_child`.
#[derive(Clone, Copy, Debug)]
pub struct Stated<'a> {
    /// The reference frame.
    pub parent: &'a str,
    /// The frame whose pose it is.
    pub child: &'a str,
    /// Time of the pose, nanoseconds since the epoch; ignored for static poses.
    pub stamp_ns: i64,
    /// Time of reception, nanoseconds since the epoch.
    pub received_ns: i64,
    /// Origin, metres.
    pub origin_m: [f64; 3],
    /// Rotation: quaternion x, y, z, w of length 1.
    pub rotation: [f64; 4],
    /// True if the pose is valid at all times, before and after.
    pub is_static: bool,
}

/// Reasons to reject a pose.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PoseRefused {
    /// The frame is its own parent, or has no name.
    #[error("frame {0:?} cannot be placed in {1:?}")]
    Names(String, String),
    /// Not finite numbers, or not a rotation.
    #[error("the pose of {0:?} is not a rotation and translation of finite numbers")]
    NoPose(String),
    /// Too many frames.
    #[error("there are more than {MAX_FRAMES} frames")]
    TooMany,
    /// Out of order, or without a stamp.
    #[error("the pose of {0:?}: {1}")]
    Time(String, Refused),
}

/// Reasons why no pose of one frame in another is available.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotFound {
    /// The target frame is unknown.
    NoTarget,
    /// The source frame is unknown.
    NoSource,
    /// The two frames are not connected.
    Apart,
    /// The chain of parents is a loop.
    Loop,
    /// A pose on the path is not known at that time.
    NoPose,
}

#[derive(Debug)]
struct Frame {
    name: String,
    /// Its parent and the poses in it; `None` for a root.
    placed: Option<(usize, Pose)>,
}

#[derive(Debug)]
enum Pose {
    Static(Isometry3<f64>),
    Moving(Box<Track<Isometry3<f64>>>),
}

/// The frames of a requested pose: that of `source` in `target`.
#[derive(Clone, Copy, Debug)]
pub struct FramePair<'a> {
    /// The frame in which the pose is expressed.
    pub target: &'a str,
    /// The frame that has the pose.
    pub source: &'a str,
}

/// All known frames.
#[derive(Debug)]
pub struct FrameTree {
    limits: Limits,
    frames: Vec<Frame>,
}

impl FrameTree {
    /// Creates a tree without frames.
    pub const fn new(limits: Limits) -> Self {
        Self { limits, frames: Vec::new() }
    }

    /// Sets other limits, for later poses.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
        for frame in &mut self.frames {
            if let Some((_, Pose::Moving(track))) = &mut frame.placed {
                track.set_limits(limits);
            }
        }
    }

    /// Removes all moving poses, for a new time line. Static poses stay.
    pub fn forget_moving(&mut self) {
        for frame in &mut self.frames {
            if matches!(frame.placed, Some((_, Pose::Moving(_)))) {
                frame.placed = None;
            }
        }
    }

    /// Adds a pose. A frame that had another parent moves to this one.
    ///
    /// # Errors
    /// The pose is invalid or out of order; the tree is then unchanged.
    pub fn take(&mut self, stated: &Stated<'_>) -> Result<(), PoseRefused> {
        let (parent, child) = (bare(stated.parent), bare(stated.child));
        if parent == child || parent.is_empty() || child.is_empty() {
            return Err(PoseRefused::Names(child.to_owned(), parent.to_owned()));
        }
        let pose = pose(stated).ok_or_else(|| PoseRefused::NoPose(child.to_owned()))?;
        let (parent, child) = (self.frame(parent)?, self.frame(child)?);
        let limits = self.limits;
        let Frame { name, placed } = &mut self.frames[child];
        if stated.is_static {
            *placed = Some((parent, Pose::Static(pose)));
            return Ok(());
        }
        if !matches!(placed, Some((before, Pose::Moving(_))) if *before == parent) {
            *placed = Some((parent, Pose::Moving(Box::new(Track::new(limits, MAX_POSES)))));
        }
        if let Some((_, Pose::Moving(track))) = placed {
            let taken = track.push(stated.stamp_ns, stated.received_ns, pose);
            taken.map_err(|refused| PoseRefused::Time(name.clone(), refused))?;
        }
        Ok(())
    }

    /// True if later poses cannot change the requested pose at `time_ns`.
    pub fn has_reached(&self, frames: FramePair<'_>, time_ns: i64) -> bool {
        let reached = |frame: usize| match &self.frames[frame].placed {
            Some((_, Pose::Moving(track))) => track.has_reached(time_ns),
            _ => true,
        };
        self.way(frames).is_ok_and(|(target, source, meeting)| {
            self.up(target, meeting).chain(self.up(source, meeting)).all(reached)
        })
    }

    /// Returns the longest time without a pose that is no gap, nanoseconds, for the slowest frame on the path; `None`
    /// if not known yet.
    pub fn gap_ns(&self, frames: FramePair<'_>) -> Option<i64> {
        let (target, source, meeting) = self.way(frames).ok()?;
        let moving = |frame: usize| match &self.frames[frame].placed {
            Some((_, Pose::Moving(track))) => track.gap_ns(),
            _ => None,
        };
        self.up(target, meeting).chain(self.up(source, meeting)).filter_map(moving).max()
    }

    /// Returns the requested pose at `time_ns`, from the poses received until `until_ns`:
    /// `point_in_target = found * point_in_source`.
    ///
    /// # Errors
    /// A frame is unknown, the two are not connected, or a pose is not known at that time.
    pub fn at(
        &self,
        frames: FramePair<'_>,
        time_ns: i64,
        until_ns: i64,
    ) -> Result<Found<Isometry3<f64>>, NotFound> {
        let (target, source, meeting) = self.way(frames)?;
        let meeting_from_source = self.climb(source, meeting, time_ns, until_ns)?;
        let meeting_from_target = self.climb(target, meeting, time_ns, until_ns)?;
        Ok(Found {
            value: meeting_from_target.value.inverse() * meeting_from_source.value,
            doubts: meeting_from_target.doubts | meeting_from_source.doubts,
            is_exact: meeting_from_target.is_exact && meeting_from_source.is_exact,
        })
    }

    /// Returns the first few known frames, for a message.
    pub fn names(&self) -> String {
        let mut names: Vec<_> =
            self.frames.iter().take(MAX_NAMED).map(|frame| frame.name.as_str()).collect();
        if self.frames.len() > MAX_NAMED {
            names.push("…");
        }
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    }

    /// Returns the pose of a frame in one of its ancestors.
    fn climb(
        &self,
        from: usize,
        to: usize,
        time_ns: i64,
        until_ns: i64,
    ) -> Result<Found<Isometry3<f64>>, NotFound> {
        let mut sum = Found { value: Isometry3::identity(), doubts: 0, is_exact: true };
        for frame in self.up(from, to) {
            let step = match &self.frames[frame].placed {
                Some((_, Pose::Static(pose))) => Found { value: *pose, doubts: 0, is_exact: true },
                Some((_, Pose::Moving(track))) => {
                    track.at(time_ns, until_ns).ok_or(NotFound::NoPose)?
                }
                None => return Err(NotFound::Apart),
            };
            sum.value = step.value * sum.value;
            sum.doubts |= step.doubts;
            sum.is_exact &= step.is_exact;
        }
        Ok(sum)
    }

    /// Returns both frames and their first common ancestor.
    fn way(&self, frames: FramePair<'_>) -> Result<(usize, usize, usize), NotFound> {
        let FramePair { target, source } = frames;
        let target = self.find(target).ok_or(NotFound::NoTarget)?;
        let source = self.find(source).ok_or(NotFound::NoSource)?;
        self.check_loop(source)?;
        self.check_loop(target)?;
        let mut above_source = self.above(source);
        let meeting = above_source.find(|frame| self.above(target).any(|other| other == *frame));
        meeting.map(|meeting| (target, source, meeting)).ok_or(NotFound::Apart)
    }

    fn check_loop(&self, frame: usize) -> Result<(), NotFound> {
        if self.above(frame).nth(self.frames.len()).is_some() {
            Err(NotFound::Loop)
        } else {
            Ok(())
        }
    }

    /// Iterates over a frame, its parent, and so on.
    fn above(&self, frame: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(frame), |frame| {
            self.frames[*frame].placed.as_ref().map(|(parent, _)| *parent)
        })
    }

    /// Iterates over the frames from one up to another, without the latter.
    fn up(&self, from: usize, to: usize) -> impl Iterator<Item = usize> {
        self.above(from).take_while(move |frame| *frame != to)
    }

    fn find(&self, name: &str) -> Option<usize> {
        let name = bare(name);
        self.frames.iter().position(|frame| frame.name == name)
    }

    fn frame(&mut self, name: &str) -> Result<usize, PoseRefused> {
        if let Some(known) = self.find(name) {
            return Ok(known);
        }
        if self.frames.len() == MAX_FRAMES {
            return Err(PoseRefused::TooMany);
        }
        self.frames.push(Frame { name: name.to_owned(), placed: None });
        Ok(self.frames.len() - 1)
    }
}

/// Removes the leading slash that old drivers write.
fn bare(name: &str) -> &str {
    name.trim_start_matches('/')
}

fn pose(stated: &Stated<'_>) -> Option<Isometry3<f64>> {
    use nalgebra::{Quaternion, Translation3, UnitQuaternion};
    let [x, y, z, w] = stated.rotation;
    let quaternion = Quaternion::new(w, x, y, z);
    let is_unit = (quaternion.norm() - 1.0).abs() <= MAX_LENGTH_ERROR;
    let is_finite = stated.origin_m.iter().all(|value| value.is_finite());
    let [x, y, z] = stated.origin_m;
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    (is_unit && is_finite).then(|| Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

#[cfg(test)]
mod tests;
