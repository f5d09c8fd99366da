//! Notices threads of a node that panic, so that the node ends with an error instead of living on half dead.

use std::{
    sync::{Arc, OnceLock},
    thread,
};

use super::sink::{Outgoing, Sink, SinkError};

/// The threads of one node. Clones share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watch(Arc<OnceLock<String>>);

impl Watch {
    /// Guards the current thread, or one call on it, until the guard is dropped. `name` says what it does.
    pub(crate) fn guard<'a>(&'a self, name: &'a str) -> Guard<'a> {
        Guard { watch: self, name }
    }

    /// Returns the name of the first thread that panicked.
    pub(crate) fn panicked(&self) -> Option<&str> {
        self.0.get().map(String::as_str)
    }

    /// Guards every call of a sink.
    pub(crate) fn sink(&self, name: String, sink: Box<dyn Sink>) -> Box<dyn Sink> {
        Box::new(WatchedSink { watch: self.clone(), name, sink })
    }
}

/// Notes the thread's name when it is dropped by a panic.
#[must_use]
pub(crate) struct Guard<'a> {
    watch: &'a Watch,
    name: &'a str,
}

impl Drop for Guard<'_> {
    fn drop(&mut self) {
        if thread::panicking() && self.watch.0.set(self.name.to_owned()).is_ok() {
            tracing::error!("{} ended by a programming error: the node ends", self.name);
        }
    }
}

struct WatchedSink {
    watch: Watch,
    name: String,
    sink: Box<dyn Sink>,
}

impl Sink for WatchedSink {
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        let _guard = self.watch.guard(&self.name);
        self.sink.write(message)
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        let _guard = self.watch.guard(&self.name);
        self.sink.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_thread_that_panics_is_named() {
        let watch = Watch::default();
        let run = |name: &'static str, panics: fn()| {
            let watch = watch.clone();
            let work = move || {
                let _guard = watch.guard(name);
                panics();
            };
            thread::spawn(work).join().is_ok()
        };
        assert!(run("quiet", || {}));
        assert_eq!(watch.panicked(), None);
        assert!(!run("first", || panic!("on purpose")));
        assert!(!run("second", || panic!("on purpose")));
        assert_eq!(watch.panicked(), Some("first"));
    }
}
