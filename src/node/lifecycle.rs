//! A managed node: a lifecycle manager configures, activates, deactivates, cleans up and shuts it down.
//!
//! [`machine`] defines the states and transitions, [`server`] lets the program and the network change the state, and
//! [`Managed`] defines the callbacks.

pub(crate) mod machine;
pub(crate) mod server;
#[cfg(test)]
mod tests;

use thiserror::Error;

/// The reason that a callback failed. Nothing changed: the node returns to the previous state.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub(crate) struct Failure(pub(crate) String);

/// Callbacks of a node for its state changes. One callback runs at a time.
pub(crate) trait Managed: Send + Sync {
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
}
