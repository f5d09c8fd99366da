//! A thread that processes a stream until it is dropped.

use std::{
    convert::Infallible,
    thread::{self, JoinHandle},
};

use futures::{
    StreamExt,
    channel::oneshot,
    executor,
    future::{self, Either},
    stream::{self, Stream},
};

use crate::ros::transport::TransportError;

/// Completes when the listener is dropped.
pub(super) struct Stop(oneshot::Receiver<Infallible>);

impl Stop {
    /// Passes every element of the stream to `take`, on this thread, until the listener is dropped.
    pub(super) fn follow<T>(self, elements: impl Stream<Item = T>, mut take: impl FnMut(T)) {
        // Stopping has priority: nothing is taken once it is requested.
        let stopped = stream::once(self.0).map(Either::Right);
        let elements = elements.map(Either::Left);
        let both =
            stream::select_with_strategy(stopped, elements, |(): &mut ()| stream::PollNext::Left);
        let left = both.take_while(|next| future::ready(matches!(next, Either::Left(_)))).for_each(
            |next| {
                if let Either::Left(element) = next {
                    take(element);
                }
                future::ready(())
            },
        );
        executor::block_on(left);
    }
}

/// Handle of the thread. Dropping it waits until the thread has ended.
pub(super) struct Listener {
    stop: Option<oneshot::Sender<Infallible>>,
    thread: Option<JoinHandle<()>>,
}

impl Listener {
    /// Starts a thread that runs `listen`, which must return on [`Stop`]. `name` is the topic, for the error.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn start(
        name: &str,
        listen: impl FnOnce(Stop) + Send + 'static,
    ) -> Result<Self, TransportError> {
        let (stop, stopped) = oneshot::channel();
        let thread = thread::Builder::new()
            .name(format!("dds {name}"))
            .spawn(move || listen(Stop(stopped)))
            .map_err(|error| TransportError::Endpoint {
                name: name.to_owned(),
                reason: format!("cannot start a thread: {error}"),
            })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        drop(self.stop.take());
        let Some(thread) = self.thread.take() else { return };
        // A callback may drop the subscription on this very thread, which cannot join itself.
        if thread.thread().id() != thread::current().id() && thread.join().is_err() {
            tracing::error!("a DDS listener thread panicked");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn elements_are_taken_until_the_listener_is_dropped() {
        let (taken, takes) = mpsc::sync_channel(8);
        let listener = Listener::start("test", move |stop| {
            let endless = stream::iter([1, 2, 3]).chain(stream::pending());
            stop.follow(endless, |number| taken.send(number).unwrap());
        })
        .unwrap();
        assert_eq!(takes.iter().take(3).collect::<Vec<_>>(), [1, 2, 3]);
        drop(listener);
        assert_eq!(
            takes.recv(),
            Err(mpsc::RecvError),
            "the thread is gone, and its sender with it"
        );
    }

    #[test]
    fn a_stream_that_is_always_ready_is_stopped_too() {
        let listener = Listener::start("test", |stop| stop.follow(stream::repeat(0), |_| {}));
        drop(listener.unwrap());
    }
}
