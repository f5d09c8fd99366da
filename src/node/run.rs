//! Source → queue → worker → sinks: a run from the first frame to the last.

use std::{cmp::Ordering, panic, thread, time::Instant};

use thiserror::Error;

use crate::msg::cdr::CdrError;

use super::{
    fan_out::FanOut,
    publisher::{Halt, Publisher},
    queue::{Bound, Popped, Queue, WhenFull},
    sink::{Outlet, SinkError},
    source::{Input, Source},
    statistics::{Counts, StageTimes, Summary},
    stop::Stop,
    worker::Worker,
};

/// Frames that wait for the worker: enough to keep it busy, few enough to fit into memory. The bytes hold the largest
/// frames that a recording is read with.
pub const INPUT_BOUND: Bound = Bound { items: 2, bytes: 256 << 20 };

/// Damaged places that are told one by one.
const MAX_TOLD: u64 = 10;

/// Why a run ended before its input.
#[derive(Debug, Error)]
pub enum RunError {
    /// A sink has failed: the disk is full, say. What it took before is kept.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A result that has no bytes.
    #[error(transparent)]
    Encode(#[from] CdrError),
    /// The worker found a sink closed that reports no error: a programming error.
    #[error("a sink closed without an error")]
    SinkClosed,
}

/// What goes through the node, and how long.
pub struct Run<'a> {
    /// Where images come from.
    pub source: &'a mut dyn Source,
    /// Who measures.
    pub worker: Worker,
    /// Where results go.
    pub outlets: Vec<Outlet>,
    /// Number of published topics.
    pub num_topics: usize,
    /// The wish to end early.
    pub stop: &'a Stop,
    /// Hears how many messages were read, for a progress bar.
    pub on_message: &'a mut dyn FnMut(u64),
}

impl Run<'_> {
    /// Replays: takes every message, waits wherever a queue is full, returns when all is written.
    ///
    /// # Errors
    /// A sink has failed; everything before is written.
    pub fn replay(self) -> Result<Summary, RunError> {
        let started = Instant::now();
        let Run { source, worker, outlets, num_topics, stop, on_message } = self;
        let input = &Queue::new(INPUT_BOUND, WhenFull::Wait);
        let spare = &Queue::new(Bound { items: INPUT_BOUND.items, bytes: 0 }, WhenFull::DropOldest);
        let (fed, worked) = thread::scope(|scope| {
            let worker = scope.spawn(move || work(worker, input, spare, outlets, num_topics));
            let fed = Feed { input, spare, stop }.all(source, on_message);
            input.close();
            (fed, worker.join().unwrap_or_else(|panic| panic::resume_unwind(panic)))
        });
        let (counts, stages) = worked?;
        let Fed { num_damaged, was_interrupted } = fed;
        Ok(Summary { counts, stages, elapsed: started.elapsed(), num_damaged, was_interrupted })
    }
}

/// The life of a worker's thread: measures until the input is closed, and sees every sink to its end.
///
/// # Errors
/// An essential sink has failed; everything before is written.
pub fn work(
    worker: Worker,
    input: &Queue<Input>,
    spare: &Queue<Vec<u8>>,
    outlets: Vec<Outlet>,
    num_topics: usize,
) -> Result<(Counts, StageTimes), RunError> {
    let (worked, finished) = thread::scope(|scope| {
        let fan_out = FanOut::start(scope, outlets, num_topics);
        let worked = worker.run(input, spare, &mut Publisher::new(&fan_out, num_topics));
        (worked, fan_out.finish())
    });
    finished?;
    worked.map_err(|halt| match halt {
        Halt::SinkFailed => RunError::SinkClosed,
        Halt::Encode(error) => error.into(),
    })
}

struct Feed<'a> {
    input: &'a Queue<Input>,
    spare: &'a Queue<Vec<u8>>,
    stop: &'a Stop,
}

#[derive(Default)]
struct Fed {
    num_damaged: u64,
    was_interrupted: bool,
}

impl Feed<'_> {
    /// Hands all input to the worker; returns at its end, on the wish to stop, or when the worker has gone.
    fn all(&self, source: &mut dyn Source, on_message: &mut dyn FnMut(u64)) -> Fed {
        let mut fed = Fed::default();
        let mut num_messages = 0;
        loop {
            if self.stop.is_raised() {
                fed.was_interrupted = true;
                return fed;
            }
            while let Popped::Item(buffer, _) = self.spare.pop_counted(Some(Instant::now())) {
                source.recycle(buffer);
            }
            let (item, num_bytes) = match source.next() {
                None => return fed,
                Some(Input::Damage(what)) => {
                    fed.num_damaged += 1;
                    match fed.num_damaged.cmp(&MAX_TOLD) {
                        Ordering::Less => tracing::error!("{what}"),
                        Ordering::Equal => {
                            tracing::error!("{what}; further damage is only counted");
                        }
                        Ordering::Greater => tracing::debug!("{what}"),
                    }
                    continue;
                }
                Some(Input::Message(message, writer)) => {
                    num_messages += 1;
                    on_message(num_messages);
                    let num_bytes = message.data.len();
                    (Input::Message(message, writer), num_bytes)
                }
                Some(other) => (other, 0),
            };
            if self.input.push(item, num_bytes).is_err() {
                return fed;
            }
        }
    }
}
