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
    /// A name or remap rule.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter or parameter file.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The calibration of a camera.
    #[error(transparent)]
    Calibration(#[from] CalibrationFileError),
    /// The frame without laser of a camera.
    #[error(transparent)]
    Ambient(#[from] AmbientFileError),
    /// The axis of a camera's motion.
    #[error(transparent)]
    Axis(#[from] AxisError),
    /// The middleware.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The log on `/rosout`.
    #[error(transparent)]
    Rosout(#[from] RosoutError),
    /// A lifecycle transition failed.
    #[error(transparent)]
    Lifecycle(#[from] ChangeError),
    /// The system gives no thread.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] io::Error),
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
            | Self::Run(_) => false,
        }
    }
}
