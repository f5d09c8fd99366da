//! How a live node starts its middleware process: this program with the verb `middleware`.

use std::{env, path::PathBuf};

use anyhow::Context;

use super::logging;
use crate::ros::{arguments::RosArguments, process::link::WorkerCommand};

/// Name of the verb.
const VERB: &str = "middleware";

/// Returns the command that runs the middleware of a node with these arguments.
///
/// # Errors
/// [`Usage`](super::Usage) for a logger that does not exist; the system does not tell where this program is.
pub(super) fn of(ros: &RosArguments) -> anyhow::Result<WorkerCommand> {
    let levels = logging::Levels::new(&ros.log_levels, &ros.remaps)?;
    // This very program, even if its file has been replaced meanwhile.
    let own = PathBuf::from("/proc/self/exe");
    let program = if own.exists() {
        own
    } else {
        env::current_exe().context("cannot find this program's own file: mount /proc")?
    };
    let log = levels.targets().to_string();
    Ok(WorkerCommand { program, arguments: vec![VERB.to_owned(), "--log".to_owned(), log] })
}

#[cfg(test)]
mod tests {
    use tracing::Level;
    use tracing_subscriber::filter::Targets;

    use super::*;
    use crate::ros::arguments;

    #[test]
    fn the_middleware_process_logs_what_the_node_would() {
        let line = ["--ros-args", "--log-level", "zenoh:=debug"].map(str::to_owned);
        let (ros, _) = arguments::split(&line).unwrap();
        let command = of(&ros).unwrap();
        assert_eq!(command.arguments[..2], ["middleware", "--log"]);
        let targets: Targets = command.arguments[2].parse().unwrap();
        assert!(targets.would_enable("zenoh::net", &Level::DEBUG));
        assert!(targets.would_enable("laser_profiler::ros", &Level::INFO));
        assert!(!targets.would_enable("rustdds::structure", &Level::ERROR));
    }
}
