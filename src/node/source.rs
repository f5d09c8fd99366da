//! The interface for sources of images: recordings, DDS and Zenoh.

use crate::bag::RawMessage;

use super::{command::Command, unpack::Ahead};

/// Index of a publisher among those seen on the topic, from 0. Each publisher numbers its own messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PublisherId(pub u32);

/// The next item from a source.
#[derive(Debug)]
pub(crate) enum Input {
    /// The next image message.
    Message(RawMessage, PublisherId),
    /// The next image message, which another thread is decompressing.
    Ahead(Ahead),
    /// The next message about the axis.
    Position(RawMessage),
    /// Messages about the axis have arrived: see [`Inbox`](super::positions::inbox::Inbox).
    Positions,
    /// A message that the middleware could not deliver, or a picture that cannot be read; it counts as a malformed frame.
    Fault(String),
    /// Another recording begins: stamps and counters may start again.
    NewRecording,
    /// A part of the input is unreadable; reading continues after it.
    Damage(String),
    /// A command to the worker.
    Command(Command),
}

/// A stream of messages of one image topic: raw CDR bytes, their times and their counter.
pub(crate) trait Source {
    /// Waits for the next item; `None` at the end.
    fn next(&mut self) -> Option<Input>;

    /// Takes back the buffer of a processed message.
    fn recycle(&mut self, buffer: Vec<u8>) {
        drop(buffer);
    }
}
