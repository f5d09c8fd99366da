//! One recording, as those see it who send to it and ask for its state.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

use crate::node::{
    queue::{Bound, Closed, Popped, Queue, WhenFull},
    stop::Stop,
};

use super::{error::RecordingError, lock, status::BagStatus, tap::Tapped};

/// Messages that wait for the disk; the bytes are the bound that is set.
const MAX_WAITING: usize = 16_384;

/// A recording from its beginning until its bag is closed. Its thread is the writer's.
pub(super) struct Session {
    queue: Queue<Tapped>,
    directory: PathBuf,
    is_open: AtomicBool,
    bytes: AtomicU64,
    messages: AtomicU64,
    dropped: AtomicU64,
    /// Of all recordings of the stream.
    all_dropped: Arc<AtomicU64>,
    error: Mutex<Option<String>>,
    hurry: Stop,
    ended: Stop,
}

impl Session {
    /// A recording that takes messages.
    pub(super) fn new(directory: &Path, queue_bytes: usize, all_dropped: &Arc<AtomicU64>) -> Self {
        let bound = Bound { items: MAX_WAITING, bytes: queue_bytes };
        Self::with_queue(directory, Queue::new(bound, WhenFull::DropOldest), all_dropped)
    }

    /// A recording of these messages, which takes no more.
    pub(super) fn of(
        directory: &Path,
        messages: Vec<Tapped>,
        all_dropped: &Arc<AtomicU64>,
    ) -> Self {
        let bound = Bound { items: messages.len(), bytes: usize::MAX };
        let session = Self::with_queue(directory, Queue::new(bound, WhenFull::Wait), all_dropped);
        for message in messages {
            // There is room for all of them.
            let _pushed = session.push(message);
        }
        session.close();
        session
    }

    fn with_queue(directory: &Path, queue: Queue<Tapped>, all_dropped: &Arc<AtomicU64>) -> Self {
        Self {
            queue,
            directory: directory.into(),
            is_open: AtomicBool::new(true),
            bytes: AtomicU64::new(0),
            messages: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
            all_dropped: Arc::clone(all_dropped),
            error: Mutex::new(None),
            hurry: Stop::default(),
            ended: Stop::default(),
        }
    }

    /// Its bag.
    pub(super) fn directory(&self) -> &Path {
        &self.directory
    }

    /// Hands over a message; counts the older ones that are dropped for it.
    pub(super) fn push(&self, tapped: Tapped) -> Result<(), Closed<Tapped>> {
        let bytes = tapped.message.data.len();
        let num_dropped = self.queue.push(tapped, bytes)?;
        self.count_dropped(num_dropped as u64);
        Ok(())
    }

    /// Waits for a message.
    pub(super) fn pop_until(&self, deadline: std::time::Instant) -> Popped<Tapped> {
        self.queue.pop_counted(Some(deadline))
    }

    /// Takes no more messages; what waits is still written.
    pub(super) fn close(&self) {
        self.is_open.store(false, Ordering::Relaxed);
        self.queue.close();
    }

    /// Takes no more messages, and counts what waits as dropped.
    pub(super) fn close_and_drop(&self) {
        self.close();
        let left = std::iter::from_fn(|| self.queue.pop()).count();
        self.count_dropped(left as u64);
    }

    pub(super) fn count_written(&self) {
        self.messages.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn count_dropped(&self, num: u64) {
        self.dropped.fetch_add(num, Ordering::Relaxed);
        self.all_dropped.fetch_add(num, Ordering::Relaxed);
    }

    pub(super) fn set_bytes(&self, bytes: u64) {
        self.bytes.store(bytes, Ordering::Relaxed);
    }

    /// Says, once, why it ends.
    pub(super) fn fail(&self, error: &RecordingError) {
        tracing::error!("{error}");
        lock(&self.error).get_or_insert(error.to_string());
    }

    /// Leaves what waits unwritten, so that the bag is closed at once.
    pub(super) fn hurry(&self) {
        self.hurry.raise();
    }

    pub(super) fn is_in_a_hurry(&self) -> bool {
        self.hurry.is_raised()
    }

    /// Tells that the bag is closed.
    pub(super) fn end(&self) {
        self.close();
        self.ended.raise();
    }

    /// Waits until the bag is closed. Returns whether it is.
    pub(super) fn wait(&self, duration: Duration) -> bool {
        self.ended.wait(duration)
    }

    pub(super) fn is_open(&self) -> bool {
        self.is_open.load(Ordering::Relaxed)
    }

    /// Messages of this bag that were lost.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Messages in the bag.
    pub(super) fn messages(&self) -> u64 {
        self.messages.load(Ordering::Relaxed)
    }

    pub(super) fn status(&self) -> BagStatus {
        let is_recording = self.is_open();
        BagStatus {
            is_recording,
            is_ending: !is_recording && !self.ended.is_raised(),
            directory: Some(self.directory.clone()),
            bytes: self.bytes.load(Ordering::Relaxed),
            messages: self.messages(),
            dropped: self.all_dropped.load(Ordering::Relaxed),
            last_error: lock(&self.error).clone(),
        }
    }
}
