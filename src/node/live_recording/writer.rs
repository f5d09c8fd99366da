//! The thread of one recording. It writes the queued messages, and twice a second flushes, checks the free space and
//! updates the description.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use jiff::Timestamp;

use crate::{
    bag::{MetadataRecord, RecordError, SplitRecorder, Times},
    node::{queue::Popped, recording::Description, watch::Watch},
};

use super::{
    error::RecordingError, lock, params::RecordingParams, session::Session, space::Space,
    sync::Syncer, tap::Tapped,
};

/// Period of flushing to the operating system, with or without messages. It is half the maximum age of messages that a
/// crash may lose, 1 s.
const TICK: Duration = Duration::from_millis(500);
/// Ticks between syncs to the disk, which take place every 5 s.
const TICKS_PER_SYNC: u32 = 10;

/// Settings that may change during a recording.
pub(super) struct Settings {
    pub(super) params: Mutex<RecordingParams>,
    pub(super) description: Mutex<Arc<Description>>,
    /// Notes panics of the threads that write.
    pub(super) watch: Mutex<Watch>,
}

/// A bag being written.
struct BagWriter {
    bag: SplitRecorder,
    session: Arc<Session>,
    settings: Arc<Settings>,
    description: Arc<Description>,
    syncer: Syncer,
    num_ticks: u32,
    space: Space,
    /// Messages since the last flush: they may be in no file if writing fails.
    num_unflushed: u64,
    has_refused: bool,
}

/// Writes the description of a new bag and starts the thread that writes its messages.
///
/// # Errors
/// Writing fails, or a thread cannot be started.
pub(super) fn start(
    mut bag: SplitRecorder,
    session: &Arc<Session>,
    settings: &Arc<Settings>,
    latched: &[Tapped],
) -> Result<(), RecordingError> {
    for Tapped { place, message, .. } in latched {
        bag.set_latched(*place, Times::from(message), &message.data);
    }
    let system = |source| RecordingError::System { directory: session.directory().into(), source };
    let watch = lock(&settings.watch).clone();
    let syncer = Syncer::start(watch.clone()).map_err(system)?;
    let description = Arc::clone(&lock(&settings.description));
    describe(&mut bag, &description)?;
    // The description is readable even if the process dies in the first second.
    bag.flush()?;
    session.set_bytes(bag.written_bytes());
    let writer = BagWriter {
        bag,
        session: Arc::clone(session),
        settings: Arc::clone(settings),
        description,
        syncer,
        num_ticks: 0,
        space: Space::default(),
        num_unflushed: 0,
        has_refused: false,
    };
    let thread = thread::Builder::new().name("recording".to_owned());
    let run = move || {
        let _guard = watch.guard("the thread that records");
        writer.run();
    };
    thread.spawn(run).map(drop).map_err(system)
}

fn describe(bag: &mut SplitRecorder, description: &Description) -> Result<(), RecordError> {
    let now_ns = i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(0);
    bag.describe(description.record(), description.calibration_file(now_ns.max(0)))
}

/// Ends the session, even after a panic, so that no thread waits for a terminated writer.
pub(super) struct EndOnDrop(pub(super) Arc<Session>);

impl Drop for EndOnDrop {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.fail(&RecordingError::Panicked(self.0.directory().into()));
        }
        self.0.close_and_drop();
        self.0.end();
    }
}

impl BagWriter {
    fn run(mut self) {
        let session = Arc::clone(&self.session);
        let _ended = EndOnDrop(Arc::clone(&session));
        let recorded = self.record();
        // Before the session closes: whoever sees that the recording has ended also sees why.
        if let Err(error) = &recorded {
            session.fail(error);
        }
        session.close_and_drop();
        let (directory, num_unflushed) = (session.directory(), self.num_unflushed);
        if let Err(error) = self.finish(&recorded) {
            session.take_back(num_unflushed);
            // An error of `finish` after an error of `record` is the same disk error again.
            if recorded.is_ok() {
                session.fail(&error.into());
            }
        }
        if session.has_failed() && !directory.exists() {
            session.take_back(session.messages());
        }
    }

    /// Writes until the queue is closed and empty.
    fn record(&mut self) -> Result<(), RecordingError> {
        let mut next_tick = Instant::now() + TICK;
        loop {
            match self.session.pop_until(next_tick) {
                Popped::Item(tapped, _) => self.write(&tapped)?,
                Popped::TimedOut => {}
                Popped::Closed => return Ok(()),
            }
            if self.session.is_queue_abandoned() {
                return Ok(());
            }
            if Instant::now() >= next_tick {
                self.tick()?;
                next_tick = Instant::now() + TICK;
            }
        }
    }

    fn write(&mut self, Tapped { place, message, .. }: &Tapped) -> Result<(), RecordingError> {
        if !self.space.take(message.data.len()) {
            let checked = self.flush().and_then(|()| self.check_space(message.data.len()));
            checked.inspect_err(|_| self.session.count_dropped(1))?;
        }
        match self.bag.write(*place, Times::from(message), &message.data) {
            Ok(()) => {
                self.session.count_written();
                self.num_unflushed += 1;
            }
            Err(error @ RecordError::NegativeTime { .. }) => {
                self.session.count_dropped(1);
                if !self.has_refused {
                    tracing::warn!(
                        "{error}; the message was dropped; further ones are only counted"
                    );
                }
                self.has_refused = true;
            }
            Err(error) => {
                self.session.count_dropped(1);
                return Err(error.into());
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        self.bag.flush()?;
        self.num_unflushed = 0;
        self.session.set_bytes(self.bag.written_bytes());
        Ok(())
    }

    fn tick(&mut self) -> Result<(), RecordingError> {
        self.bag.set_limits(lock(&self.settings.params).split_limits());
        self.update_description()?;
        self.flush()?;
        self.check_space(0)?;
        self.num_ticks += 1;
        if self.num_ticks.is_multiple_of(TICKS_PER_SYNC)
            && let Some(file) = self.bag.sync_handle()?
        {
            self.syncer.sync(file);
        }
        match self.syncer.take_fault() {
            Some(source) => Err(self.system_error(source)),
            None => Ok(()),
        }
    }

    fn update_description(&mut self) -> Result<(), RecordError> {
        let description = Arc::clone(&lock(&self.settings.description));
        if Arc::ptr_eq(&description, &self.description) {
            return Ok(());
        }
        self.description = description;
        describe(&mut self.bag, &self.description)
    }

    /// Checks that a message of `bytes` bytes leaves the space that must stay free.
    fn check_space(&mut self, bytes: usize) -> Result<(), RecordingError> {
        let min_free_bytes = lock(&self.settings.params).min_free_bytes;
        self.space.check(self.bag.directory(), min_free_bytes, self.bag.closing_bytes(), bytes)
    }

    fn system_error(&self, source: std::io::Error) -> RecordingError {
        RecordingError::System { directory: self.bag.directory().into(), source }
    }

    /// Records in the bag how the recording ended, closes the bag and logs the counts.
    fn finish(mut self, recorded: &Result<(), RecordingError>) -> Result<(), RecordError> {
        self.update_description()?;
        let ended = recorded.as_ref().map_or_else(ToString::to_string, |()| "as asked".to_owned());
        let entries = [
            ("messages", self.session.messages().to_string()),
            ("dropped", self.session.dropped().to_string()),
            ("ended", ended),
        ];
        let entries = BTreeMap::from(entries.map(|(key, value)| (key.to_owned(), value)));
        self.bag.metadata(&MetadataRecord { name: "laser_profiler_end".to_owned(), entries })?;
        let file = self.bag.sync_handle()?;
        let summary = self.bag.finish()?;
        self.session.set_bytes(summary.bytes);
        if let Some(file) = file {
            self.syncer.sync(file);
        }
        tracing::info!(
            "{}: {} messages recorded, {} dropped",
            summary.directory.display(),
            self.session.messages(),
            self.session.dropped()
        );
        Ok(())
    }
}
