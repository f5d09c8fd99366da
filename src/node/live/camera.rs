//! One camera: its queue, its worker's thread, and its subscription while the node is active.

use std::{
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::feed;
use crate::{
    bag::Topic,
    node::{
        command::{Answer, Command, Mailbox, Reply, Settings},
        queue::{Queue, WhenFull},
        run::{self, INPUT_BOUND, RunError},
        sink::Outlet,
        source::Input,
        statistics::Summary,
        worker::{
            Worker,
            live::{Live, Notes, NowNs},
        },
    },
    ros::transport::{Subscription, TopicEndpoint, Transport, TransportError},
};

/// How long a service waits for a camera to do what it is asked for.
const PATIENCE: Duration = Duration::from_secs(1);

/// Where a camera's images come from.
pub(super) struct Images {
    /// The middleware.
    pub(super) transport: Arc<dyn Transport>,
    /// Their topic.
    pub(super) endpoint: TopicEndpoint,
    /// Largest message accepted, bytes.
    pub(super) limit_bytes: usize,
    /// The subscription, while the node is active.
    subscription: Mutex<Option<Box<dyn Subscription>>>,
}

impl Images {
    pub(super) fn new(
        transport: Arc<dyn Transport>,
        endpoint: TopicEndpoint,
        limit_bytes: usize,
    ) -> Self {
        Self { transport, endpoint, limit_bytes, subscription: Mutex::new(None) }
    }

    /// Publishers that reach the camera now; `None`: it does not listen.
    pub(super) fn num_publishers(&self) -> Option<usize> {
        self.lock().as_ref().map(|subscription| subscription.num_matched())
    }

    fn lock(&self) -> MutexGuard<'_, Option<Box<dyn Subscription>>> {
        self.subscription.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A camera that is configured. Clones speak to the same one.
#[derive(Clone)]
pub(super) struct Camera {
    /// Its name among several; empty: the only one.
    pub(super) name: String,
    /// Frame of its profiles; empty without a calibration.
    pub(super) frame_id: String,
    images: Arc<Images>,
    input: Arc<Queue<Input>>,
    settings: Arc<Mailbox<Settings>>,
}

/// The thread of a camera's worker.
pub(super) type Measuring = JoinHandle<Result<Summary, RunError>>;

impl Camera {
    /// Starts the worker; images come only after [`listen`](Self::listen).
    pub(super) fn start(
        (name, frame_id): (&str, String),
        images: Arc<Images>,
        worker: Worker,
        (now_ns, notes): (NowNs, Notes),
        outlets: Vec<Outlet>,
        num_topics: usize,
    ) -> io::Result<(Self, Measuring)> {
        let input = Arc::new(Queue::new(INPUT_BOUND, WhenFull::DropOldest));
        let settings = Arc::new(Mailbox::default());
        let worker = worker.with_live(Live::new(Arc::clone(&settings), now_ns, notes));
        let taken = Arc::clone(&input);
        let thread = thread::Builder::new()
            .name(format!("camera {name}"))
            .spawn(move || measure(worker, &taken, outlets, num_topics))?;
        Ok((Self { name: name.to_owned(), frame_id, images, input, settings }, thread))
    }

    /// Subscribes to the images.
    pub(super) fn listen(&self) -> Result<(), TransportError> {
        let Images { transport, endpoint, limit_bytes, .. } = &*self.images;
        let topic = Topic::new(endpoint.name.as_str(), endpoint.kind, endpoint.qos);
        let on_image = feed::on_image(Arc::clone(&self.input), Arc::new(topic));
        let subscription = transport.subscribe(endpoint, *limit_bytes, on_image)?;
        *self.images.lock() = Some(subscription);
        Ok(())
    }

    /// Ends the subscription, and the scan behind the images that came before.
    pub(super) fn stop_listening(&self) {
        if self.images.lock().take().is_some() {
            // A closed queue: the worker has ended, and its scan with it.
            drop(self.input.push(Input::NewRecording, 0));
        }
    }

    /// What comes next does not go on from what came before.
    pub(super) fn begin_session(&self) {
        // A closed queue: the worker has ended.
        drop(self.input.push_urgent(Input::NewRecording));
    }

    /// Measures by these from the next frame on.
    pub(super) fn set(&self, settings: Settings) {
        self.settings.put(settings);
    }

    /// Has the worker carry out a command; `None`: it has not answered within a second.
    pub(super) fn order(&self, command: impl FnOnce(Reply) -> Command) -> Option<Answer> {
        let (reply, answer) = mpsc::sync_channel(1);
        self.input.push_urgent(Input::Command(command(reply))).ok()?;
        answer.recv_timeout(PATIENCE).ok()
    }

    /// Takes no more; what came is still measured.
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
    // The middleware gives a new buffer with every message: spare ones would lie about.
    let spare = Queue::new(INPUT_BOUND, WhenFull::DropOldest);
    spare.close();
    let (counts, stages) = run::work(worker, input, &spare, outlets, num_topics)?;
    Ok(Summary { counts, stages, elapsed: started.elapsed(), ..Summary::default() })
}
