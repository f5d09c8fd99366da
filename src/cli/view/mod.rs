//! `--view`: live view in Foxglove.

#[cfg(not(feature = "foxglove"))]
mod absent;
#[cfg(feature = "foxglove")]
mod served;

#[cfg(not(feature = "foxglove"))]
pub(super) use absent::{live, replay};
#[cfg(feature = "foxglove")]
pub(super) use served::{live, replay};

use std::path::PathBuf;

/// Default address of the server.
const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";
const IMAGES: [&str; 3] = ["full", "preview", "none"];

/// Options of the live view.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Live view")]
pub(crate) struct ViewArgs {
    /// Serve a live view to Foxglove on this machine (Open connection, Foxglove WebSocket, ws://HOST:PORT): images,
    /// centreline, profile, cloud, height map, status, adjustable parameters.
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = DEFAULT_ADDRESS
    )]
    pub(crate) view: Option<String>,
    /// Images in the view: `preview` (reduced, at most 15 per second, on `~/preview` with `~/preview_annotations`),
    /// `full` (every image on its own topic with `~/annotations`) or `none`.
    #[arg(long, value_name = "SIZE", default_value = "preview", value_parser = IMAGES, requires = "view")]
    pub(crate) view_image: String,
    /// Also admit pages of this origin, such as `https://studio.example.com`. Pages of this machine and of
    /// `https://app.foxglove.dev` are always admitted, others never. May be repeated.
    #[arg(long, value_name = "ORIGIN", requires = "view")]
    pub(crate) view_origin: Vec<String>,
    /// Let only viewers change things whose URL ends in /?token=TOKEN; others may look. Without a value a token is
    /// made. It is in the URL that is logged.
    #[arg(
        long,
        value_name = "TOKEN",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "",
        requires = "view"
    )]
    pub(crate) view_token: Option<String>,
    /// Certificate in PEM for wss://. Needed on an address that other machines reach, where changing things always needs
    /// a token.
    #[arg(long, value_name = "FILE", requires = "view")]
    pub(crate) view_cert: Option<PathBuf>,
    /// Private key of the certificate in PEM.
    #[arg(long, value_name = "FILE", requires = "view")]
    pub(crate) view_key: Option<PathBuf>,
}

/// Options of the live view of a replay.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct ReplayViewArgs {
    /// Contents and address of the view.
    #[command(flatten)]
    pub(crate) view: ViewArgs,
    /// End the view after the recording has been played once.
    #[arg(long, requires = "view", help_heading = "Live view")]
    pub(crate) view_exit: bool,
}
