//! Plays a recording to viewers at any speed and from any time, measured with the parameters that they set.
//!
//! A seek creates new workers without history. The first frame after it therefore depends only on the recording and
//! the parameters, not on what was played before.

use std::{
    ops::RangeInclusive,
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use crate::{
    bag::{BagReader, player::Pacer},
    foxglove::{PlaybackStatus, Server, ViewError},
    node::{
        fan_out::FanOut,
        replay::{Replay, ReplayError, Stage},
        stop::Stop,
    },
    ros::parameters::Parameters,
};

use super::{
    camera::PREVIEW_GAP,
    lanes::{Camera, Lane, Lanes},
    playback::{Order, Shown, lock},
    recording::{Passed, Reader, last_time_ns},
};

/// Maximum time between checks for a stop request.
const IDLE: Duration = Duration::from_millis(50);
/// Time before and after a shown frame within which messages may belong to it, nanoseconds: positions, and frames of
/// other cameras. Without cameras, the time before a seek target from which messages are shown.
const AROUND_NS: i64 = 500_000_000;
/// Pause before the first message after a seek. Viewers clear their display when they receive the seek notification,
/// which new messages must not overtake.
const JUMP_PAUSE: Duration = Duration::from_millis(20);
/// Maximum time between subscriptions that are answered together.
const TOGETHER: Duration = Duration::from_millis(10);
/// Minimum period between time messages.
const TIME_GAP: Duration = Duration::from_millis(20);

/// A player. It ends when the order queue is closed, when a stop is requested or, if `ends`, with the recording.
pub(super) struct Player {
    pub(super) replay: Replay,
    pub(super) server: Arc<Server>,
    pub(super) cameras: Vec<Camera>,
    pub(super) passed: Passed,
    pub(super) orders: Receiver<Order>,
    pub(super) shown: Arc<Mutex<Shown>>,
    pub(super) range_ns: RangeInclusive<i64>,
    pub(super) stop: Stop,
    /// True if the player ends with the recording.
    pub(super) ends: bool,
    /// True if playback was started or controlled before, so that a new viewer does not start it.
    pub(super) has_begun: bool,
    /// An order that arrived while subscriptions were collected.
    pub(super) pending: Option<Order>,
}

/// The action after a part of the recording was played.
enum Next {
    /// Plays from that log time on, nanoseconds since the epoch.
    From(i64),
    /// Ends the player.
    End,
}

/// A part of the recording that is being played.
struct Act<'a> {
    lanes: Lanes<'a>,
    reader: Reader,
    pacer: Option<Pacer>,
    clock: Instant,
    time_sent: Instant,
}

impl Player {
    /// Plays until the player ends.
    ///
    /// # Errors
    /// Measuring or serving failed.
    pub(super) fn run(mut self) -> Result<(), PlayError> {
        let mut from_ns = *self.range_ns.start();
        while let Next::From(next_ns) = self.play_from(from_ns)? {
            from_ns = next_ns;
        }
        Ok(())
    }

    fn play_from(&mut self, from_ns: i64) -> Result<Next, PlayError> {
        let stages = self.replay.stages()?;
        for (camera, stage) in self.cameras.iter_mut().zip(&stages) {
            camera.serve(&self.server, stage)?;
        }
        thread::scope(|scope| {
            let fan_out = |(camera, stage): (&Camera, &Stage)| {
                FanOut::start(scope, vec![camera.outlet()], stage.topics.len())
            };
            let fan_outs: Vec<_> = self.cameras.iter().zip(&stages).map(fan_out).collect();
            let cameras = self.cameras.iter().zip(&fan_outs);
            let lane = |(stage, (camera, fan_out))| Lane::new(stage, camera, fan_out);
            let lanes = Lanes::new(stages.into_iter().zip(cameras).map(lane).collect());
            let before_ns = if lanes.is_empty() || lanes.has_side_topics() { AROUND_NS } else { 0 };
            let topics: Vec<_> = self.topics().collect();
            let reader = Reader::new(self.bag(), &topics, from_ns.saturating_sub(before_ns));
            let (clock, time_sent) = (Instant::now(), Instant::now());
            let mut act = Act { lanes, reader, pacer: None, clock, time_sent };
            if !self.show_frame(&mut act, from_ns) {
                return self.last_frame(from_ns);
            }
            Ok(self.play(&mut act))
        })
    }

    fn bag(&self) -> &BagReader {
        // A player is created only for a single recording.
        &self.replay.bags()[0]
    }

    fn topics(&self) -> impl Iterator<Item = String> {
        let measured = self.replay.image_topics().map(|topic| topic.name.clone());
        let side = self.replay.side_topics();
        measured.chain(side).chain(self.passed.topics().cloned())
    }

    /// Shows the first frame at or after a time and the messages that belong to it; without cameras, the messages up to
    /// that time. Returns false if there are cameras but no such frame.
    fn show_frame(&self, act: &mut Act<'_>, from_ns: i64) -> bool {
        let mut has_frame = act.lanes.is_empty();
        while let Some(next) = act.reader.peek() {
            let time_ns = next.log_time_ns;
            if act.lanes.is_empty() && time_ns > from_ns {
                break;
            }
            let is_image = act.lanes.is_image(&next.topic.name);
            if time_ns >= from_ns || act.lanes.is_empty() {
                self.show_next(act, Duration::ZERO);
                if is_image {
                    has_frame = true;
                    break;
                }
            } else if let Some(message) = act.reader.take() {
                act.lanes.take_side(&message);
            }
        }
        if act.lanes.is_empty() {
            lock(&self.shown).time_ns = from_ns;
        }
        self.show_related(act);
        let shown = *lock(&self.shown);
        self.server.publish_time(shown.time_ns);
        self.server.publish_playback(&shown.state());
        has_frame
    }

    /// Shows a frame of every other camera and, since a frame may wait for a later position, the messages up to the
    /// next frame; at most [`AROUND_NS`] after the first frame.
    fn show_related(&self, act: &mut Act<'_>) {
        let time_ns = lock(&self.shown).time_ns;
        let until_ns = time_ns.saturating_add(AROUND_NS);
        while let Some(next) = act.reader.peek() {
            let has_images = act.lanes.have_images();
            let is_enough = has_images
                && (act.lanes.is_image(&next.topic.name) || !act.lanes.has_side_topics());
            if is_enough || next.log_time_ns > until_ns {
                break;
            }
            self.show_next(act, Duration::ZERO);
        }
        // A refresh starts at the same frame.
        lock(&self.shown).time_ns = time_ns;
    }

    /// Returns to the last frame if there is no frame at or after the requested time.
    fn last_frame(&self, from_ns: i64) -> Result<Next, PlayError> {
        let images: Vec<_> = self.replay.image_topics().map(|topic| topic.name.clone()).collect();
        match last_time_ns(self.bag(), &images) {
            Some(last_ns) if last_ns < from_ns => Ok(Next::From(last_ns)),
            _ => Err(PlayError::NoFrames(images.join(", "))),
        }
    }

    /// Shows the next message; images at least `min_gap` apart.
    fn show_next(&self, act: &mut Act<'_>, min_gap: Duration) {
        let Some(message) = act.reader.take() else { return };
        let time_ns = message.log_time_ns;
        self.passed.pass(&message);
        act.lanes.take_side(&message);
        if act.lanes.is_empty() || act.lanes.is_image(&message.topic.name) {
            lock(&self.shown).time_ns = time_ns;
            act.lanes.take_image(message, min_gap);
        }
        if act.time_sent.elapsed() >= TIME_GAP {
            act.time_sent = Instant::now();
            self.server.publish_time(time_ns);
        }
    }

    fn play(&mut self, act: &mut Act<'_>) -> Next {
        self.set_pace(act);
        while !self.stop.is_raised() {
            let wait = Self::wait(act);
            match self.next_order(wait.unwrap_or_default().min(IDLE)) {
                Ok(order) => {
                    if let Some(from_ns) = self.execute(order, act) {
                        return Next::From(from_ns);
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return Next::End,
                Err(RecvTimeoutError::Timeout) if wait.is_some() => {}
                Err(RecvTimeoutError::Timeout) => self.show_next(act, PREVIEW_GAP),
            }
            if self.is_playing() && act.reader.peek().is_none() {
                self.end(act);
                if self.ends {
                    return Next::End;
                }
            }
        }
        Next::End
    }

    fn next_order(&mut self, timeout: Duration) -> Result<Order, RecvTimeoutError> {
        match self.pending.take() {
            Some(order) => Ok(order),
            None => self.orders.recv_timeout(timeout),
        }
    }

    /// Collects further subscriptions: a viewer that opens a layout subscribes to a dozen topics at once, and one
    /// refresh serves all of them.
    fn collect_refreshes(&mut self) {
        while let Ok(order) = self.orders.recv_timeout(TOGETHER) {
            if !matches!(order, Order::Refresh) {
                self.pending = Some(order);
                return;
            }
        }
    }

    /// Returns the time until the next message is due; `None` if it is due now. [`IDLE`] while paused or at the end.
    fn wait(act: &mut Act<'_>) -> Option<Duration> {
        let (Some(pacer), Some(next)) = (&mut act.pacer, act.reader.peek()) else {
            return Some(IDLE);
        };
        let now_ns = i64::try_from(act.clock.elapsed().as_nanos()).unwrap_or(i64::MAX);
        pacer.wait(next.log_time_ns, now_ns)
    }

    fn is_playing(&self) -> bool {
        lock(&self.shown).status == PlaybackStatus::Playing
    }

    /// Starts pacing at the chosen speed from the shown time, or stops pacing unless playing.
    fn set_pace(&self, act: &mut Act<'_>) {
        let Shown { status, time_ns, speed } = *lock(&self.shown);
        act.pacer = match status {
            PlaybackStatus::Playing => Pacer::new(f64::from(speed)).ok(),
            _ => None,
        };
        if let Some(pacer) = &mut act.pacer {
            let now_ns = i64::try_from(act.clock.elapsed().as_nanos()).unwrap_or(i64::MAX);
            _ = pacer.wait(time_ns, now_ns);
        }
    }

    /// Executes an order. Returns the log time from which to restart playback, if needed.
    fn execute(&mut self, order: Order, act: &mut Act<'_>) -> Option<i64> {
        match order {
            Order::Control { status, speed, seek_ns } => {
                self.has_begun = true;
                {
                    let shown = &mut *lock(&self.shown);
                    (shown.status, shown.speed) = (status, speed);
                }
                self.set_pace(act);
                seek_ns.inspect(|_| thread::sleep(JUMP_PAUSE))
            }
            Order::Begin => {
                if !std::mem::replace(&mut self.has_begun, true) {
                    lock(&self.shown).status = PlaybackStatus::Playing;
                    self.set_pace(act);
                }
                self.server.publish_playback(&lock(&self.shown).state());
                None
            }
            Order::Refresh => {
                self.collect_refreshes();
                let Shown { status, time_ns, .. } = *lock(&self.shown);
                (status != PlaybackStatus::Playing).then_some(time_ns)
            }
            Order::Set(values, reply) => {
                let set = self.measure_by(&values);
                let is_set = set.is_ok();
                // The requester may have timed out.
                drop(reply.try_send(set));
                is_set.then(|| lock(&self.shown).time_ns)
            }
        }
    }

    fn measure_by(&mut self, values: &Parameters) -> Result<(), String> {
        if self.cameras.is_empty() {
            return Err("the recording holds no images, so nothing is measured".to_owned());
        }
        self.replay.measure_by(values).map_err(|error| error.to_string())
    }

    /// Ends playback after the last message: ends open scans and publishes the state.
    fn end(&self, act: &mut Act<'_>) {
        act.lanes.finish();
        act.pacer = None;
        let mut shown = lock(&self.shown);
        shown.status = PlaybackStatus::Ended;
        self.server.publish_time(shown.time_ns);
        self.server.publish_playback(&shown.state());
    }
}

/// Error of playing a recording.
#[derive(Debug, thiserror::Error)]
pub(super) enum PlayError {
    /// The recording can no longer be measured with the current parameters, for example because a file has changed.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// A topic cannot be served.
    #[error(transparent)]
    View(#[from] ViewError),
    /// The image topics exist but hold no readable frame.
    #[error("no frame could be read from {0}")]
    NoFrames(String),
}
