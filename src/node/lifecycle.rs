//! A managed node: it is configured, activated, deactivated, cleaned up and shut down by whoever starts a system.
//!
//! [`machine`] has the states and what leads from one to another; [`server`] lets the program and the network change
//! them; [`Managed`] is what is done then.

pub mod machine;
pub mod server;
#[cfg(test)]
mod tests;

use thiserror::Error;

/// The reason that a callback failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Failure {
    /// All is as it was: the node goes back to the state before.
    #[error("{0}")]
    Refused(String),
    /// Something is half done: [`Managed::recover`] is called, and the node begins anew or ends.
    #[error("{0}")]
    Broken(String),
}

impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Self::Refused(reason)
    }
}

/// Actions of a node when its state changes. One callback runs at a time.
pub trait Managed: Send + Sync {
    /// Takes what it needs: parameters, calibration, publishers.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn configure(&self) -> Result<(), Failure>;

    /// Begins to work.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn activate(&self) -> Result<(), Failure>;

    /// Stops working and keeps what it has.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn deactivate(&self) -> Result<(), Failure>;

    /// Gives back what it took.
    ///
    /// # Errors
    /// The action failed, with the reason.
    fn cleanup(&self) -> Result<(), Failure>;

    /// Ends for good, from any state: stops working and gives back what it has.
    ///
    /// # Errors
    /// Something was lost, with a description. The node ends all the same.
    fn shutdown(&self) -> Result<(), Failure>;

    /// Gives back what it has after a [`Failure::Broken`].
    ///
    /// # Errors
    /// It cannot; the node ends.
    fn recover(&self) -> Result<(), Failure>;
}
