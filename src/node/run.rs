//! Runs source → queue → worker → sinks from the first frame to the last.

use std::{
    panic,
    thread::{self, ScopedJoinHandle},
    time::Instant,
};

use thiserror::Error;

use crate::msg::cdr::CdrError;

use super::{
    fan_out::FanOut,
    feed::{Fed, Feed, Lane},
    named,
    publisher::{PublishError, Publisher},
    queue::{Bound, Queue},
    sink::{Outlet, SinkError},
    source::{Input, Source},
    statistics::{Counts, StageTimes, Summary},
    stop::Stop,
    unpack::Unpacker,
    worker::Worker,
};

/// Bound of the queue of a live camera: enough frames to keep the worker busy, few enough to fit into memory. The bytes
/// allow the largest frames.
pub(crate) const INPUT_BOUND: Bound = Bound { items: 4, bytes: 256 << 20 };
/// Bound of a worker's queue in a replay. The bytes are few, so that queued frames and reused buffers stay in the
/// processor's cache.
pub(crate) const REPLAY_BOUND: Bound = Bound { items: 8, bytes: 12 << 20 };

/// The reason that a run ended early.
#[derive(Debug, Error)]
pub(crate) enum RunError {
    /// A sink has failed, for example because the disk is full. Messages written before are kept.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A result cannot be encoded.
    #[error(transparent)]
    Encode(#[from] CdrError),
    /// The worker has panicked.
    #[error("a worker ended by a programming error")]
    Panicked,
    /// The worker found a sink closed that reports no error: a programming error.
    #[error("a sink closed without an error")]
    SinkClosed,
}

/// The processing of one camera's images.
pub(crate) struct Chain {
    /// Topic of its images.
    pub(crate) topic: String,
    /// The worker that measures them.
    pub(crate) worker: Worker,
    /// Sinks of the results.
    pub(crate) outlets: Vec<Outlet>,
    /// Number of published topics.
    pub(crate) num_topics: usize,
}

/// Source, cameras and end of a run.
pub(crate) struct Run<'a> {
    /// Source of the images.
    pub(crate) source: &'a mut dyn Source,
    /// The cameras.
    pub(crate) chains: Vec<Chain>,
    /// Flag that ends the run early.
    pub(crate) stop: &'a Stop,
    /// Called with the number of messages read, for a progress bar.
    pub(crate) on_message: &'a mut dyn FnMut(u64),
}

impl Run<'_> {
    /// Runs a replay: processes every message, waits if a queue is full, and returns when all results are written.
    ///
    /// Cameras are independent: each has its own worker and sinks, whose results do not depend on the number of
    /// cameras.
    ///
    /// # Errors
    /// A sink has failed; all earlier results are written.
    pub(crate) fn replay(self) -> Result<Summary, RunError> {
        let started = Instant::now();
        let Run { source, chains, stop, on_message } = self;
        let is_packed = |chain: &Chain| chain.worker.unpacks_bytes().is_some();
        let unpacker = &chains.iter().any(is_packed).then(Unpacker::on_all_cores);
        let lanes: &Vec<_> = &chains.iter().map(|chain| chain.lane(unpacker.as_ref())).collect();
        let (fed, worked) = thread::scope(|scope| {
            if let Some(unpacker) = unpacker {
                unpacker.start(scope);
            }
            let mut workers = Vec::new();
            for (Chain { worker, outlets, num_topics, .. }, lane) in chains.into_iter().zip(lanes) {
                let work = move || work(worker, &lane.input, &lane.spare, outlets, num_topics);
                workers.push(named::spawn(scope, "measure", work));
            }
            let feed = Feed { lanes, unpacker: unpacker.as_ref(), stop };
            let fed = feed.all(source, on_message);
            let join = |worker: ScopedJoinHandle<'_, _>| {
                worker.join().unwrap_or_else(|panic| panic::resume_unwind(panic))
            };
            (fed, workers.into_iter().map(join).collect::<Vec<_>>())
        });
        let Fed { num_damaged, was_interrupted } = fed;
        let mut summary = Summary { num_damaged, was_interrupted, ..Summary::default() };
        for worked in worked {
            let (counts, stages) = worked?;
            summary.counts.add(&counts);
            summary.stages.add(&stages);
        }
        Ok(Summary { elapsed: started.elapsed(), ..summary })
    }
}

impl Chain {
    fn lane(&self, unpacker: Option<&Unpacker>) -> Lane {
        let unpacks_bytes = self.worker.unpacks_bytes();
        let bound = match (unpacker, unpacks_bytes) {
            (Some(unpacker), Some(_)) => Bound { items: unpacker.num_ahead(), ..REPLAY_BOUND },
            _ => REPLAY_BOUND,
        };
        let positions = self.worker.position_topics().to_vec();
        Lane::new(self.topic.clone(), positions, bound, unpacks_bytes)
    }
}

/// Body of a worker's thread: measures until the input is closed, then finishes every sink.
///
/// # Errors
/// An essential sink has failed; all earlier results are written.
pub(crate) fn work(
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
        PublishError::SinkFailed => RunError::SinkClosed,
        PublishError::Encode(error) => error.into(),
    })
}
