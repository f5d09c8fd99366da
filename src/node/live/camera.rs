//! One camera: its queue, its worker's thread, and its subscription while the node is active.

use std::{
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::{feed, observer::Observer};
use crate::{
    bag::Topic,
    msg::qos::Durability,
    node::{
        board::Board,
        clock::RosClock,
        command::{Answer, Command, Mailbox, Reply, Settings},
        live_recording::RecordingControl,
        positions::inbox::Inbox,
        queue::{Queue, WhenFull},
        recording::Description,
        run::{self, INPUT_BOUND, RunError},
        sink::Outlet,
        source::Input,
        statistics::Summary,
        watch::Watch,
        worker::{
            Worker,
            online::{Online, Survey},
        },
    },
    ros::transport::{Subscription, TopicEndpoint, Transport, TransportError},
};

/// Time that a service waits for a camera to carry out a command.
pub(super) const REPLY_TIMEOUT: Duration = Duration::from_secs(1);

/// Maximum size of a `camera_info` message, bytes: distortion models have few coefficients.
const INFO_LIMIT_BYTES: usize = 64 << 10;
/// Maximum size of a position message, bytes: robots have some hundred joints and frames.
const POSITION_LIMIT_BYTES: usize = 1 << 20;

/// Sources of a camera's images.
pub(super) struct Images {
    /// The middleware.
    pub(super) transport: Arc<dyn Transport>,
    /// Their topic.
    pub(super) endpoint: TopicEndpoint,
    /// Largest message accepted, bytes.
    pub(super) limit_bytes: usize,
    /// The topic of the camera's descriptions.
    pub(super) info: TopicEndpoint,
    /// Observes images and descriptions.
    pub(super) observer: Observer,
    /// The topics with the positions of images.
    pub(super) positions: Vec<TopicEndpoint>,
    /// Messages received on them.
    pub(super) inbox: Arc<Inbox>,
    /// Present while the node is active.
    subscriptions: Mutex<Option<Subscriptions>>,
}

/// The subscriptions of a camera. Images are dropped first, because their metadata may still arrive.
struct Subscriptions {
    images: Box<dyn Subscription>,
    _infos: Box<dyn Subscription>,
    positions: Vec<Box<dyn Subscription>>,
}

impl Images {
    pub(super) fn new(
        transport: Arc<dyn Transport>,
        [endpoint, info]: [TopicEndpoint; 2],
        positions: Vec<TopicEndpoint>,
        limit_bytes: usize,
        observer: Observer,
    ) -> Self {
        let (inbox, subscriptions) = (Arc::default(), Mutex::new(None));
        Self { transport, endpoint, limit_bytes, info, observer, positions, inbox, subscriptions }
    }

    /// Returns the number of matched image publishers; `None` without a subscription.
    pub(super) fn num_publishers(&self) -> Option<usize> {
        self.lock().as_ref().map(|subscriptions| subscriptions.images.num_matched())
    }

    /// Returns the topics about the axis that have no publisher. Static poses need no publisher.
    pub(super) fn unmatched_positions(&self) -> Vec<&TopicEndpoint> {
        let guard = self.lock();
        let Some(Subscriptions { positions, .. }) = &*guard else { return Vec::new() };
        let topics = self.positions.iter().zip(positions);
        let unmatched = topics.filter(|(topic, subscription)| {
            topic.qos.durability != Durability::TransientLocal && subscription.num_matched() == 0
        });
        unmatched.map(|(topic, _)| topic).collect()
    }

    fn lock(&self) -> MutexGuard<'_, Option<Subscriptions>> {
        self.subscriptions.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The identity of a camera, and its recorder.
pub(super) struct Identity {
    /// Its name; empty for the only camera.
    pub(super) name: String,
    /// Frame of its scans; empty without a calibration.
    pub(super) part_frame: String,
    /// Its recorder.
    pub(super) recording: RecordingControl,
    /// Description for its recordings.
    pub(super) description: Description,
}

/// A configured camera. Clones share it.
#[derive(Clone)]
pub(super) struct Camera {
    /// Its name; empty for the only camera.
    pub(super) name: String,
    /// Frame of its scans; empty without a calibration.
    pub(super) part_frame: String,
    /// Its recorder.
    pub(super) recording: RecordingControl,
    /// Description for its recordings, as it was at the start.
    pub(super) description: Description,
    /// Board with the reports of its worker.
    pub(super) board: Board,
    images: Arc<Images>,
    input: Arc<Queue<Input>>,
    settings: Arc<Mailbox<Settings>>,
}

/// A command that was sent to the worker.
pub(super) struct Ordered(mpsc::Receiver<Answer>);

impl Ordered {
    /// Waits for the answer; returns `None` if the worker is busy or has ended.
    pub(super) fn answer(self, deadline: Instant) -> Option<Answer> {
        self.0.recv_timeout(deadline.saturating_duration_since(Instant::now())).ok()
    }
}

/// The clock, the diagnostics and the sinks of a camera's worker.
pub(super) struct Environment {
    pub(super) clock: RosClock,
    pub(super) survey: Box<dyn Survey>,
    pub(super) outlets: Vec<Outlet>,
    /// Topics that the worker publishes on.
    pub(super) num_topics: usize,
    /// Notes a panic of the worker.
    pub(super) watch: Watch,
}

/// The thread of a camera's worker.
pub(super) type Measuring = JoinHandle<Result<Summary, RunError>>;

impl Camera {
    /// Starts the worker; images arrive only after [`listen`](Self::listen).
    pub(super) fn start(
        Identity { name, part_frame, recording, description }: Identity,
        images: Arc<Images>,
        worker: Worker,
        Environment { clock, survey, outlets, num_topics, watch }: Environment,
    ) -> io::Result<(Self, Measuring)> {
        let input = Arc::new(Queue::new(INPUT_BOUND, WhenFull::DropOldest));
        let settings = Arc::new(Mailbox::default());
        let board = Board::default();
        let describe = Box::new(images.observer.clone());
        let online = Online::new(Arc::clone(&settings), clock, survey, describe);
        let online = online.with_board(board.clone());
        let worker = worker.with_online(online).with_inbox(Arc::clone(&images.inbox));
        let taken = Arc::clone(&input);
        let thread_name = format!("camera {name}");
        let watched_name = format!("the worker of camera {name:?}");
        let thread = thread::Builder::new().name(thread_name).spawn(move || {
            let _guard = watch.guard(&watched_name);
            measure(worker, &taken, outlets, num_topics)
        })?;
        let camera =
            Self { name, part_frame, recording, description, board, images, input, settings };
        Ok((camera, thread))
    }

    /// Subscribes to positions and `camera_info`, then to the images.
    pub(super) fn listen(&self) -> Result<(), TransportError> {
        let Images { transport, endpoint, limit_bytes, info, observer, .. } = &*self.images;
        let positions = self.images.positions.iter().map(|endpoint| {
            let topic = Topic::new(endpoint.name.as_str(), endpoint.kind, endpoint.qos);
            let (inbox, queue) = (Arc::clone(&self.images.inbox), Arc::clone(&self.input));
            let on_position = feed::on_position(inbox, queue, Arc::new(topic));
            transport.subscribe(endpoint, POSITION_LIMIT_BYTES, on_position)
        });
        let positions = positions.collect::<Result<_, _>>()?;
        let topic = Topic::new(endpoint.name.as_str(), endpoint.kind, endpoint.qos);
        let on_image = feed::on_image(Arc::clone(&self.input), Arc::new(topic));
        let infos = transport.subscribe(info, INFO_LIMIT_BYTES, observer.on_info())?;
        let images = transport.subscribe(endpoint, *limit_bytes, on_image)?;
        *self.images.lock() = Some(Subscriptions { images, _infos: infos, positions });
        Ok(())
    }

    /// Ends the subscription.
    pub(super) fn stop_listening(&self) {
        drop(self.images.lock().take());
    }

    /// Measures with these settings from the next frame on.
    pub(super) fn set(&self, settings: Settings) {
        self.images.observer.set_direction(settings.params.stripe_direction);
        self.settings.put(settings);
    }

    /// Sends a command to the worker.
    pub(super) fn order(&self, command: impl FnOnce(Reply) -> Command) -> Ordered {
        let (reply, answer) = mpsc::sync_channel(1);
        // If the worker has ended, the reply is dropped, and the answer is `None`.
        drop(self.input.push_urgent(Input::Command(command(reply))));
        Ordered(answer)
    }

    /// Closes the queue for further frames; queued frames are still measured.
    pub(super) fn close(&self) {
        drop(self.images.lock().take());
        self.input.close();
    }
}

fn measure(
    worker: Worker,
    input: &Queue<Input>,
    outlets: Vec<Outlet>,
    num_topics: usize,
) -> Result<Summary, RunError> {
    let started = Instant::now();
    // The middleware allocates a buffer for every message, so spare buffers are useless.
    let spare = Queue::new(INPUT_BOUND, WhenFull::DropOldest);
    spare.close();
    let (counts, stages) = run::work(worker, input, &spare, outlets, num_topics)?;
    Ok(Summary { counts, stages, elapsed: started.elapsed(), ..Summary::default() })
}
