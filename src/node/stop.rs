//! A stop request that wakes waiting threads.

use std::{
    sync::{Arc, Condvar, Mutex, PoisonError},
    time::Duration,
};

/// A flag that is raised once. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<StopFlag>);

#[derive(Debug, Default)]
struct StopFlag {
    is_raised: Mutex<bool>,
    raised: Condvar,
}

impl Stop {
    /// Raises the flag and wakes all waiting threads.
    pub(crate) fn raise(&self) {
        *self.0.is_raised.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.0.raised.notify_all();
    }

    /// True if the flag was raised.
    pub(crate) fn is_raised(&self) -> bool {
        *self.0.is_raised.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for `duration` or until the flag is raised. Returns true if it is raised.
    pub(crate) fn wait(&self, duration: Duration) -> bool {
        let guard = self.0.is_raised.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.0.raised.wait_timeout_while(guard, duration, |is_raised| !*is_raised);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raising_wakes_a_waiting_thread() {
        let stop = Stop::default();
        assert!(!stop.wait(Duration::ZERO));
        let thread = {
            let stop = stop.clone();
            std::thread::spawn(move || stop.wait(Duration::from_hours(1)))
        };
        stop.raise();
        assert!(thread.join().unwrap());
        assert!(stop.is_raised());
    }
}
