//! The thread of one recording: writes what waits, and twice a second sees to flush, space and what explains the bag.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use jiff::Timestamp;

use crate::{
    bag::{MetadataRecord, RecordError, SplitRecorder, Times},
    node::{queue::Popped, recording::Description},
};

use super::{
    error::RecordingError, lock, params::RecordingParams, place, session::Session, sync::Syncer,
    tap::Tapped,
};

/// So often all is handed to the operating system, messages or not: half of the second after which nothing may be lost.
const TICK: Duration = Duration::from_millis(500);
/// So often the disk is asked to have it: every 5 s.
const TICKS_PER_SYNC: u32 = 10;
/// A fast stream has the free space looked at more often.
const SPACE_CHECK_BYTES: u64 = 8 << 20;

/// Settings that may change during a recording.
pub(super) struct Settings {
    pub(super) params: Mutex<RecordingParams>,
    pub(super) description: Mutex<Arc<Description>>,
}

/// A bag being written.
struct BagWriter {
    bag: SplitRecorder,
    session: Arc<Session>,
    settings: Arc<Settings>,
    explained: Arc<Description>,
    syncer: Syncer,
    num_ticks: u32,
    next_check_bytes: u64,
    has_refused: bool,
}

/// Explains a new bag, and starts the thread that writes it.
///
/// # Errors
/// A failing disk; no thread to be had.
pub(super) fn start(
    mut bag: SplitRecorder,
    session: &Arc<Session>,
    settings: &Arc<Settings>,
    latched: &[Tapped],
) -> Result<(), RecordingError> {
    for Tapped { place, message, .. } in latched {
        bag.remember(*place, Times::from(message), &message.data);
    }
    let system = |source| RecordingError::System { directory: session.directory().into(), source };
    let syncer = Syncer::start().map_err(system)?;
    let explained = Arc::clone(&lock(&settings.description));
    explain(&mut bag, &explained)?;
    // What a run was is known even when it ends in its first second.
    bag.flush()?;
    session.set_bytes(bag.written_bytes());
    let writer = BagWriter {
        bag,
        session: Arc::clone(session),
        settings: Arc::clone(settings),
        explained,
        syncer,
        num_ticks: 0,
        next_check_bytes: SPACE_CHECK_BYTES,
        has_refused: false,
    };
    let thread = thread::Builder::new().name("recording".to_owned());
    thread.spawn(move || writer.run()).map(drop).map_err(system)
}

fn explain(bag: &mut SplitRecorder, description: &Description) -> Result<(), RecordError> {
    let now_ns = i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(0);
    bag.explain(description.record(), description.calibration_file(now_ns.max(0)))
}

/// Closes the queue, even after a panic, so that no thread waits for a terminated writer.
struct EndOnDrop(Arc<Session>);

impl Drop for EndOnDrop {
    fn drop(&mut self) {
        self.0.end();
    }
}

impl BagWriter {
    fn run(mut self) {
        let session = Arc::clone(&self.session);
        let _ended = EndOnDrop(Arc::clone(&session));
        let recorded = self.record();
        session.close_and_drop();
        if let Err(error) = &recorded {
            session.fail(error);
        }
        let finished = self.finish(&recorded);
        // The disk error was reported before and occurs again.
        if let (Ok(()), Err(error)) = (recorded, finished) {
            session.fail(&error.into());
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
            if self.session.is_in_a_hurry() {
                return Ok(());
            }
            if Instant::now() >= next_tick {
                self.tick()?;
                next_tick = Instant::now() + TICK;
            }
        }
    }

    fn write(&mut self, Tapped { place, message, .. }: &Tapped) -> Result<(), RecordingError> {
        match self.bag.write(*place, Times::from(message), &message.data) {
            Ok(()) => self.session.count_written(),
            Err(error @ RecordError::NegativeTime { .. }) => {
                self.session.count_dropped(1);
                if !self.has_refused {
                    tracing::warn!("{error}; it is not recorded, later ones are only counted");
                }
                self.has_refused = true;
            }
            Err(error) => {
                self.session.count_dropped(1);
                return Err(error.into());
            }
        }
        if self.bag.written_bytes() >= self.next_check_bytes {
            self.check_space()?;
        }
        Ok(())
    }

    fn tick(&mut self) -> Result<(), RecordingError> {
        self.bag.set_limits(lock(&self.settings.params).split_limits());
        self.explain_changes()?;
        self.bag.flush()?;
        self.check_space()?;
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

    fn explain_changes(&mut self) -> Result<(), RecordError> {
        let description = Arc::clone(&lock(&self.settings.description));
        if Arc::ptr_eq(&description, &self.explained) {
            return Ok(());
        }
        self.explained = description;
        explain(&mut self.bag, &self.explained)
    }

    fn check_space(&mut self) -> Result<(), RecordingError> {
        let written_bytes = self.bag.written_bytes();
        self.session.set_bytes(written_bytes);
        self.next_check_bytes = written_bytes + SPACE_CHECK_BYTES;
        let min_free_bytes = lock(&self.settings.params).min_free_bytes;
        place::require_space(self.bag.directory(), min_free_bytes)
    }

    fn system_error(&self, source: std::io::Error) -> RecordingError {
        RecordingError::System { directory: self.bag.directory().into(), source }
    }

    /// Says how the recording ended, in the bag too, and closes it.
    fn finish(mut self, recorded: &Result<(), RecordingError>) -> Result<(), RecordError> {
        self.explain_changes()?;
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
