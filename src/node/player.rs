//! Plays recordings as a source, one after another, at full speed or at a given rate.

use std::{collections::VecDeque, time::Instant};

use crate::bag::{BagError, Messages, RawMessage, player::Pacer};

use super::{
    source::{Input, PublisherId, Source},
    stop::Stop,
};

/// A player of recordings.
pub(crate) struct BagPlayer {
    /// Remaining recordings; the first one is being played.
    recordings: VecDeque<Messages>,
    /// Pacer and rate relative to the recorded speed; `None`: as fast as messages are consumed.
    pacer: Option<(Pacer, f64)>,
    clock: Instant,
    stop: Stop,
}

impl BagPlayer {
    /// Creates a player of these recordings, in order. `stop` interrupts its waits.
    ///
    /// # Errors
    /// The rate is not a positive number.
    pub(crate) fn new(
        recordings: impl IntoIterator<Item = Messages>,
        rate: Option<f64>,
        stop: Stop,
    ) -> Result<Self, crate::bag::player::RateError> {
        let pacer = rate.map(|rate| Ok((Pacer::new(rate)?, rate))).transpose()?;
        let recordings = recordings.into_iter().collect();
        Ok(Self { recordings, pacer, clock: Instant::now(), stop })
    }

    fn wait_for(&mut self, message: &RawMessage) {
        if let Some((pacer, _)) = &mut self.pacer {
            let now_ns = i64::try_from(self.clock.elapsed().as_nanos()).unwrap_or(i64::MAX);
            if let Some(wait) = pacer.wait(message.log_time_ns, now_ns) {
                self.stop.wait(wait);
            }
        }
    }
}

impl Source for BagPlayer {
    fn next(&mut self) -> Option<Input> {
        loop {
            match self.recordings.front_mut()?.next() {
                Some(Ok(message)) => {
                    self.wait_for(&message);
                    return Some(Input::Message(message, PublisherId::default()));
                }
                Some(Err(BagError::Picture { path, why })) => {
                    // The path depends on the machine, and reasons are part of the results.
                    let name = path.file_name().unwrap_or(path.as_os_str()).display();
                    return Some(Input::Fault(format!("{name}: {why}")));
                }
                Some(Err(error)) if error.is_loss() => {
                    return Some(Input::Damage(error.to_string()));
                }
                Some(Err(error)) => tracing::warn!("{error}"),
                None => {
                    self.recordings.pop_front();
                    if let Some((pacer, rate)) = &mut self.pacer {
                        // The same rate was accepted by `new`.
                        *pacer = Pacer::new(*rate).ok()?;
                    }
                    if !self.recordings.is_empty() {
                        return Some(Input::NewRecording);
                    }
                }
            }
        }
    }

    fn recycle(&mut self, buffer: Vec<u8>) {
        if let Some(recording) = self.recordings.front_mut() {
            recording.recycle(buffer);
        }
    }
}
