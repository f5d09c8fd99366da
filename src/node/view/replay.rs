//! The view of a recording.

use std::{
    sync::{Arc, mpsc},
    thread::{self, JoinHandle},
    time::Duration,
};

use thiserror::Error;

use crate::{
    bag::{BagReader, Topic},
    foxglove::{PlaybackStatus, Server, Settings, ViewError},
    node::{
        input::InputError,
        parameter_server::{OnChange, ParameterStore},
        replay::{Replay, ReplayError, ReplayRequest},
        stop::Stop,
        topics::Output,
    },
    ros::{node_params::NodeParams, parameters::Parameters},
};

use super::{
    Images, ViewRequest,
    camera::CameraView,
    desk::NodeDesk,
    lanes::Camera,
    playback::{Order, Playback, lock},
    player::{PlayError, Player},
    recording::Passed,
};

/// Timeout for the player's reply to new parameters.
const REPLY_TIMEOUT: Duration = Duration::from_secs(5);

/// Error of the view of a recording.
#[derive(Debug, Error)]
pub(crate) enum ReplayViewError {
    /// The recording or the parameters are invalid.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The server failed.
    #[error(transparent)]
    View(#[from] ViewError),
    /// Several recordings were given; they have no common time line.
    #[error("--view shows one recording, but {0} were given")]
    Several(usize),
    /// The recording holds no messages.
    #[error("{0} holds no messages: there is nothing to show")]
    Empty(String),
    /// The image topics exist but hold no readable frame.
    #[error("no frame could be read from {0}")]
    NoFrames(String),
    /// The player's thread cannot be started.
    #[error("--view: {0}")]
    Thread(#[source] std::io::Error),
}

impl ReplayViewError {
    /// True if the request is wrong.
    pub(crate) const fn is_usage(&self) -> bool {
        match self {
            Self::Replay(error) => error.is_usage(),
            Self::View(error) => error.is_usage(),
            Self::Several(_) => true,
            Self::Empty(_) | Self::NoFrames(_) | Self::Thread(_) => false,
        }
    }
}

/// Behavior of the view at the end of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AtEnd {
    /// The view stays open, and viewers may play again.
    Stay,
    /// The view plays at once, with or without viewers, and ends with the recording.
    Exit,
}

/// A recording that is being shown.
pub(crate) struct ReplayView {
    server: Arc<Server>,
    player: JoinHandle<Result<(), PlayError>>,
}

impl ReplayView {
    /// Serves a recording and plays it from its beginning: at once for [`AtEnd::Exit`], else when the first viewer
    /// connects. Without images, the recorded messages are shown but nothing is measured.
    ///
    /// # Errors
    /// The recording, the parameters or the names are invalid, the recording is empty or not the only one, or the
    /// server or a thread cannot start.
    pub(crate) fn start(
        request: ReplayRequest,
        view: &ViewRequest,
        at_end: AtEnd,
        stop: Stop,
    ) -> Result<Self, ReplayViewError> {
        let speed = request.rate.unwrap_or(1.0) as f32;
        let paths: Vec<_> = request.bags.iter().map(|bag| bag.display().to_string()).collect();
        let (mut replay, values) = Replay::open(request)?;
        let [bag] = replay.bags() else { return Err(ReplayViewError::Several(paths.len())) };
        let range_ns = bag.time_range_ns().ok_or_else(|| ReplayViewError::Empty(paths.join("")))?;
        let notes = bag.notes().join("\n");
        let unmeasured = unmeasured(replay.measure_by(&values))?;
        let desk = Arc::new(NodeDesk::default());
        let name = replay.names().fully_qualified();
        let settings = Settings { name, time_range_ns: Some(range_ns.clone()) };
        let handler = Arc::clone(&desk);
        let server = Arc::new(Server::start(&view.entrance, &settings, handler)?);
        let cameras = cameras(&server, &replay, &values, view.images)?;
        let own = |name: &str| {
            cameras.iter().any(|camera| camera.publishes(name))
                || replay.image_topics().any(|images| images.name == name)
        };
        let passed = Passed::open(&server, &replay.bags()[0], view.images, own)?;
        let (playback, orders, shown) = Playback::new(range_ns.clone(), speed);
        let store = ParameterStore::new(values, on_change(&playback)).map_err(ReplayError::from)?;
        let is_uncalibrated = !cameras.iter().any(|camera| camera.has(Output::Profile));
        warn(&server, "recording", &notes);
        if let Some(why) = unmeasured {
            warn(&server, "images", &why);
        } else if is_uncalibrated {
            let why = "no calibration_file: centrelines only, no profile, points or height map";
            warn(&server, "calibration", why);
        }
        let has_begun = at_end == AtEnd::Exit;
        if has_begun {
            lock(&shown).status = PlaybackStatus::Playing;
        }
        let ends = has_begun;
        let player = Player {
            replay,
            server: Arc::clone(&server),
            cameras,
            passed,
            orders,
            shown,
            range_ns,
            stop,
            ends,
            has_begun,
            pending: None,
        };
        desk.set_parameters_of(Arc::new(store));
        desk.set_playback(playback);
        let thread = thread::Builder::new().name("view player".to_owned());
        let player = thread.spawn(move || player.run()).map_err(ReplayViewError::Thread)?;
        Ok(Self { server, player })
    }

    /// Address of the server.
    pub(crate) fn address(&self) -> std::net::SocketAddr {
        self.server.address()
    }

    /// True if the player has ended.
    pub(crate) fn is_finished(&self) -> bool {
        self.player.is_finished()
    }

    /// Waits for the end of playback. Returns the number of messages sent to viewers.
    ///
    /// # Errors
    /// Measuring or serving failed, or no frame could be read.
    pub(crate) fn join(self) -> Result<u64, ReplayViewError> {
        let played = self.player.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        played.map_err(|error| match error {
            PlayError::Replay(error) => ReplayViewError::Replay(error),
            PlayError::View(error) => ReplayViewError::View(error),
            PlayError::NoFrames(topics) => ReplayViewError::NoFrames(topics),
        })?;
        Ok(self.server.num_sent())
    }
}

fn warn(server: &Server, key: &str, text: &str) {
    if !text.is_empty() {
        text.lines().for_each(|line| tracing::warn!("{line}"));
        server.note(key, text);
    }
}

/// Returns the reason that nothing is measured if the recording holds no images; other errors are passed on.
fn unmeasured(chosen: Result<(), ReplayError>) -> Result<Option<String>, ReplayError> {
    match chosen {
        Ok(()) => Ok(None),
        Err(error @ ReplayError::Input { source: InputError::NoImages(_), .. }) => {
            Ok(Some(format!("{error}; its messages are shown, but nothing is measured")))
        }
        Err(error) => Err(error),
    }
}

fn cameras(
    server: &Server,
    replay: &Replay,
    values: &Parameters,
    images: Images,
) -> Result<Vec<Camera>, ReplayViewError> {
    let params = NodeParams::new(values).map_err(ReplayError::from)?.cameras;
    let mut cameras = Vec::new();
    for stage in replay.stages()? {
        let limit = params.iter().find(|camera| camera.name == stage.camera);
        let limit = limit.map_or(0, |camera| camera.max_frame_bytes);
        let (names, camera) = (replay.names(), &stage.camera);
        let pictures = CameraView::open(server, names, camera, limit, images)?;
        if let Some(topic) = recorded(replay, &stage.images.name) {
            pictures.serve_full(server, topic)?;
        }
        let mut camera = Camera::new(Arc::new(pictures));
        camera.serve(server, &stage)?;
        cameras.push(camera);
    }
    Ok(cameras)
}

fn recorded<'a>(replay: &'a Replay, name: &str) -> Option<&'a Topic> {
    let mut topics = replay.bags().iter().flat_map(BagReader::topics);
    topics.find(|topic| topic.name == name).map(|topic| &**topic)
}

/// Returns a callback that passes changed parameters to the player.
fn on_change(playback: &Playback) -> OnChange {
    let orders = playback.orders();
    Box::new(move |_, values| {
        let (reply, answer) = mpsc::sync_channel(1);
        let ended = |_| "the view has ended".to_owned();
        orders.send(Order::Set(Box::new(values.clone()), reply)).map_err(ended)?;
        match answer.recv_timeout(REPLY_TIMEOUT) {
            Ok(set) => set,
            Err(_late) => Err("the player is busy: try again".to_owned()),
        }
    })
}
