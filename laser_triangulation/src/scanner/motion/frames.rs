//! Poses of coordinate frames in one another, as they come on `/tf` and `/tf_static`, and where one frame was in another
//! at a time.

use nalgebra::Isometry3;
use thiserror::Error;

use super::track::{Found, Limits, Measured, Refused, Track};

/// Frames that are known at most: a robot has some dozens.
const MAX_FRAMES: usize = 256;
/// Poses of one frame that are kept.
const MAX_POSES: usize = 1024;
/// Frames that a message names.
const MAX_NAMED: usize = 20;
/// Lengths of quaternions that differ more from 1 are no rotations.
const MAX_LENGTH_ERROR: f64 = 0.01;

impl Measured for Isometry3<f64> {
    /// Origin on a line, rotation about one axis at one speed, the short way (Shoemake 1985, doi 10.1145/325334.325242).
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
    /// The frame that it is in.
    pub parent: &'a str,
    /// The frame that it is of.
    pub child: &'a str,
    /// When, nanoseconds since the epoch; without meaning for what stays.
    pub stamp_ns: i64,
    /// When it was received, nanoseconds since the epoch.
    pub received_ns: i64,
    /// Origin, metres.
    pub origin_m: [f64; 3],
    /// Rotation: quaternion x, y, z, w of length 1.
    pub rotation: [f64; 4],
    /// Whether it stays so for all time, before and after.
    pub is_static: bool,
}

/// Why a pose is not taken.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PoseRefused {
    /// A frame in itself, or without a name.
    #[error("frame {0:?} cannot be placed in {1:?}")]
    Names(String, String),
    /// Not numbers, or no rotation.
    #[error("the pose of {0:?} is no rotation and translation of finite numbers")]
    NoPose(String),
    /// More frames than anybody has.
    #[error("there are more than {MAX_FRAMES} frames")]
    TooMany,
    /// Out of order, or without a stamp.
    #[error("the pose of {0:?}: {1}")]
    Time(String, Refused),
}

/// Why a frame cannot be found in another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotFound {
    /// Nobody has spoken of the frame that poses are wanted in.
    NoTarget,
    /// Nobody has spoken of the frame whose pose is wanted.
    NoSource,
    /// Nothing connects the two.
    Apart,
    /// A frame stands in a frame that stands in it.
    Loop,
    /// A pose on the way is not known at that time.
    NoPose,
}

#[derive(Debug)]
struct Frame {
    name: String,
    /// Where it is placed in, and how; none for a root.
    placed: Option<(usize, Pose)>,
}

#[derive(Debug)]
enum Pose {
    Static(Isometry3<f64>),
    Moving(Box<Track<Isometry3<f64>>>),
}

/// All frames that were spoken of.
#[derive(Debug)]
pub struct FrameTree {
    limits: Limits,
    frames: Vec<Frame>,
}

impl FrameTree {
    /// A tree without frames.
    pub const fn new(limits: Limits) -> Self {
        Self { limits, frames: Vec::new() }
    }

    /// Other limits, for poses to come.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
        for frame in &mut self.frames {
            if let Some((_, Pose::Moving(track))) = &mut frame.placed {
                track.set_limits(limits);
            }
        }
    }

    /// Forgets what moves: other times begin. What stays, stays.
    pub fn forget_moving(&mut self) {
        for frame in &mut self.frames {
            if matches!(frame.placed, Some((_, Pose::Moving(_)))) {
                frame.placed = None;
            }
        }
    }

    /// Takes a pose. A frame that was in another one before is in this one from now on.
    ///
    /// # Errors
    /// A pose that is none, or comes out of order; nothing has changed then.
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

    /// Whether nothing that comes can change where `source` was in `target` at `time_ns`.
    pub fn has_reached(&self, (target, source): (&str, &str), time_ns: i64) -> bool {
        let reached = |frame: usize| match &self.frames[frame].placed {
            Some((_, Pose::Moving(track))) => track.has_reached(time_ns),
            _ => true,
        };
        self.way(target, source).is_ok_and(|(target, source, meeting)| {
            self.up(target, meeting).chain(self.up(source, meeting)).all(reached)
        })
    }

    /// Longest time without a pose that is no gap, nanoseconds: of the slowest on the way. `None`: not known yet.
    pub fn gap_ns(&self, (target, source): (&str, &str)) -> Option<i64> {
        let (target, source, meeting) = self.way(target, source).ok()?;
        let moving = |frame: usize| match &self.frames[frame].placed {
            Some((_, Pose::Moving(track))) => track.gap_ns(),
            _ => None,
        };
        self.up(target, meeting).chain(self.up(source, meeting)).filter_map(moving).max()
    }

    /// Where `source` was in `target` at `time_ns`, as far as poses tell that were received until `until_ns`:
    /// `point_in_target = found * point_in_source`.
    ///
    /// # Errors
    /// Frames that are not there or not connected, or poses that are not known at that time.
    pub fn at(
        &self,
        (target, source): (&str, &str),
        time_ns: i64,
        until_ns: i64,
    ) -> Result<Found<Isometry3<f64>>, NotFound> {
        let (target, source, meeting) = self.way(target, source)?;
        let meeting_from_source = self.climb(source, meeting, time_ns, until_ns)?;
        let meeting_from_target = self.climb(target, meeting, time_ns, until_ns)?;
        Ok(Found {
            value: meeting_from_target.value.inverse() * meeting_from_source.value,
            doubts: meeting_from_target.doubts | meeting_from_source.doubts,
            is_exact: meeting_from_target.is_exact && meeting_from_source.is_exact,
        })
    }

    /// The frames that were spoken of, for a message; not more than a few.
    pub fn names(&self) -> String {
        let mut names: Vec<_> =
            self.frames.iter().take(MAX_NAMED).map(|frame| frame.name.as_str()).collect();
        if self.frames.len() > MAX_NAMED {
            names.push("…");
        }
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    }

    /// The pose of a frame in one of those above it.
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

    /// Both frames, and the first one that stands above both.
    fn way(&self, target: &str, source: &str) -> Result<(usize, usize, usize), NotFound> {
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

    /// A frame, the one that it is placed in, and so on.
    fn above(&self, frame: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(frame), |frame| {
            self.frames[*frame].placed.as_ref().map(|(parent, _)| *parent)
        })
    }

    /// The frames from one up to another, without that one.
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

/// Old drivers write a slash before the name.
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
