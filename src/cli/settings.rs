//! Node parameters for commands that measure, from the same files and options as the node's.

use anyhow::anyhow;
use std::{collections::BTreeMap, path::PathBuf};

use crate::{
    bag::BagReader,
    cli::Usage,
    node::{camera, replay::NODE_NAME},
    ros::{
        arguments::RosArguments, camera_params::CameraParams, names::NodeNames,
        node_params::NodeParams, parameters::Parameters,
    },
    scanner::params::Method,
};

/// Sources of the parameters.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct SettingsArgs {
    /// ROS 2 parameter file. Several are applied in order, before those of --ros-args.
    #[arg(long, value_name = "FILE")]
    pub(super) params_file: Vec<PathBuf>,
    /// Name of the camera, if the parameter `cameras` names several.
    #[arg(long, value_name = "NAME")]
    pub(super) camera: Option<String>,
}

/// Names and parameters as the node would use them.
pub(super) struct Settings {
    pub(super) names: NodeNames,
    pub(super) values: Parameters,
    pub(super) cameras: Vec<CameraParams>,
    camera: Option<String>,
}

impl Settings {
    /// Reads names and parameters.
    ///
    /// # Errors
    /// [`Usage`] for a name, file or value that the node would reject.
    pub(super) fn load(args: &SettingsArgs, mut ros: RosArguments) -> anyhow::Result<Self> {
        ros.parameter_files.splice(0..0, args.params_file.iter().cloned());
        let names = NodeNames::new(NODE_NAME, &ros.remaps).map_err(usage)?;
        let values = Parameters::load(&names, &ros).map_err(usage)?;
        let cameras = NodeParams::new(&values).map_err(usage)?.cameras;
        Ok(Self { names, values, cameras, camera: args.camera.clone() })
    }

    /// Returns the selected camera: the named one, the only one, or the only one with images in the bags.
    ///
    /// # Errors
    /// [`Usage`] if no camera or several cameras match.
    pub(super) fn camera(&self, bags: &[BagReader]) -> anyhow::Result<CameraParams> {
        let cameras = self.cameras.clone();
        let mut chosen =
            camera::choose(cameras, self.camera.as_deref(), bags, &self.names).map_err(usage)?;
        let names: Vec<_> = chosen.iter().map(|camera| camera.name.clone()).collect();
        match (chosen.pop(), chosen.is_empty()) {
            (Some(camera), true) => Ok(camera),
            _ => Err(usage(format!("--camera must name one of {}", names.join(", ")))),
        }
    }

    /// Returns the extraction parameters except the method, by name.
    pub(super) fn extraction(&self, camera: &CameraParams) -> BTreeMap<String, String> {
        let prefix = camera.full_name("extraction.");
        let own = self.values.iter().filter_map(|declared| {
            let name = declared.name().strip_prefix(&prefix)?;
            (name != "method").then(|| (name.to_owned(), declared.value().to_string()))
        });
        own.collect()
    }
}

/// Turns an error into wrong usage.
pub(super) fn usage(error: impl std::fmt::Display) -> anyhow::Error {
    Usage(error.to_string()).into()
}

/// Returns the methods with these names; all if the list is empty.
///
/// # Errors
/// [`Usage`] for an unknown or repeated name.
pub(super) fn methods(names: &[String]) -> anyhow::Result<Vec<Method>> {
    let of = |name: &str| {
        Method::from_name(name).ok_or_else(|| {
            usage(format!("unknown method {name:?}; methods are {}", Method::NAMES.join(", ")))
        })
    };
    choose(names, Method::NAMES, of)
}

/// Looks up names with `of`; looks up `all` if the list is empty.
pub(super) fn choose<T: PartialEq>(
    names: &[String],
    all: &[&str],
    of: impl Fn(&str) -> anyhow::Result<T>,
) -> anyhow::Result<Vec<T>> {
    if names.is_empty() {
        return all.iter().map(|name| of(name)).collect();
    }
    let mut chosen = Vec::new();
    for name in names {
        let next = of(name)?;
        if chosen.contains(&next) {
            return Err(anyhow!(Usage(format!("{name} is given twice"))));
        }
        chosen.push(next);
    }
    Ok(chosen)
}
