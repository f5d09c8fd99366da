//! A bounded queue of frames in front of a pipe. What may be lost makes room when the reader is slow.

use std::{
    collections::VecDeque,
    io::Write,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
};

use serde::Serialize;

use super::wire::{self, Payload, WireError};

/// Payload that may wait, bytes. A single larger message may wait, too.
const MAX_WAITING_BYTES: usize = 64 << 20;
/// Largest number of frames that may wait without a payload limit: requests, answers, log lines.
const MAX_WAITING: usize = 100_000;

/// Treatment of a frame while the queue is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A message: the oldest makes room.
    Message,
    /// Anything else: stays.
    Control,
}

struct Waiting<Header> {
    frames: VecDeque<(Kind, Header, Payload)>,
    num_bytes: usize,
    is_closed: bool,
}

/// The queue.
pub(super) struct Outbox<Header> {
    waiting: Mutex<Waiting<Header>>,
    changed: Condvar,
}

impl<Header> Default for Outbox<Header> {
    fn default() -> Self {
        let waiting = Waiting { frames: VecDeque::new(), num_bytes: 0, is_closed: false };
        Self { waiting: Mutex::new(waiting), changed: Condvar::new() }
    }
}

impl<Header> Outbox<Header> {
    fn lock(&self) -> MutexGuard<'_, Waiting<Header>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a frame, unless the queue is closed. Returns the headers of the messages that made room.
    pub(super) fn push(&self, kind: Kind, header: Header, payload: Payload) -> Vec<Header> {
        let mut waiting = self.lock();
        if waiting.is_closed {
            return Vec::new();
        }
        let num_bytes = payload.bytes().len();
        // What must stay needs no room of messages.
        let is_message = kind == Kind::Message;
        let dropped = if is_message { waiting.make_room(num_bytes) } else { Vec::new() };
        waiting.num_bytes += num_bytes;
        waiting.frames.push_back((kind, header, payload));
        drop(waiting);
        self.changed.notify_one();
        dropped
    }

    /// Closes the queue: frames that wait are still written, new ones are ignored.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_one();
    }

    /// Waits for the next frame; `None` once the queue is closed and empty.
    fn take(&self) -> Option<(Header, Payload)> {
        let is_idle =
            |waiting: &mut Waiting<Header>| waiting.frames.is_empty() && !waiting.is_closed;
        let waiting = self.changed.wait_while(self.lock(), is_idle);
        let mut waiting = waiting.unwrap_or_else(PoisonError::into_inner);
        let (_, header, payload) = waiting.frames.pop_front()?;
        waiting.num_bytes -= payload.bytes().len();
        Some((header, payload))
    }
}

impl<Header: Serialize> Outbox<Header> {
    /// Writes all frames until the queue is closed. Closes it if the pipe breaks.
    pub(super) fn write_to(&self, mut pipe: impl Write) -> Result<(), WireError> {
        while let Some((header, payload)) = self.take() {
            if let Err(error) = wire::write(&mut pipe, &header, &payload) {
                self.close();
                return Err(error);
            }
        }
        Ok(())
    }
}

impl<Header> Waiting<Header> {
    fn make_room(&mut self, num_bytes: usize) -> Vec<Header> {
        let mut dropped = Vec::new();
        let is_full = |waiting: &Self| {
            let is_large = num_bytes > 0 && waiting.num_bytes + num_bytes > MAX_WAITING_BYTES;
            is_large || waiting.frames.len() >= MAX_WAITING
        };
        while is_full(self) {
            let oldest = self.frames.iter().position(|(kind, _, _)| *kind == Kind::Message);
            let Some((_, header, payload)) = oldest.and_then(|at| self.frames.remove(at)) else {
                break;
            };
            self.num_bytes -= payload.bytes().len();
            dropped.push(header);
        }
        dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(num_bytes: usize) -> Payload {
        Payload::Owned(vec![0; num_bytes])
    }

    #[test]
    fn the_oldest_messages_make_room_and_nothing_else_does() {
        let outbox = Outbox::default();
        let half = MAX_WAITING_BYTES / 2;
        assert!(outbox.push(Kind::Message, 1, message(half)).is_empty());
        assert!(outbox.push(Kind::Control, 2, message(half)).is_empty());
        assert_eq!(outbox.push(Kind::Message, 3, message(half)), [1]);
        assert_eq!(outbox.push(Kind::Message, 4, message(half)), [3]);
        outbox.close();
        let left: Vec<_> = std::iter::from_fn(|| outbox.take()).map(|(header, _)| header).collect();
        assert_eq!(left, [2, 4]);
    }

    #[test]
    fn a_message_above_the_bound_passes_alone() {
        let outbox = Outbox::default();
        outbox.push(Kind::Message, 1, message(1));
        assert_eq!(outbox.push(Kind::Message, 2, message(MAX_WAITING_BYTES + 1)), [1]);
        outbox.push(Kind::Message, 3, Payload::None);
        outbox.push(Kind::Control, 4, message(1));
        outbox.close();
        let left: Vec<_> = std::iter::from_fn(|| outbox.take()).map(|(header, _)| header).collect();
        assert_eq!(left, [2, 3, 4], "what takes no room drops nothing");
    }

    #[test]
    fn a_broken_pipe_closes_the_queue() {
        struct Broken;
        impl Write for Broken {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let outbox = Outbox::default();
        outbox.push(Kind::Control, 1, Payload::None);
        assert!(outbox.write_to(Broken).is_err());
        outbox.push(Kind::Control, 2, Payload::None);
        assert!(outbox.take().is_none());
    }
}
