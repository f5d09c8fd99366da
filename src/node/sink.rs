//! Where results go: the seam at which a recorder, DDS, Zenoh or a viewer is plugged in, each behind a queue of its own.

use std::{
    sync::Arc,
    thread::{Scope, ScopedJoinHandle},
};

use thiserror::Error;

use super::queue::{Bound, Closed, Queue, WhenFull};

/// One encoded message on its way out. All sinks share the bytes.
#[derive(Clone, Debug)]
pub struct Outgoing {
    /// Index into the list of published topics.
    pub topic: usize,
    /// When the input of this result was received, nanoseconds since the epoch.
    pub log_time_ns: i64,
    /// When it was sent, nanoseconds since the epoch.
    pub publish_time_ns: i64,
    /// Counter of this topic, from 1; of an input message its own.
    pub sequence: u32,
    /// CDR bytes with their header.
    pub data: Arc<[u8]>,
}

/// A sink that can take no more.
#[derive(Debug, Error)]
#[error("{sink}: {source}")]
pub struct SinkError {
    /// Which sink.
    pub sink: String,
    /// Why.
    #[source]
    pub source: Box<dyn std::error::Error + Send + Sync>,
}

/// A consumer of results, on a thread of its own.
pub trait Sink: Send {
    /// Takes one message.
    ///
    /// # Errors
    /// Nothing more can be taken.
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError>;

    /// Ends; called once, even after an error, so that what was taken is kept.
    ///
    /// # Errors
    /// What was taken may be incomplete.
    fn finish(&mut self) -> Result<(), SinkError>;
}

/// What a sink's queue may hold: enough for the burst at the end of a slice.
pub const SINK_BOUND: Bound = Bound { items: 256, bytes: 64 << 20 };

/// All sinks, each behind its own bounded queue and thread.
pub struct FanOut<'scope> {
    sinks: Vec<Fan<'scope>>,
}

struct Fan<'scope> {
    queue: Arc<Queue<Outgoing>>,
    thread: ScopedJoinHandle<'scope, Result<(), SinkError>>,
}

impl<'scope> FanOut<'scope> {
    /// Starts a thread for every sink.
    pub fn start<'env>(
        scope: &'scope Scope<'scope, 'env>,
        sinks: Vec<Box<dyn Sink>>,
        when_full: WhenFull,
    ) -> Self {
        let start = |sink: Box<dyn Sink>| {
            let queue = Arc::new(Queue::new(SINK_BOUND, when_full));
            let taken = Arc::clone(&queue);
            Fan { queue, thread: scope.spawn(move || drain(&taken, sink)) }
        };
        Self { sinks: sinks.into_iter().map(start).collect() }
    }

    /// Hands a message to every sink; returns how many older ones full queues dropped for it.
    ///
    /// # Errors
    /// A sink has failed: [`finish`](Self::finish) tells why.
    pub fn send(&self, message: &Outgoing) -> Result<usize, Closed<()>> {
        let mut num_dropped = 0;
        for Fan { queue, .. } in &self.sinks {
            match queue.push(message.clone(), message.data.len()) {
                Ok(num) => num_dropped += num,
                Err(Closed(_)) => return Err(Closed(())),
            }
        }
        Ok(num_dropped)
    }

    /// Lets every sink take what waits for it and end.
    ///
    /// # Errors
    /// The first error of a sink.
    pub fn finish(mut self) -> Result<(), SinkError> {
        let mut first_error = Ok(());
        for Fan { queue, thread } in std::mem::take(&mut self.sinks) {
            queue.close();
            let result = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            first_error = first_error.and(result);
        }
        first_error
    }
}

/// Lets no sink wait for a sender that is gone, not even after a panic.
impl Drop for FanOut<'_> {
    fn drop(&mut self) {
        self.sinks.iter().for_each(|fan| fan.queue.close());
    }
}

fn drain(queue: &Queue<Outgoing>, mut sink: Box<dyn Sink>) -> Result<(), SinkError> {
    let _closed_at_the_end = CloseOnDrop(queue);
    let mut written = Ok(());
    while let Some(message) = queue.pop() {
        written = sink.write(&message);
        if written.is_err() {
            break;
        }
    }
    let finished = sink.finish();
    written.and(finished)
}

/// Lets no sender wait for a receiver that is gone, not even after a panic.
pub(super) struct CloseOnDrop<'a, T>(pub(super) &'a Queue<T>);

impl<T> Drop for CloseOnDrop<'_, T> {
    fn drop(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::Mutex, thread};

    use super::*;

    /// Keeps what it gets; fails at the message with that number.
    struct Memory {
        kept: Arc<Mutex<Vec<Outgoing>>>,
        fails_at: Option<u32>,
    }

    impl Sink for Memory {
        fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
            if self.fails_at == Some(message.sequence) {
                return Err(SinkError { sink: "memory".into(), source: "full".into() });
            }
            self.kept.lock().unwrap().push(message.clone());
            Ok(())
        }

        fn finish(&mut self) -> Result<(), SinkError> {
            let end = message(u32::MAX);
            self.kept.lock().unwrap().push(end);
            Ok(())
        }
    }

    fn message(sequence: u32) -> Outgoing {
        Outgoing {
            topic: 0,
            log_time_ns: 0,
            publish_time_ns: 0,
            sequence,
            data: Arc::from([7_u8; 10]),
        }
    }

    #[test]
    fn every_sink_gets_the_same_bytes_in_order() {
        let kept = [Arc::default(), Arc::default()];
        let sinks = kept.each_ref().map(|kept| {
            Box::new(Memory { kept: Arc::clone(kept), fails_at: None }) as Box<dyn Sink>
        });
        thread::scope(|scope| {
            let fan_out = FanOut::start(scope, sinks.into(), WhenFull::Wait);
            for sequence in 0..1000 {
                assert!(fan_out.send(&message(sequence)).is_ok());
            }
            assert!(fan_out.finish().is_ok());
        });
        let [first, second] = kept.map(|kept| std::mem::take(&mut *kept.lock().unwrap()));
        let sequences = first.iter().map(|message| message.sequence);
        assert!(sequences.eq((0..1000).chain([u32::MAX])), "all, then finish");
        let pairs = first.iter().zip(&second).take(1000);
        assert!(pairs.into_iter().all(|(a, b)| Arc::ptr_eq(&a.data, &b.data)), "no copy a sink");
    }

    #[test]
    fn a_failing_sink_stops_the_sender_and_is_finished() {
        let kept = Arc::default();
        let sink = Memory { kept: Arc::clone(&kept), fails_at: Some(3) };
        let result = thread::scope(|scope| {
            let fan_out = FanOut::start(scope, vec![Box::new(sink)], WhenFull::Wait);
            // More than the queue holds: without the closed queue this would wait for ever.
            let sent = (0..10_000).take_while(|&sequence| fan_out.send(&message(sequence)).is_ok());
            assert!(sent.count() < 10_000);
            fan_out.finish()
        });
        assert_eq!(result.unwrap_err().to_string(), "memory: full");
        let sequences: Vec<_> =
            kept.lock().unwrap().iter().map(|message| message.sequence).collect();
        assert_eq!(sequences, [0, 1, 2, u32::MAX]);
    }
}
