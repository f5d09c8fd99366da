//! Where images come from: the seam at which a recording, DDS or Zenoh is plugged in.

use crate::bag::RawMessage;

/// What a source has to say.
#[derive(Debug)]
pub enum Input {
    /// The next image message.
    Message(RawMessage),
    /// What follows was recorded on another occasion: stamps and counters may start anew.
    NewRecording,
    /// A part of the input is unreadable; the rest goes on.
    Damage(String),
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
