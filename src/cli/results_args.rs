//! The arguments that select a scan in a results bag.

use crate::results::ScanSelection;

/// Selection of a scan in a results bag.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ResultsArgs {
    /// A results bag: a rosbag2 directory or an .mcap file.
    pub(super) bag: std::path::PathBuf,
    /// Topic of the point clouds; by default the only topic of organised clouds.
    #[arg(long, value_name = "TOPIC")]
    pub(super) topic: Option<String>,
    /// Number of the scan, from 0; required if the bag has several.
    #[arg(long, value_name = "N")]
    pub(super) scan: Option<usize>,
}

impl ResultsArgs {
    pub(super) fn selection(&self) -> ScanSelection {
        ScanSelection { bag: self.bag.clone(), topic: self.topic.clone(), scan: self.scan }
    }
}
