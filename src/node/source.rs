//! Where images come from: the seam at which a recording, DDS or Zenoh is plugged in.

use crate::bag::RawMessage;

use super::{command::Command, unpack::Ahead};

/// Which of the publishers that were seen on the topic wrote a message, counted from 0: each counts its own messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PublisherId(pub u32);

/// What a source has to say.
#[derive(Debug)]
pub enum Input {
    /// The next image message.
    Message(RawMessage, PublisherId),
    /// The next image message, whose picture is being unpacked by another thread.
    Ahead(Ahead),
    /// The next message about the axis.
    Position(RawMessage),
    /// Messages about the axis have come: see [`Inbox`](super::positions::inbox::Inbox).
    Positions,
    /// A message arrived that the middleware could not hand on: it is counted as a malformed frame.
    Fault(String),
    /// What follows was recorded on another occasion: stamps and counters may start anew.
    NewRecording,
    /// A part of the input is unreadable; the rest goes on.
    Damage(String),
    /// What somebody asks of the node.
    Command(Command),
}

/// A stream of messages of one image topic: raw CDR bytes, their times and their counter.
pub trait Source {
    /// Waits for what comes next. `None`: nothing will.
    fn next(&mut self) -> Option<Input>;

    /// Takes back the memory of a message that is done with.
    fn recycle(&mut self, buffer: Vec<u8>) {
        drop(buffer);
    }
}
