//! Creates named threads; `top -H` and profilers show the names.

use std::thread::{Builder, Scope, ScopedJoinHandle};

/// Starts a thread. Its name has at most 15 bytes, the maximum that Linux shows.
///
/// # Panics
/// The system cannot start a thread, as with [`Scope::spawn`].
pub(super) fn spawn<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    work: impl FnOnce() -> T + Send + 'scope,
) -> ScopedJoinHandle<'scope, T> {
    let builder = Builder::new().name(name.to_owned());
    builder.spawn_scoped(scope, work).expect("the system starts another thread")
}
