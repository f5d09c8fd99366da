//! The commands, one verb a file.

pub mod info;
pub mod recover;

use std::io;

/// How a command ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All is done. Exit code 0.
    Done,
    /// Done, but data was lost or rejected. Exit code 3.
    DataLost,
}

/// A reader that goes away, as `| head` does, has seen enough.
pub(crate) fn quiet_pipe(printed: io::Result<()>) -> io::Result<()> {
    match printed {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        printed => printed,
    }
}
