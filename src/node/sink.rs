//! Where results go: the seam at which a recorder, DDS, Zenoh or a viewer is plugged in, each behind a queue of its own.

use std::{
    cell::Cell,
    sync::Arc,
    thread::{Scope, ScopedJoinHandle},
    time::{Duration, Instant},
};

use thiserror::Error;

use super::queue::{Bound, Closed, Popped, Queue, WhenFull};

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

    /// Called now and then, whether messages come or not, where the outlet asks for it.
    ///
    /// # Errors
    /// Nothing more can be taken.
    fn idle(&mut self) -> Result<(), SinkError> {
        Ok(())
    }

    /// Ends; called once, even after an error, so that what was taken is kept.
    ///
    /// # Errors
    /// What was taken may be incomplete.
    fn finish(&mut self) -> Result<(), SinkError>;
}

/// Which messages a sink gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// Results.
    Results,
    /// Input images.
    Images,
    /// Both.
    All,
}

/// What a sink is for: what full queues drop is counted by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To reach others now.
    Publish,
    /// To be kept.
    Record,
}

/// A sink and how messages reach it.
pub struct Outlet {
    /// The consumer.
    pub sink: Box<dyn Sink>,
    /// Which messages it gets.
    pub takes: Takes,
    /// What it is for.
    pub purpose: Purpose,
    /// What may wait for it.
    pub bound: Bound,
    /// What happens when more comes.
    pub when_full: WhenFull,
    /// Whether the run ends with it. If not, its end is told, and the others go on.
    pub is_essential: bool,
    /// How long it is left alone at most, see [`Sink::idle`]; `None`: for ever.
    pub idle_period: Option<Duration>,
}

impl Outlet {
    /// The sink of a replay, which waits for it and ends with it.
    pub fn replay(sink: Box<dyn Sink>) -> Self {
        Self {
            sink,
            takes: Takes::All,
            purpose: Purpose::Record,
            bound: SINK_BOUND,
            when_full: WhenFull::Wait,
            is_essential: true,
            idle_period: None,
        }
    }
}

/// What a sink's queue may hold: enough for the burst at the end of a slice.
pub const SINK_BOUND: Bound = Bound { items: 256, bytes: 64 << 20 };

/// All sinks, each behind its own bounded queue and thread.
pub struct FanOut<'scope> {
    sinks: Vec<Fan<'scope>>,
    /// Topics below are results, the one behind them is the input's.
    num_topics: usize,
}

struct Fan<'scope> {
    takes: Takes,
    purpose: Purpose,
    is_essential: bool,
    num_dropped: Cell<u64>,
    queue: Arc<Queue<Outgoing>>,
    thread: ScopedJoinHandle<'scope, Result<(), SinkError>>,
}

impl<'scope> FanOut<'scope> {
    /// Starts a thread for every sink; `num_topics` of the topics are results.
    pub fn start<'env>(
        scope: &'scope Scope<'scope, 'env>,
        outlets: Vec<Outlet>,
        num_topics: usize,
    ) -> Self {
        let start = |outlet: Outlet| {
            let queue = Arc::new(Queue::new(outlet.bound, outlet.when_full));
            let taken = Arc::clone(&queue);
            let Outlet { sink, takes, purpose, is_essential, idle_period, .. } = outlet;
            let run = move || {
                let drained = drain(&taken, sink, idle_period);
                if let (Err(error), false) = (&drained, is_essential) {
                    tracing::error!("{error}; everything else goes on");
                }
                drained
            };
            let thread = scope.spawn(run);
            Fan { takes, purpose, is_essential, num_dropped: Cell::new(0), queue, thread }
        };
        Self { sinks: outlets.into_iter().map(start).collect(), num_topics }
    }

    /// Hands a message to every sink that takes it.
    ///
    /// # Errors
    /// An essential sink has failed: [`finish`](Self::finish) tells why.
    pub fn send(&self, message: &Outgoing) -> Result<(), Closed<()>> {
        let is_result = message.topic < self.num_topics;
        for fan in self.sinks.iter().filter(|fan| fan.takes.includes(is_result)) {
            match fan.queue.push(message.clone(), message.data.len()) {
                Ok(num) => fan.num_dropped.set(fan.num_dropped.get() + num as u64),
                Err(Closed(_)) if fan.is_essential => return Err(Closed(())),
                Err(Closed(_)) => fan.num_dropped.set(fan.num_dropped.get() + 1),
            }
        }
        Ok(())
    }

    /// Messages that did not reach the sinks of that purpose, one a sink.
    pub fn num_dropped(&self, purpose: Purpose) -> u64 {
        let of_purpose = self.sinks.iter().filter(|fan| fan.purpose == purpose);
        of_purpose.map(|fan| fan.num_dropped.get()).sum()
    }

    /// Lets every sink take what waits for it and end.
    ///
    /// # Errors
    /// The first error of an essential sink.
    pub fn finish(mut self) -> Result<(), SinkError> {
        let mut first_error = Ok(());
        let sinks = std::mem::take(&mut self.sinks);
        // All at once: one that takes long does not keep the others open.
        sinks.iter().for_each(|fan| fan.queue.close());
        for Fan { thread, is_essential, .. } in sinks {
            let result = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            if is_essential {
                first_error = first_error.and(result);
            }
        }
        first_error
    }
}

impl Takes {
    const fn includes(self, is_result: bool) -> bool {
        match self {
            Self::Results => is_result,
            Self::Images => !is_result,
            Self::All => true,
        }
    }
}

/// Lets no sink wait for a sender that is gone, not even after a panic.
impl Drop for FanOut<'_> {
    fn drop(&mut self) {
        self.sinks.iter().for_each(|fan| fan.queue.close());
    }
}

fn drain(
    queue: &Queue<Outgoing>,
    mut sink: Box<dyn Sink>,
    idle_period: Option<Duration>,
) -> Result<(), SinkError> {
    let _closed_at_the_end = CloseOnDrop(queue);
    let mut next_idle = idle_period.map(|period| Instant::now() + period);
    let mut written = Ok(());
    while written.is_ok() {
        written = match queue.pop_counted(next_idle) {
            Popped::Item(message, _) => sink.write(&message),
            Popped::TimedOut => Ok(()),
            Popped::Closed => break,
        };
        if let (Some(due), Some(period), true) = (next_idle, idle_period, written.is_ok())
            && Instant::now() >= due
        {
            next_idle = Some(Instant::now() + period);
            written = sink.idle();
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
            Outlet::replay(Box::new(Memory { kept: Arc::clone(kept), fails_at: None }))
        });
        thread::scope(|scope| {
            let fan_out = FanOut::start(scope, sinks.into(), 1);
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
            let fan_out = FanOut::start(scope, vec![Outlet::replay(Box::new(sink))], 1);
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

    #[test]
    fn a_sink_that_may_fail_takes_nobody_with_it() {
        let kept = [Arc::default(), Arc::default()];
        let sink = |at: usize, fails_at| Box::new(Memory { kept: Arc::clone(&kept[at]), fails_at });
        let outlets = vec![
            Outlet { is_essential: false, ..Outlet::replay(sink(0, Some(3))) },
            Outlet::replay(sink(1, None)),
        ];
        thread::scope(|scope| {
            let fan_out = FanOut::start(scope, outlets, 1);
            assert!((0..1000).all(|sequence| fan_out.send(&message(sequence)).is_ok()));
            let num_dropped = fan_out.num_dropped(Purpose::Record);
            assert!(num_dropped > 0 && num_dropped < 1000, "{num_dropped}");
            assert!(fan_out.finish().is_ok());
        });
        assert_eq!(kept[0].lock().unwrap().len(), 4);
        assert_eq!(kept[1].lock().unwrap().len(), 1001);
    }

    #[test]
    fn images_and_results_go_their_own_ways() {
        let kept = [Arc::default(), Arc::default()];
        let outlet = |at: usize, takes| {
            let sink = Box::new(Memory { kept: Arc::clone(&kept[at]), fails_at: None });
            Outlet { takes, ..Outlet::replay(sink) }
        };
        let outlets = vec![outlet(0, Takes::Results), outlet(1, Takes::Images)];
        thread::scope(|scope| {
            let fan_out = FanOut::start(scope, outlets, 1);
            for topic in [0, 1, 0] {
                assert!(fan_out.send(&Outgoing { topic, ..message(topic as u32) }).is_ok());
            }
            assert!(fan_out.finish().is_ok());
        });
        let topics = |at: usize| -> Vec<_> {
            let kept: &Arc<Mutex<Vec<Outgoing>>> = &kept[at];
            kept.lock().unwrap().iter().map(|message| message.sequence).collect()
        };
        assert_eq!(topics(0), [0, 0, u32::MAX]);
        assert_eq!(topics(1), [1, u32::MAX]);
    }

    #[test]
    fn a_sink_that_asks_for_it_is_never_left_alone() {
        struct Idle(std::sync::mpsc::SyncSender<()>);
        impl Sink for Idle {
            fn write(&mut self, _: &Outgoing) -> Result<(), SinkError> {
                Ok(())
            }
            fn idle(&mut self) -> Result<(), SinkError> {
                drop(self.0.try_send(()));
                Ok(())
            }
            fn finish(&mut self) -> Result<(), SinkError> {
                Ok(())
            }
        }
        let (sender, receiver) = std::sync::mpsc::sync_channel(2);
        let idle_period = Some(Duration::from_millis(1));
        let outlet = Outlet { idle_period, ..Outlet::replay(Box::new(Idle(sender))) };
        thread::scope(|scope| {
            let fan_out = FanOut::start(scope, vec![outlet], 1);
            for _ in 0..2 {
                assert!(receiver.recv_timeout(Duration::from_secs(10)).is_ok());
            }
            assert!(fan_out.finish().is_ok());
        });
    }
}
