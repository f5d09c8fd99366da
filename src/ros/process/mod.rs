//! The middleware in a process of its own.
//!
//! A middleware parses whatever the network sends. In a process of its own, a panic, a dead thread, a hang or unbounded
//! memory costs the node nothing but a gap in its messages: [`RemoteTransport`] watches the process, replaces it within
//! a second, and offers the node's endpoints again. The next process joins as a new participant, so peers see the node
//! leave and return, and latched topics deliver their last messages once more.
//!
//! `host` is the process's side, `remote` and `supervisor` are the node's. Between them, `wire` frames messages on
//! pipes: JSON for what `orders` lists, CDR bytes as they are.

use std::sync::{Mutex, MutexGuard, PoisonError};

mod wire;
mod outbox;
mod orders;
mod calls;
pub(crate) mod host;
pub(crate) mod log;
mod registry;
pub(crate) mod link;
mod events;
mod supervisor;
pub(crate) mod remote;

/// Locks a mutex whose data are valid after every statement.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads a pipe in both directions, as far as it is valid.
#[cfg(fuzzing)]
pub(crate) fn fuzz(data: &[u8]) {
    fn read_all<Header: serde::de::DeserializeOwned>(mut pipe: &[u8]) {
        while let Ok(Some(frame)) = wire::read::<Header>(&mut pipe) {
            drop(frame);
        }
    }
    read_all::<orders::Order>(data);
    read_all::<orders::Event>(data);
}
