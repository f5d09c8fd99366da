//! Threads with names, as `top -H` and profilers show them.

use std::thread::{Builder, Scope, ScopedJoinHandle};

/// Starts a thread whose name has at most 15 bytes, which is what Linux shows.
///
/// # Panics
/// The system starts no more threads, as [`Scope::spawn`] does.
pub(super) fn spawn<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    work: impl FnOnce() -> T + Send + 'scope,
) -> ScopedJoinHandle<'scope, T> {
    let builder = Builder::new().name(name.to_owned());
    builder.spawn_scoped(scope, work).expect("the system starts another thread")
}
