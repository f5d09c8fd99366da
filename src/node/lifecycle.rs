//! A managed node: a lifecycle manager configures, activates, deactivates, cleans up and shuts it down.
//!
//! [`machine`] defines the states and transitions, [`server`] lets the program and the network change the state, and
//! [`Managed`] defines the callbacks.

pub mod machine;
pub mod server;
#[cfg(test)]
mod tests;

use thiserror::Error;

/// The reason that a callback failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Failure {
    /// Nothing changed: the node returns to the previous state.
    #[error("{0}")]
    Refused(String),
    /// The action is incomplete: [`Managed::recover`] runs, and the node becomes unconfigured or ends.
    #[error("{0}")]
    Broken(String),
}

impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Self::Refused(reason)
    }
}

/// Callbacks of a node for its state changes. One callback runs at a time.
pub trait Managed: Send + Sync {
    /// Acquires resources: parameters, calibration, publishers.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn configure(&self) -> Result<(), Failure>;

    /// Starts working.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn activate(&self) -> Result<(), Failure>;

    /// Stops working and keeps the resources.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn deactivate(&self) -> Result<(), Failure>;

    /// Releases the resources.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn cleanup(&self) -> Result<(), Failure>;

    /// Shuts down from any state: stops working and releases the resources.
    ///
    /// # Errors
    /// Data was lost, with a description. The node ends anyway.
    fn shutdown(&self) -> Result<(), Failure>;

    /// Releases the resources after a [`Failure::Broken`].
    ///
    /// # Errors
    /// Recovery failed; the node ends.
    fn recover(&self) -> Result<(), Failure>;
}
