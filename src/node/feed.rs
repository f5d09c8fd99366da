//! Reads a recording and passes every message to the queue of its camera's worker.

use std::{cmp::Ordering, time::Instant};

use crate::bag::RawMessage;

use super::{
    queue::{Bound, Closed, Popped, Queue, WhenFull},
    source::{Input, PublisherId, Source},
    stop::Stop,
    unpack::Unpacker,
};

/// Maximum number of damaged places that are logged individually.
const MAX_LOGGED: u64 = 10;

/// The queues to and from the worker of one camera.
pub(super) struct Lane {
    /// Its image topic.
    pub(super) topic: String,
    /// Topics with the positions of its frames.
    pub(super) positions: Vec<String>,
    /// Frames that wait for the worker.
    pub(super) input: Queue<Input>,
    /// Buffers that the worker returns for reuse.
    pub(super) spare: Queue<Vec<u8>>,
    /// Largest decoded image, bytes; `None` if images are not compressed.
    pub(super) unpacks_bytes: Option<u64>,
}

/// The reader's side of all lanes.
pub(super) struct Feed<'a> {
    pub(super) lanes: &'a [Lane],
    pub(super) unpacker: Option<&'a Unpacker>,
    pub(super) stop: &'a Stop,
}

/// Closes the queues, even after a panic, so that no thread waits for a terminated reader.
impl Drop for Feed<'_> {
    fn drop(&mut self) {
        self.lanes.iter().for_each(|lane| lane.input.close());
        self.unpacker.iter().for_each(|unpacker| unpacker.close());
    }
}

/// Summary of the reading.
#[derive(Default)]
pub(super) struct Fed {
    pub(super) num_damaged: u64,
    pub(super) was_interrupted: bool,
}

impl Lane {
    pub(super) fn new(
        topic: String,
        positions: Vec<String>,
        bound: Bound,
        unpacks_bytes: Option<u64>,
    ) -> Self {
        let spares = Bound { items: bound.items, bytes: 0 };
        Self {
            topic,
            positions,
            input: Queue::new(bound, WhenFull::Wait),
            spare: Queue::new(spares, WhenFull::DropOldest),
            unpacks_bytes,
        }
    }
}

impl Feed<'_> {
    /// Passes all input to the workers. Returns at the end of the input, on a request to stop, or when a worker has
    /// ended, and closes the lanes.
    pub(super) fn all(self, source: &mut dyn Source, on_message: &mut dyn FnMut(u64)) -> Fed {
        let mut fed = Fed::default();
        let mut num_messages = 0;
        loop {
            if self.stop.is_raised() {
                fed.was_interrupted = true;
                return fed;
            }
            for lane in self.lanes {
                while let Popped::Item(buffer, _) = lane.spare.pop_counted(Some(Instant::now())) {
                    source.recycle(buffer);
                }
            }
            let passed = match source.next() {
                None => return fed,
                Some(Input::Damage(what)) => {
                    fed.count_damage(&what);
                    Ok(())
                }
                Some(Input::Message(message, writer)) => {
                    if self.lanes.iter().any(|lane| lane.topic == message.topic.name) {
                        num_messages += 1;
                        on_message(num_messages);
                    }
                    self.pass(message, writer)
                }
                Some(Input::NewRecording) => self.all_lanes(|| Input::NewRecording),
                // Only one camera can have pictures: their series has one topic of images.
                Some(Input::Fault(what)) => {
                    num_messages += 1;
                    on_message(num_messages);
                    self.all_lanes(|| Input::Fault(what.clone()))
                }
                // Recordings produce no other input.
                Some(
                    Input::Ahead(_) | Input::Position(_) | Input::Positions | Input::Command(_),
                ) => Ok(()),
            };
            if passed.is_err() {
                return fed;
            }
        }
    }

    fn all_lanes(&self, item: impl Fn() -> Input) -> Result<(), Closed<()>> {
        let mut inputs = self.lanes.iter().map(|lane| &lane.input);
        inputs.try_for_each(|input| push(input, item(), 0))
    }

    fn pass(&self, message: RawMessage, writer: PublisherId) -> Result<(), Closed<()>> {
        let wants = |lane: &&Lane| lane.positions.contains(&message.topic.name);
        for lane in self.lanes.iter().filter(wants) {
            push(&lane.input, Input::Position(message.clone()), message.data.len())?;
        }
        let is_for = |lane: &&Lane| lane.topic == message.topic.name;
        let Some(lane) = self.lanes.iter().find(is_for) else { return Ok(()) };
        let num_bytes = message.data.len();
        let input = match (self.unpacker, lane.unpacks_bytes) {
            (Some(unpacker), Some(max_bytes)) => {
                Input::Ahead(unpacker.begin(message, writer, max_bytes)?)
            }
            _ => Input::Message(message, writer),
        };
        push(&lane.input, input, num_bytes)
    }
}

fn push(queue: &Queue<Input>, input: Input, num_bytes: usize) -> Result<(), Closed<()>> {
    queue.push(input, num_bytes).map(drop).map_err(|Closed(_)| Closed(()))
}

impl Fed {
    fn count_damage(&mut self, what: &str) {
        self.num_damaged += 1;
        match self.num_damaged.cmp(&MAX_LOGGED) {
            Ordering::Less => tracing::error!("{what}"),
            Ordering::Equal => tracing::error!("{what}; further damage is only counted"),
            Ordering::Greater => tracing::debug!("{what}"),
        }
    }
}
