//! Frames of two results bags, paired by their stamps; holds one pair in memory.

use std::iter::Peekable;

use anyhow::Context;

use super::{Notes, ResultsRecording, recorded_profile, recording::add_error};
use crate::{
    bag::{BagError, Filter, Messages, RawMessage},
    msg::{
        cdr,
        convert::results::stripe_direction,
        laser_profiler_msgs::{Centerline, Profile},
    },
    scanner::params::StripeDirection,
};

/// One frame of both results.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FramePair<'a> {
    /// Number of the frame in A, from 0.
    pub(crate) frame: u64,
    /// The centrelines of A and B.
    pub(crate) lines: [&'a Centerline<'a>; 2],
    /// Directions of the stripe in A and B.
    pub(crate) directions: [StripeDirection; 2],
    /// The profiles of A and B; `None` unless both have a calibration.
    pub(crate) profiles: Option<[&'a Profile<'a>; 2]>,
}

/// Numbers of frames only in A and only in B.
pub(crate) type NumUnpaired = [u64; 2];

/// One frame of a results bag, not decoded.
struct Frame {
    stamp_ns: i64,
    direction: StripeDirection,
    line: RawMessage,
    profile: Option<RawMessage>,
}

/// Frames of a results bag in their order.
struct Frames {
    messages: Peekable<Messages>,
    line_topic: String,
    /// Errors since the last call of `report_errors`.
    errors: Vec<BagError>,
    rejected: Vec<String>,
}

impl Frames {
    fn new(recording: &ResultsRecording, line_topic: String) -> Self {
        let profiles = recording.topic("profile");
        let filter = Filter::topics(profiles.into_iter().chain([line_topic.clone()]));
        let messages = recording.bag.messages(&filter).peekable();
        Self { messages, line_topic, errors: Vec::new(), rejected: Vec::new() }
    }

    /// Returns the next centreline with the profile that follows it.
    fn next(&mut self) -> Option<Frame> {
        loop {
            let line = match self.messages.next()? {
                Ok(message) if message.topic.name == self.line_topic => message,
                // A profile whose centreline is missing.
                Ok(_) => continue,
                Err(error) => {
                    self.errors.push(error);
                    continue;
                }
            };
            let (stamp_ns, direction) = match stamp_and_direction(&line) {
                Ok(found) => found,
                Err(error) => {
                    self.rejected.push(format!("{}: {error}", self.line_topic));
                    continue;
                }
            };
            let topic = &self.line_topic;
            let is_profile = |found: &Result<RawMessage, BagError>| {
                found.as_ref().is_ok_and(|message| message.topic.name != *topic)
            };
            let profile = self.messages.next_if(is_profile).and_then(Result::ok);
            return Some(Frame { stamp_ns, direction, line, profile });
        }
    }

    fn report_errors(&mut self, notes: &mut Notes) {
        self.errors.drain(..).for_each(|error| add_error(notes, &error));
        self.rejected.drain(..).for_each(|error| notes.add_loss(error));
    }
}

fn stamp_and_direction(line: &RawMessage) -> anyhow::Result<(i64, StripeDirection)> {
    let line: Centerline<'_> = cdr::decode(&line.data)?;
    Ok((line.header.stamp.to_ns(), stripe_direction(&line)?))
}

/// Calls `take` with every frame in both results.
///
/// # Errors
/// Results without centrelines.
pub(crate) fn for_each_pair(
    recordings: [&ResultsRecording; 2],
    notes: &mut Notes,
    mut take: impl FnMut(&FramePair<'_>),
) -> anyhow::Result<NumUnpaired> {
    let mut frames = Vec::new();
    for recording in recordings {
        let topic = recording.topic("centerline").with_context(|| {
            format!("{} has no centrelines to compare", recording.path().display())
        })?;
        frames.push(Frames::new(recording, topic));
    }
    let mut num_unpaired = [0, 0];
    let mut number = 0;
    let mut next: Vec<_> = frames.iter_mut().map(Frames::next).collect();
    loop {
        // Bags that advance to their next frame.
        let advances = match (&next[0], &next[1]) {
            (Some(a), Some(b)) if a.stamp_ns == b.stamp_ns => {
                take_pair(number, [a, b], notes, &mut take);
                [true, true]
            }
            (Some(a), Some(b)) => [a.stamp_ns < b.stamp_ns, b.stamp_ns < a.stamp_ns],
            (Some(_), None) => [true, false],
            (None, Some(_)) => [false, true],
            (None, None) => break,
        };
        number += u64::from(advances[0]);
        for which in 0..2 {
            if advances[which] {
                num_unpaired[which] += u64::from(!advances[1 - which]);
                next[which] = frames[which].next();
                frames[which].report_errors(notes);
            }
        }
    }
    for frames in &mut frames {
        frames.report_errors(notes);
    }
    Ok(num_unpaired)
}

/// Decodes a frame of both and calls `take` with it.
fn take_pair(
    frame: u64,
    frames: [&Frame; 2],
    notes: &mut Notes,
    take: &mut impl FnMut(&FramePair<'_>),
) {
    let lines = frames.map(|frame| cdr::decode::<Centerline<'_>>(&frame.line.data));
    let profiles = frames.map(|frame| frame.profile.as_ref().map(recorded_profile));
    let [Ok(a), Ok(b)] = &lines else { return };
    let both = if let [Some(Ok(first)), Some(Ok(second))] = &profiles {
        Some([first, second])
    } else {
        for error in profiles.iter().flatten().filter_map(|profile| profile.as_ref().err()) {
            notes.add_loss(format!("profile: {error}"));
        }
        None
    };
    let directions = frames.map(|frame| frame.direction);
    take(&FramePair { frame, lines: [a, b], directions, profiles: both });
}
