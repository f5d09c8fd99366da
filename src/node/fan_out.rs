//! Sends every message to every sink: through a bounded queue to the sink's own thread, or directly.

use std::{
    cell::{Cell, RefCell},
    sync::Arc,
    thread::{Scope, ScopedJoinHandle},
};

use super::{
    named,
    queue::{Closed, Queue},
    sink::{Outgoing, Outlet, Purpose, Sink, SinkError, Way},
};

/// All sinks.
pub(crate) struct FanOut<'scope> {
    fans: Vec<Fan<'scope>>,
    /// Topics with a smaller index are results; the next one is the input.
    num_topics: usize,
}

struct Fan<'scope> {
    takes_images: bool,
    purpose: Purpose,
    is_essential: bool,
    num_dropped: Cell<u64>,
    reached: Reached<'scope>,
}

enum Reached<'scope> {
    Directly(RefCell<Direct>),
    Queued(Arc<Queue<Outgoing>>, ScopedJoinHandle<'scope, Result<(), SinkError>>),
}

/// A sink and its error.
struct Direct(Box<dyn Sink>, Result<(), SinkError>);

impl<'scope> FanOut<'scope> {
    /// Starts a thread for every sink with a queue; the first `num_topics` topics are results.
    pub(crate) fn start<'env>(
        scope: &'scope Scope<'scope, 'env>,
        outlets: Vec<Outlet>,
        num_topics: usize,
    ) -> Self {
        let start = |outlet: Outlet| {
            let Outlet { sink, takes_images, purpose, way, is_essential } = outlet;
            let reached = match way {
                Way::Direct => Reached::Directly(RefCell::new(Direct(sink, Ok(())))),
                Way::Queued(bound, when_full) => {
                    let queue = Arc::new(Queue::new(bound, when_full));
                    let taken = Arc::clone(&queue);
                    let run = move || {
                        let ended = drain(&taken, sink);
                        if is_essential { ended } else { log_failure(ended) }
                    };
                    Reached::Queued(queue, named::spawn(scope, "results", run))
                }
            };
            Fan { takes_images, purpose, is_essential, num_dropped: Cell::new(0), reached }
        };
        Self { fans: outlets.into_iter().map(start).collect(), num_topics }
    }

    /// Sends a message to every sink that accepts it.
    ///
    /// # Errors
    /// An essential sink has failed: [`finish`](Self::finish) returns the reason.
    pub(crate) fn send(&self, message: &Outgoing) -> Result<(), Closed<()>> {
        let is_result = message.topic < self.num_topics;
        for fan in self.fans.iter().filter(|fan| is_result || fan.takes_images) {
            match fan.pass(message) {
                Ok(num) => fan.num_dropped.set(fan.num_dropped.get() + num as u64),
                Err(Closed(())) if fan.is_essential => return Err(Closed(())),
                Err(Closed(())) => fan.num_dropped.set(fan.num_dropped.get() + 1),
            }
        }
        Ok(())
    }

    /// Messages that did not reach the sinks of that purpose, counted once per sink.
    pub(crate) fn num_dropped(&self, purpose: Purpose) -> u64 {
        let of_purpose = self.fans.iter().filter(|fan| fan.purpose == purpose);
        of_purpose.map(|fan| fan.num_dropped.get()).sum()
    }

    /// Drains the queue of every sink, then finishes the sinks.
    ///
    /// # Errors
    /// The first error of an essential sink.
    pub(crate) fn finish(mut self) -> Result<(), SinkError> {
        let mut first_error = Ok(());
        let fans = std::mem::take(&mut self.fans);
        // Closes all queues first, so that a slow sink does not keep the others open.
        fans.iter().for_each(Fan::close);
        for Fan { reached, is_essential, .. } in fans {
            let result = match reached {
                Reached::Directly(direct) => {
                    let Direct(mut sink, written) = direct.into_inner();
                    let finished = sink.finish();
                    let ended = written.and(finished);
                    if is_essential { ended } else { log_failure(ended) }
                }
                Reached::Queued(_, thread) => {
                    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                }
            };
            if is_essential {
                first_error = first_error.and(result);
            }
        }
        first_error
    }
}

impl Fan<'_> {
    /// Returns the number of older messages dropped for it, or `Closed` if the sink has failed.
    fn pass(&self, message: &Outgoing) -> Result<usize, Closed<()>> {
        match &self.reached {
            Reached::Directly(direct) => {
                let Direct(sink, written) = &mut *direct.borrow_mut();
                if written.is_ok() {
                    *written = sink.write(message);
                }
                written.as_ref().map_or(Err(Closed(())), |()| Ok(0))
            }
            Reached::Queued(queue, _) => {
                queue.push(message.clone(), message.data.len()).map_err(|Closed(_)| Closed(()))
            }
        }
    }

    fn close(&self) {
        if let Reached::Queued(queue, _) = &self.reached {
            queue.close();
        }
    }
}

/// Closes the queues, even after a panic, so that no sink waits for a terminated sender.
impl Drop for FanOut<'_> {
    fn drop(&mut self) {
        self.fans.iter().for_each(Fan::close);
    }
}

fn drain(queue: &Queue<Outgoing>, mut sink: Box<dyn Sink>) -> Result<(), SinkError> {
    let _closed_at_the_end = CloseOnDrop(queue);
    let mut written = Ok(());
    while written.is_ok() {
        let Some(message) = queue.pop() else { break };
        written = sink.write(&message);
    }
    let finished = sink.finish();
    written.and(finished)
}

/// Logs the error of a non-essential sink. The error of an essential sink ends the run and is reported there.
fn log_failure(ended: Result<(), SinkError>) -> Result<(), SinkError> {
    ended.inspect_err(|error| tracing::error!("{error}; the other sinks continue"))
}

/// Closes the queue, even after a panic, so that no sender waits for a terminated receiver.
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

    /// Keeps all messages; fails at the message with that number.
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
        assert!(pairs.into_iter().all(|(a, b)| Arc::ptr_eq(&a.data, &b.data)), "no copy per sink");
    }

    #[test]
    fn a_failing_sink_stops_the_sender_and_is_finished() {
        let kept = Arc::default();
        let sink = Memory { kept: Arc::clone(&kept), fails_at: Some(3) };
        let result = thread::scope(|scope| {
            let fan_out = FanOut::start(scope, vec![Outlet::replay(Box::new(sink))], 1);
            // More than the queue holds: if the queue were not closed, this would wait forever.
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
    fn a_failing_non_essential_sink_does_not_stop_the_others() {
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
    fn only_sinks_that_take_images_receive_them() {
        let kept = [Arc::default(), Arc::default()];
        let outlet = |at: usize, takes_images| {
            let sink = Box::new(Memory { kept: Arc::clone(&kept[at]), fails_at: None });
            Outlet { takes_images, ..Outlet::replay(sink) }
        };
        let outlets = vec![outlet(0, false), outlet(1, true)];
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
        assert_eq!(topics(1), [0, 1, 0, u32::MAX]);
    }

    #[test]
    fn a_direct_sink_has_a_message_when_it_is_sent() {
        let kept = [Arc::default(), Arc::default()];
        let outlet = |at: usize, fails_at| {
            let sink = Box::new(Memory { kept: Arc::clone(&kept[at]), fails_at });
            Outlet { way: Way::Direct, is_essential: false, ..Outlet::replay(sink) }
        };
        thread::scope(|scope| {
            let fan_out = FanOut::start(scope, vec![outlet(0, None), outlet(1, Some(2))], 1);
            for sequence in 0..5 {
                assert!(fan_out.send(&message(sequence)).is_ok());
                assert_eq!(kept[0].lock().unwrap().len(), sequence as usize + 1);
            }
            assert_eq!(fan_out.num_dropped(Purpose::Record), 3, "one failed and accepts no more");
            assert!(fan_out.finish().is_ok());
        });
        assert_eq!(kept.map(|kept| kept.lock().unwrap().len()), [6, 3], "and each is finished");
    }
}
