//! Frames of two results, joined by their stamps, one pair in memory.

use std::iter::Peekable;

use crate::{
    bag::{BagError, Filter, Messages, RawMessage},
    cli::report::{
        Notes,
        source::{Source, tell},
    },
    msg::{
        cdr,
        laser_profiler_msgs::{Centerline, Profile},
    },
    report::difference::Pair,
};

/// One frame of a results' recording, still as bytes.
struct Frame {
    stamp_ns: i64,
    line: RawMessage,
    profile: Option<RawMessage>,
}

/// The frames of a results' recording in their order.
struct Frames {
    messages: Peekable<Messages>,
    line_topic: String,
    /// What could not be read, until somebody asks.
    errors: Vec<BagError>,
    refused: Vec<String>,
}

impl Frames {
    fn new(source: &Source, line_topic: String) -> Self {
        let profiles = source.topic("profile");
        let filter = Filter::topics(profiles.into_iter().chain([line_topic.clone()]));
        let messages = source.bag.messages(&filter).peekable();
        Self { messages, line_topic, errors: Vec::new(), refused: Vec::new() }
    }

    /// The next centreline with the profile that follows it.
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
            let stamp_ns = match cdr::decode::<Centerline<'_>>(&line.data) {
                Ok(decoded) => decoded.header.stamp.to_ns(),
                Err(error) => {
                    self.refused.push(format!("{}: {error}", self.line_topic));
                    continue;
                }
            };
            let topic = &self.line_topic;
            let is_profile = |found: &Result<RawMessage, BagError>| {
                found.as_ref().is_ok_and(|message| message.topic.name != *topic)
            };
            let profile = self.messages.next_if(is_profile).and_then(Result::ok);
            return Some(Frame { stamp_ns, line, profile });
        }
    }

    fn tell(&mut self, notes: &mut Notes) {
        self.errors.drain(..).for_each(|error| tell(notes, &error));
        self.refused.drain(..).for_each(|error| notes.lose(error));
    }
}

/// How many frames only one of the results has.
pub(super) type Alone = [u64; 2];

/// Hands on every frame that both results have.
///
/// # Errors
/// Results without centrelines.
pub(super) fn join(
    sources: [&Source; 2],
    notes: &mut Notes,
    mut take: impl FnMut(&Pair<'_>),
) -> anyhow::Result<Alone> {
    let mut frames = Vec::new();
    for source in sources {
        let topic = source.topic("centerline");
        let topic = topic.ok_or_else(|| {
            anyhow::anyhow!("{} has no centrelines to compare", source.path.display())
        })?;
        frames.push(Frames::new(source, topic));
    }
    let mut alone = [0, 0];
    let mut number = 0;
    let mut next: Vec<_> = frames.iter_mut().map(Frames::next).collect();
    loop {
        // Which of the two goes on.
        let goes = match (&next[0], &next[1]) {
            (Some(a), Some(b)) if a.stamp_ns == b.stamp_ns => {
                compare(number, [a, b], notes, &mut take);
                [true, true]
            }
            (Some(a), Some(b)) => [a.stamp_ns < b.stamp_ns, b.stamp_ns < a.stamp_ns],
            (Some(_), None) => [true, false],
            (None, Some(_)) => [false, true],
            (None, None) => break,
        };
        number += u64::from(goes[0]);
        for which in 0..2 {
            if goes[which] {
                alone[which] += u64::from(!goes[1 - which]);
                next[which] = frames[which].next();
                frames[which].tell(notes);
            }
        }
    }
    for frames in &mut frames {
        frames.tell(notes);
    }
    Ok(alone)
}

/// Decodes a frame of both and hands it on.
fn compare(frame: u64, frames: [&Frame; 2], notes: &mut Notes, take: &mut impl FnMut(&Pair<'_>)) {
    let lines = frames.map(|frame| cdr::decode::<Centerline<'_>>(&frame.line.data));
    let profiles = frames.map(|frame| {
        frame.profile.as_ref().map(|profile| cdr::decode::<Profile<'_>>(&profile.data))
    });
    let [Ok(a), Ok(b)] = &lines else { return };
    let both = if let [Some(Ok(first)), Some(Ok(second))] = &profiles {
        Some([first, second])
    } else {
        for error in profiles.iter().flatten().filter_map(|profile| profile.as_ref().err()) {
            notes.lose(format!("profile: {error}"));
        }
        None
    };
    take(&Pair { frame, lines: [a, b], profiles: both });
}
