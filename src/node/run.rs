//! Source → queue → worker → sinks: a run from the first frame to the last.

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

/// Frames that wait for the worker of a live camera: enough to keep it busy, few enough to fit into memory. The bytes
/// hold the largest frames that it takes.
pub const INPUT_BOUND: Bound = Bound { items: 4, bytes: 256 << 20 };
/// Frames that wait for a worker in a replay. Its bytes are few: what waits should still be in the processor's cache when
/// it is taken, and the memory of frames that were taken before the next are read.
pub const REPLAY_BOUND: Bound = Bound { items: 8, bytes: 12 << 20 };

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

/// What is done with the images of one camera.
pub struct Chain {
    /// The topic of its images.
    pub topic: String,
    /// Who measures.
    pub worker: Worker,
    /// Where results go.
    pub outlets: Vec<Outlet>,
    /// Number of published topics.
    pub num_topics: usize,
}

/// What goes through the node, and how long.
pub struct Run<'a> {
    /// Where images come from.
    pub source: &'a mut dyn Source,
    /// One for each camera.
    pub chains: Vec<Chain>,
    /// The wish to end early.
    pub stop: &'a Stop,
    /// Hears how many messages were read, for a progress bar.
    pub on_message: &'a mut dyn FnMut(u64),
}

impl Run<'_> {
    /// Replays: takes every message, waits wherever a queue is full, returns when all is written.
    ///
    /// No camera knows of the others: each has its own worker and its own sinks, which see the same however many there
    /// are.
    ///
    /// # Errors
    /// A sink has failed; everything before is written.
    pub fn replay(self) -> Result<Summary, RunError> {
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
        Lane::new((self.topic.clone(), positions), bound, unpacks_bytes)
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
        PublishError::SinkFailed => RunError::SinkClosed,
        PublishError::Encode(error) => error.into(),
    })
}
