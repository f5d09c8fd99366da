//! Requests of viewers to the player, and the state reported to them.

use std::{
    ops::RangeInclusive,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
    },
};

use crate::{
    foxglove::{PlaybackCommand, PlaybackControlRequest, PlaybackState, PlaybackStatus},
    ros::parameters::Parameters,
};

/// Maximum number of queued orders. Dragging the playback slider sends about sixty per second.
const MAX_WAITING: usize = 256;

/// A request to the player.
pub(super) enum Order {
    /// Plays or pauses at a speed, after a seek to a log time if one is given.
    Control { status: PlaybackStatus, speed: f32, seek_ns: Option<i64> },
    /// Applies new parameters. The reply holds the reason for a refusal.
    Set(Box<Parameters>, SyncSender<Result<(), String>>),
    /// Shows the current frame again, for a new viewer.
    Refresh,
    /// A viewer has connected: starts playback unless it was started before.
    Begin,
}

/// The displayed state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shown {
    /// Playing, paused, or at the end.
    pub(super) status: PlaybackStatus,
    /// Log time of the last frame, nanoseconds since the epoch.
    pub(super) time_ns: i64,
    /// Playback speed relative to the recording.
    pub(super) speed: f32,
}

impl Shown {
    /// Returns the state as reported to viewers.
    pub(super) fn state(self) -> PlaybackState {
        PlaybackState {
            status: self.status,
            current_time: self.time_ns.max(0) as u64,
            playback_speed: self.speed,
            did_seek: false,
            request_id: None,
        }
    }
}

/// The viewers' side of the player.
pub(super) struct Playback {
    orders: SyncSender<Order>,
    shown: Arc<Mutex<Shown>>,
    range_ns: RangeInclusive<i64>,
}

impl Playback {
    /// Returns the viewers' side and the player's side for a recording with these first and last times, nanoseconds
    /// since the epoch.
    pub(super) fn new(
        range_ns: RangeInclusive<i64>,
        speed: f32,
    ) -> (Self, Receiver<Order>, Arc<Mutex<Shown>>) {
        let (sender, orders) = sync_channel(MAX_WAITING);
        let status = PlaybackStatus::Paused;
        let shown = Arc::new(Mutex::new(Shown { status, time_ns: *range_ns.start(), speed }));
        (Self { orders: sender, shown: Arc::clone(&shown), range_ns }, orders, shown)
    }

    /// Returns a sender for orders.
    pub(super) fn orders(&self) -> SyncSender<Order> {
        self.orders.clone()
    }

    /// Passes a request to the player. Returns the resulting state, which the player reaches a moment later.
    pub(super) fn control(&self, request: &PlaybackControlRequest) -> PlaybackState {
        let before = *lock(&self.shown);
        let is_speed = request.playback_speed.is_finite() && request.playback_speed > 0.0;
        let speed = if is_speed { request.playback_speed } else { before.speed };
        let status = match request.playback_command {
            PlaybackCommand::Play => PlaybackStatus::Playing,
            PlaybackCommand::Pause => PlaybackStatus::Paused,
        };
        let (start_ns, end_ns) = self.range_ns.clone().into_inner();
        let requested = request.seek_time.map(|time| i64::try_from(time).unwrap_or(end_ns));
        // Play at the end restarts from the beginning.
        let is_over = before.status == PlaybackStatus::Ended && status == PlaybackStatus::Playing;
        let seek_ns =
            requested.or(is_over.then_some(start_ns)).map(|ns| ns.clamp(start_ns, end_ns));
        if self.orders.try_send(Order::Control { status, speed, seek_ns }).is_err() {
            tracing::debug!("the player's queue is full: a playback request was dropped");
            return before.state();
        }
        let after = Shown { status, speed, time_ns: seek_ns.unwrap_or(before.time_ns) };
        PlaybackState { did_seek: seek_ns.is_some(), ..after.state() }
    }

    /// Starts playback when a viewer connects.
    pub(super) fn on_viewer(&self) {
        self.send(Order::Begin);
    }

    /// Shows the current frame again when a viewer subscribes.
    pub(super) fn on_subscribe(&self) {
        self.send(Order::Refresh);
    }

    /// Sends an order. If the queue is full, the order is dropped: the queued ones refresh the display anyway.
    fn send(&self, order: Order) {
        match self.orders.try_send(order) {
            Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
        }
    }
}

pub(super) fn lock(shown: &Mutex<Shown>) -> MutexGuard<'_, Shown> {
    shown.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(command: PlaybackCommand, speed: f32, seek: Option<u64>) -> PlaybackControlRequest {
        PlaybackControlRequest {
            playback_command: command,
            playback_speed: speed,
            seek_time: seek,
            request_id: "1".to_owned(),
        }
    }

    #[test]
    fn a_seek_outside_the_recording_is_clamped() {
        let (playback, orders, _) = Playback::new(100..=200, 1.0);
        for (requested, expected) in [(0, 100), (150, 150), (u64::MAX, 200)] {
            let state = playback.control(&request(PlaybackCommand::Pause, 2.0, Some(requested)));
            assert!(state.did_seek && state.status == PlaybackStatus::Paused);
            assert_eq!(state.current_time, expected);
            let Ok(Order::Control { seek_ns, .. }) = orders.try_recv() else { panic!("an order") };
            assert_eq!(seek_ns, Some(expected as i64));
        }
    }

    #[test]
    fn an_invalid_speed_changes_nothing() {
        let (playback, _orders, _) = Playback::new(100..=200, 3.0);
        for speed in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let state = playback.control(&request(PlaybackCommand::Play, speed, None));
            assert!((state.playback_speed - 3.0).abs() < f32::EPSILON && !state.did_seek);
        }
    }

    #[test]
    fn play_at_the_end_restarts_from_the_beginning() {
        let (playback, _orders, shown) = Playback::new(100..=200, 1.0);
        *lock(&shown) = Shown { status: PlaybackStatus::Ended, time_ns: 200, speed: 1.0 };
        let state = playback.control(&request(PlaybackCommand::Play, 1.0, None));
        assert_eq!((state.current_time, state.did_seek), (100, true));
        let state = playback.control(&request(PlaybackCommand::Pause, 1.0, None));
        assert_eq!((state.current_time, state.did_seek), (200, false));
    }

    #[test]
    fn orders_to_a_stuck_player_take_bounded_memory() {
        let (playback, _orders, _) = Playback::new(100..=200, 1.0);
        for _ in 0..MAX_WAITING {
            playback.on_subscribe();
        }
        let state = playback.control(&request(PlaybackCommand::Play, 1.0, Some(150)));
        assert_eq!((state.status, state.did_seek), (PlaybackStatus::Paused, false));
    }
}
