//! Errors of the node on a network.

use std::io;

use thiserror::Error;

use crate::{
    node::{
        ambient_file::AmbientFileError, calibration_file::CalibrationFileError,
        lifecycle::server::ChangeError, positions::AxisError, rosout::RosoutError, run::RunError,
    },
    ros::{names::NameError, parameters::ParameterError, transport::TransportError},
};

/// The reason that a node cannot start or continue.
#[derive(Debug, Error)]
pub(crate) enum LiveError {
    /// A name or remap rule is invalid.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter or parameter file is invalid.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A calibration cannot be loaded.
    #[error(transparent)]
    Calibration(#[from] CalibrationFileError),
    /// A frame without laser cannot be loaded.
    #[error(transparent)]
    Ambient(#[from] AmbientFileError),
    /// Motion parameters and calibration contradict each other.
    #[error(transparent)]
    Axis(#[from] AxisError),
    /// The middleware rejects a resource.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// `/rosout` cannot be started.
    #[error(transparent)]
    Rosout(#[from] RosoutError),
    /// A lifecycle transition failed.
    #[error(transparent)]
    Lifecycle(#[from] ChangeError),
    /// A thread cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] io::Error),
    /// A thread panicked.
    #[error(
        "{0} ended by a programming error; recordings are closed: start the node again, and report the lines of the log \
         before this one"
    )]
    Panicked(String),
    /// A camera's worker ended early.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl LiveError {
    /// True if the request is wrong, rather than a file, the network or the machine.
    pub(crate) const fn is_usage(&self) -> bool {
        match self {
            Self::Name(_) | Self::Parameter(_) | Self::Axis(_) => true,
            Self::Transport(error) => matches!(error, TransportError::Setting { .. }),
            Self::Calibration(_)
            | Self::Ambient(_)
            | Self::Rosout(_)
            | Self::Lifecycle(_)
            | Self::Thread(_)
            | Self::Panicked(_)
            | Self::Run(_) => false,
        }
    }
}
