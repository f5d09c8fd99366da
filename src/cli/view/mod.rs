//! `--view`: what a command measures, live in Foxglove.

#[cfg(not(feature = "foxglove"))]
mod absent;
#[cfg(feature = "foxglove")]
mod served;

#[cfg(not(feature = "foxglove"))]
pub(super) use absent::{live, replay};
#[cfg(feature = "foxglove")]
pub(super) use served::{live, replay};

/// Where viewers look first.
const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";
const IMAGES: [&str; 3] = ["full", "preview", "none"];

/// How a command is watched.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Live view")]
pub struct ViewArgs {
    /// Serve a live view to Foxglove on this machine (Open connection, Foxglove WebSocket, ws://HOST:PORT): images,
    /// centreline, profile, cloud, height map, status, and the parameters to turn.
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = DEFAULT_ADDRESS
    )]
    pub view: Option<String>,
    /// Images in the view: `preview` is small and at most 15 a second, on `~/preview`, with `~/preview_annotations` over
    /// it; `full` is every image on its own topic, with `~/annotations` over it; `none`.
    #[arg(long, value_name = "SIZE", default_value = "preview", value_parser = IMAGES, requires = "view")]
    pub view_image: String,
}

/// How a replay is watched.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ReplayViewArgs {
    /// What is served, and where.
    #[command(flatten)]
    pub view: ViewArgs,
    /// End the view when the recording has been shown once, whether anybody looks or not.
    #[arg(long, requires = "view", help_heading = "Live view")]
    pub view_exit: bool,
}
