//! The recorder as a sink, and the handle that starts, stops and queries it.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use jiff::Timestamp;

use crate::{
    bag::{SplitRecorder, Topic},
    node::{
        recording::Description,
        sink::{Outgoing, Sink, SinkError},
        watch::Watch,
    },
};

use super::{
    account::Account,
    error::RecordingError,
    lock,
    params::RecordingParams,
    place::{self, BagName},
    session::Session,
    snapshot::{self, Snapshots},
    status::{BagStatus, RecordingStatus},
    tap::{Stream, Tap, Tapped},
    writer::{self, Settings},
};

/// Time that a command waits for a bag to close before it reports that closing continues.
const STOP_WAIT: Duration = Duration::from_secs(2);
/// Time at shutdown after which messages that still wait for a slow disk are dropped.
const DRAIN_WAIT: Duration = Duration::from_secs(1);
/// Additional time at shutdown for writing the indexes.
const INDEX_WAIT: Duration = Duration::from_millis(700);

/// Recorded topics, each with the number that its messages carry ([`Outgoing::topic`]).
#[derive(Clone, Debug, Default)]
pub struct RecordedTopics {
    /// Results that the node publishes.
    pub results: Vec<(usize, Topic)>,
    /// The raw images.
    pub images: Vec<(usize, Topic)>,
}

/// A sink that records on command. Writing to it never blocks and never fails: a slow or failing disk affects only the
/// recording.
pub struct LiveRecorder {
    pub(super) shared: Arc<RecorderState>,
    places: BTreeMap<usize, (Stream, usize)>,
}

/// Starts and stops recordings and reports their status. Clones control the same recorder.
#[derive(Clone)]
pub struct RecordingControl(Arc<RecorderState>);

pub(super) struct RecorderState {
    pub(super) camera: String,
    topics: [Vec<Topic>; 2],
    pub(super) settings: Arc<Settings>,
    pub(super) tap: Mutex<Tap>,
    /// Serializes the commands.
    orders: Mutex<()>,
    pub(super) recordings: Mutex<[Recording; 2]>,
    /// Serializes the snapshots, which do not wait for other commands.
    pub(super) snapshot_orders: Mutex<()>,
    pub(super) snapshots: Mutex<Snapshots>,
}

/// Recording state of a stream.
#[derive(Default)]
pub(super) struct Recording {
    /// The current recording, or the last one.
    pub(super) session: Option<Arc<Session>>,
    pub(super) account: Arc<Account>,
}

impl LiveRecorder {
    /// Returns an idle recorder and its handle. The camera's name becomes part of the bag names; it is empty for the
    /// only camera.
    pub fn new(
        camera: &str,
        topics: RecordedTopics,
        params: RecordingParams,
        description: Description,
    ) -> (Self, RecordingControl) {
        let mut places = BTreeMap::new();
        let mut of_stream = |stream: Stream, topics: Vec<(usize, Topic)>| -> Vec<Topic> {
            let known = topics.into_iter().enumerate().map(|(place, (index, topic))| {
                places.insert(index, (stream, place));
                topic
            });
            known.collect()
        };
        let topics =
            [of_stream(Stream::Results, topics.results), of_stream(Stream::Images, topics.images)];
        let shared = Arc::new(RecorderState {
            camera: camera.to_owned(),
            tap: Mutex::new(Tap::new([&topics[0], &topics[1]])),
            topics,
            settings: Arc::new(Settings {
                params: Mutex::new(RecordingParams::default()),
                description: Mutex::new(Arc::new(description)),
                watch: Mutex::default(),
            }),
            orders: Mutex::new(()),
            recordings: Mutex::default(),
            snapshot_orders: Mutex::new(()),
            snapshots: Mutex::default(),
        });
        let control = RecordingControl(Arc::clone(&shared));
        control.set_params(params);
        (Self { shared, places }, control)
    }
}

impl LiveRecorder {
    /// Notes panics of the threads that write.
    #[must_use]
    pub(crate) fn watched_by(self, watch: &Watch) -> Self {
        watch.clone_into(&mut lock(&self.shared.settings.watch));
        self
    }
}

/// Closes the bags, even if the worker that owns the recorder panicked.
impl Drop for LiveRecorder {
    fn drop(&mut self) {
        if thread::panicking()
            && let Err(error) = self.shared.end()
        {
            tracing::error!("{error}");
        }
    }
}

impl Sink for LiveRecorder {
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        if let Some(&(stream, place)) = self.places.get(&message.topic) {
            let tapped = Tapped { stream, place, message: message.clone() };
            lock(&self.shared.tap).take(Instant::now(), tapped);
        }
        Ok(())
    }

    /// Closes every bag within two seconds. Messages that a slow disk has not taken by then are dropped and counted.
    fn finish(&mut self) -> Result<(), SinkError> {
        let sink_error =
            |error: RecordingError| SinkError { sink: "recording".into(), source: error.into() };
        self.shared.end().map_err(sink_error)
    }
}

impl RecordingControl {
    /// Starts recording: a bag for the results and, with [`RecordingParams::images`], one for the images. A running
    /// recording continues, so this can be called again if one of the two failed. Returns all directories.
    ///
    /// # Errors
    /// There is too little free space, or writing fails. Returns the first error; the other stream may have started.
    pub fn start(&self) -> Result<Vec<PathBuf>, RecordingError> {
        let _one_at_a_time = lock(&self.0.orders);
        let params = lock(&self.0.settings.params).clone();
        let base = place::name(&self.0.camera, Timestamp::now());
        let is_wanted = |stream: &Stream| {
            *stream == Stream::Results
                || params.images && !self.0.topics[Stream::Images as usize].is_empty()
        };
        let wanted = Stream::ALL.into_iter().filter(is_wanted);
        let started: Vec<_> = wanted.map(|stream| self.0.begin(stream, &params, &base)).collect();
        started.into_iter().collect()
    }

    /// Stops the running recordings; they hold the messages sent before. Returns their final status; empty if none was
    /// running.
    ///
    /// # Errors
    /// A bag is not closed after two seconds because its disk is slow; closing continues.
    pub fn stop(&self) -> Result<Vec<BagStatus>, RecordingError> {
        let _one_at_a_time = lock(&self.0.orders);
        final_statuses(&self.0.close_all())
    }

    /// Stops those of the running recordings that are in `directories`, as [`Self::start`] returned them, and waits for
    /// those of them that others have stopped. Returns their status; an older one may be no longer known.
    ///
    /// # Errors
    /// As of [`Self::stop`].
    pub(crate) fn stop_in(
        &self,
        directories: &[PathBuf],
    ) -> Result<Vec<BagStatus>, RecordingError> {
        let _one_at_a_time = lock(&self.0.orders);
        let sessions = self.0.sessions_in(directories);
        for (stream, session) in &sessions {
            if session.is_open() {
                lock(&self.0.tap).end(*stream);
                session.close();
            }
        }
        let sessions: Vec<_> = sessions.into_iter().map(|(_, session)| session).collect();
        final_statuses(&sessions)
    }

    /// Writes the last seconds into bags of their own, with or without a running recording. Returns at once; the status
    /// reports when the bags are complete.
    ///
    /// # Errors
    /// The snapshot buffer is off or empty, the previous snapshot is still being written, there is too little free
    /// space, or writing fails.
    pub(crate) fn snapshot(&self) -> Result<Vec<PathBuf>, RecordingError> {
        snapshot::take(&self.0)
    }

    /// Returns the status. Never waits for a disk.
    pub(crate) fn status(&self) -> RecordingStatus {
        let (mut failures, snapshot) = {
            let snapshots = lock(&self.0.snapshots);
            (snapshots.failures(), snapshots.status())
        };
        let recordings = lock(&self.0.recordings);
        recordings.iter().for_each(|recording| failures.add(&recording.account.failures()));
        let [results, images] = recordings.each_ref().map(Recording::status);
        RecordingStatus { results, images, snapshot, failures }
    }

    /// Changes the parameters; [`RecordingParams`] states when each takes effect.
    pub(crate) fn set_params(&self, params: RecordingParams) {
        lock(&self.0.tap).set_params(&params);
        *lock(&self.0.settings.params) = params;
    }

    /// Changes the description of the bags, for example after parameters were set. Running recordings receive another
    /// metadata record within half a second. The hash in
    /// [`Centerline::method`](crate::msg::laser_profiler_msgs::Centerline) identifies the record that belongs to a
    /// result; readers that need a single record use the last one.
    pub(crate) fn describe(&self, description: Description) {
        *lock(&self.0.settings.description) = Arc::new(description);
    }
}

impl RecorderState {
    /// Creates a bag for a stream.
    pub(super) fn create(
        &self,
        stream: Stream,
        params: &RecordingParams,
        base: &str,
    ) -> Result<SplitRecorder, RecordingError> {
        let compression = match stream {
            Stream::Results => params.compression,
            Stream::Images => params.image_compression,
        };
        let topics = &self.topics[stream as usize];
        let name = BagName { base, suffix: stream.suffix() };
        place::create(params, name, compression, topics)
    }

    /// Starts recording a stream unless it is being recorded. Returns the directory.
    fn begin(
        &self,
        stream: Stream,
        params: &RecordingParams,
        base: &str,
    ) -> Result<PathBuf, RecordingError> {
        let current = lock(&self.recordings)[stream as usize].session.clone();
        if let Some(session) = current.filter(|session| session.is_open()) {
            return Ok(session.directory().into());
        }
        self.open_session(stream, params, base)
            .inspect_err(|error| self.note_failed_start(stream, error))
    }

    /// From now on, counts the messages that the recording should have.
    fn note_failed_start(&self, stream: Stream, error: &RecordingError) {
        let recording = &mut lock(&self.recordings)[stream as usize];
        let failed = Arc::new(Session::failed(error, &recording.account));
        lock(&self.tap).begin(stream, Arc::clone(&failed));
        recording.session = Some(failed);
    }

    fn open_session(
        &self,
        stream: Stream,
        params: &RecordingParams,
        base: &str,
    ) -> Result<PathBuf, RecordingError> {
        let bag = self.create(stream, params, base)?;
        let directory = bag.directory().to_owned();
        let account = Arc::clone(&lock(&self.recordings)[stream as usize].account);
        let session = Arc::new(Session::new(&directory, params.queue_bytes, &account));
        let latched = lock(&self.tap).begin(stream, Arc::clone(&session));
        let started = writer::start(bag, &session, &self.settings, &latched);
        if started.is_err() {
            lock(&self.tap).end(stream);
            session.end();
        }
        started?;
        tracing::info!("recording into {}", directory.display());
        lock(&self.recordings)[stream as usize].session = Some(session);
        Ok(directory)
    }

    /// Returns the last recordings that are in these directories.
    fn sessions_in(&self, directories: &[PathBuf]) -> Vec<(Stream, Arc<Session>)> {
        let recordings = lock(&self.recordings);
        let last = Stream::ALL.into_iter().filter_map(|stream| {
            recordings[stream as usize].session.clone().map(|session| (stream, session))
        });
        last.filter(|(_, session)| directories.iter().any(|it| it == session.directory())).collect()
    }

    /// Stops passing messages to the recordings. Returns those that were running.
    fn close_all(&self) -> Vec<Arc<Session>> {
        let ended = Stream::ALL.map(|stream| lock(&self.tap).end(stream));
        ended.into_iter().flatten().inspect(|session| session.close()).collect()
    }

    fn end(&self) -> Result<(), RecordingError> {
        self.close_all();
        let deadline = Instant::now() + DRAIN_WAIT;
        let mut sessions = lock(&self.snapshots).sessions().to_vec();
        sessions.extend(lock(&self.recordings).iter().filter_map(|known| known.session.clone()));
        if wait(&sessions, deadline).is_err() {
            for session in &sessions {
                session.abandon_queue();
            }
        }
        let closed = wait(&sessions, deadline + INDEX_WAIT);
        for session in sessions.iter().filter(|session| !session.wait(Duration::ZERO)) {
            session.note_failure(&RecordingError::StillWriting(session.directory().into()));
        }
        closed
    }
}

/// Waits until all bags are closed, at most [`STOP_WAIT`], and returns their status.
fn final_statuses(sessions: &[Arc<Session>]) -> Result<Vec<BagStatus>, RecordingError> {
    wait(sessions, Instant::now() + STOP_WAIT)?;
    Ok(sessions.iter().map(|session| session.status()).collect())
}

/// Waits until all bags are closed.
fn wait(sessions: &[Arc<Session>], deadline: Instant) -> Result<(), RecordingError> {
    for session in sessions {
        if !session.wait(deadline.saturating_duration_since(Instant::now())) {
            return Err(RecordingError::StillWriting(session.directory().into()));
        }
    }
    Ok(())
}

impl Recording {
    fn status(&self) -> BagStatus {
        self.session.as_ref().map_or_else(BagStatus::default, |session| session.status())
    }
}
