//! One recording, shared by its senders, its writer and status queries.

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

use super::{account::Account, error::RecordingError, lock, status::BagStatus, tap::Tapped};

/// Maximum number of queued messages. The limit that users set is in bytes.
const MAX_WAITING: usize = 16_384;

/// A recording from its start until its bag is closed. The writer runs its thread.
pub(super) struct Session {
    queue: Queue<Tapped>,
    directory: PathBuf,
    /// False if the bag could not be created.
    has_bag: bool,
    is_open: AtomicBool,
    bytes: AtomicU64,
    messages: AtomicU64,
    dropped: AtomicU64,
    /// Losses of all recordings of the stream.
    account: Arc<Account>,
    error: Mutex<Option<String>>,
    is_abandoned: Stop,
    ended: Stop,
}

impl Session {
    /// Returns a recording that accepts messages.
    pub(super) fn new(directory: &Path, queue_bytes: usize, account: &Arc<Account>) -> Self {
        let bound = Bound { items: MAX_WAITING, bytes: queue_bytes };
        Self::with_queue(directory, Queue::new(bound, WhenFull::DropOldest), account)
    }

    /// Returns a recording that could not start: it counts every message as dropped.
    pub(super) fn failed(error: &RecordingError, account: &Arc<Account>) -> Self {
        let queue = Queue::new(Bound { items: 1, bytes: 0 }, WhenFull::DropOldest);
        let session = Self { has_bag: false, ..Self::with_queue(Path::new(""), queue, account) };
        session.note_failure(error);
        session.end();
        session
    }

    /// Returns a recording of these messages that accepts no more.
    pub(super) fn of(directory: &Path, messages: Vec<Tapped>, account: &Arc<Account>) -> Self {
        let bound = Bound { items: messages.len(), bytes: usize::MAX };
        let session = Self::with_queue(directory, Queue::new(bound, WhenFull::Wait), account);
        for message in messages {
            // The queue has room for all of them.
            let _pushed = session.push(message);
        }
        session.close();
        session
    }

    fn with_queue(directory: &Path, queue: Queue<Tapped>, account: &Arc<Account>) -> Self {
        Self {
            queue,
            directory: directory.into(),
            has_bag: true,
            is_open: AtomicBool::new(true),
            bytes: AtomicU64::new(0),
            messages: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
            account: Arc::clone(account),
            error: Mutex::new(None),
            is_abandoned: Stop::default(),
            ended: Stop::default(),
        }
    }

    /// Directory of the bag.
    pub(super) fn directory(&self) -> &Path {
        &self.directory
    }

    /// Queues a message and counts the older ones that are dropped for it.
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

    /// Accepts no more messages; queued ones are still written.
    pub(super) fn close(&self) {
        self.is_open.store(false, Ordering::Relaxed);
        self.queue.close();
    }

    /// Accepts no more messages, and drops and counts the queued ones.
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
        self.account.count_dropped(num);
    }

    /// Counts written messages as dropped, because they are in no file.
    pub(super) fn take_back(&self, num: u64) {
        let before = self.messages.fetch_sub(num, Ordering::Relaxed);
        debug_assert!(before >= num, "{num} of {before} messages");
        self.count_dropped(num);
    }

    pub(super) fn set_bytes(&self, bytes: u64) {
        self.bytes.store(bytes, Ordering::Relaxed);
    }

    /// Logs an error, and keeps the first one for the status.
    pub(super) fn fail(&self, error: &RecordingError) {
        tracing::error!("{error}");
        self.note_failure(error);
    }

    /// Keeps the first error for the status, and counts the failed recording once.
    pub(super) fn note_failure(&self, error: &RecordingError) {
        let kept = &mut *lock(&self.error);
        if kept.is_none() {
            let text = error.to_string();
            self.account.count_failure(&text);
            *kept = Some(text);
        }
    }

    /// True if it failed.
    pub(super) fn has_failed(&self) -> bool {
        lock(&self.error).is_some()
    }

    /// Makes the writer drop the queued messages and close the bag.
    pub(super) fn abandon_queue(&self) {
        self.is_abandoned.raise();
    }

    pub(super) fn is_queue_abandoned(&self) -> bool {
        self.is_abandoned.is_raised()
    }

    /// Marks the bag as closed.
    pub(super) fn end(&self) {
        self.close();
        self.ended.raise();
    }

    /// Waits until the bag is closed. Returns false after a timeout.
    pub(super) fn wait(&self, duration: Duration) -> bool {
        self.ended.wait(duration)
    }

    pub(super) fn is_open(&self) -> bool {
        self.is_open.load(Ordering::Relaxed)
    }

    /// Number of dropped messages of this recording.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Number of messages in the bag.
    pub(super) fn messages(&self) -> u64 {
        self.messages.load(Ordering::Relaxed)
    }

    pub(super) fn status(&self) -> BagStatus {
        let is_recording = self.is_open();
        BagStatus {
            is_recording,
            is_ending: !is_recording && !self.ended.is_raised(),
            directory: self.has_bag.then(|| self.directory.clone()),
            bytes: self.bytes.load(Ordering::Relaxed),
            messages: self.messages(),
            dropped: self.account.dropped(),
            last_error: lock(&self.error).clone(),
        }
    }
}
