//! The start of a stream: the first frames of a calibrated camera wait for its first `camera_info`, so that the verdict on
//! them does not depend on which message comes first.

use std::{collections::VecDeque, time::Duration};

use super::{Held, Now, PublishError, Publisher, Queue, Worker};

/// Longest wait for the first `camera_info`; it covers slow discovery of a second topic.
const TIMEOUT: Duration = Duration::from_millis(500);
/// Maximum number of waiting frames.
const MAX_FRAMES: usize = 32;
/// Maximum size of waiting frames, bytes.
const MAX_BYTES: usize = 256 << 20;

/// The frames that wait for the first description of their camera.
#[derive(Default)]
pub(super) struct Opening {
    held: VecDeque<Held>,
    is_over: bool,
}

impl Opening {
    /// Number of waiting frames.
    pub(super) fn len(&self) -> usize {
        self.held.len()
    }

    fn is_full(&self) -> bool {
        self.held.len() >= MAX_FRAMES
            || self.held.iter().map(Held::num_bytes).sum::<usize>() >= MAX_BYTES
    }

    /// True if the first frame must not wait any longer.
    fn is_given_up(&self, now: Now) -> bool {
        let waited = self.held.front().map(|first| first.waited(now));
        waited.is_some_and(|waited| waited.is_none_or(|waited| waited > TIMEOUT))
    }
}

impl Worker {
    /// True while frames wait for a description of the camera.
    pub(super) fn is_opening(&self) -> bool {
        let describes = self.online.is_some() || self.framing.topic.is_some();
        !self.opening.is_over && describes && self.framing.is_calibrated()
    }

    /// Forgets the descriptions of the last recording: the first frames of the next one wait for their own. Call it after
    /// the waiting frames are released and the scan has ended.
    pub(super) fn reopen(&mut self) {
        self.opening = Opening::default();
        if let Some(calibration) = self.framing.restart() {
            self.measurer.pipeline.recalibrate(calibration);
        }
    }

    /// Queues one of the first frames.
    pub(super) fn hold_opening(
        &mut self,
        held: Held,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let received_ns = held.received_ns;
        self.opening.held.push_back(held);
        self.release_opening(Now::Received(received_ns), spare, out)
    }

    /// Measures the first frames once their camera is described, or they cannot wait any longer.
    pub(super) fn release_opening(
        &mut self,
        now: Now,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let is_described = match &self.online {
            Some(online) => online.is_described(),
            None => self.framing.is_described(),
        };
        let may_go = is_described || self.opening.is_full() || self.opening.is_given_up(now);
        if !(self.is_opening() && may_go) {
            return Ok(());
        }
        self.opening.is_over = true;
        for held in std::mem::take(&mut self.opening.held) {
            self.take_in_order(held.arrival, held.num_dropped, spare, out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A command or new parameters may come before the first frame.
    #[test]
    fn an_end_without_waiting_frames_gives_nothing_up() {
        assert!(!Opening::default().is_given_up(Now::End));
    }
}
