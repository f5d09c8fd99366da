//! The parameters that a node declares, in the order of a parameter file.

use std::sync::LazyLock;

pub(crate) use laser_triangulation::parameters::{Kind, Parameter};

use super::{camera_params::CameraParams, node_params::NodeParams};

/// The parameter that declares the cameras; each has the parameters of [`CAMERA`].
const CAMERAS_ROW: Parameter = Parameter {
    name: CAMERAS,
    unit: "",
    kind: Kind::TextList { max_items: MAX_CAMERAS },
    is_read_only: true,
    text: "Names of several cameras. Each has a worker of its own, its topics under its name (left/image_raw, \
         ~/left/centerline) and its parameters too (left.extraction.method). Empty: one camera without a name.",
};

/// Name of the parameter that declares the cameras.
pub(super) const CAMERAS: &str = "cameras";

const MAX_CAMERAS: usize = 16;

/// The parameters that a node has once.
pub(crate) static NODE: LazyLock<Vec<Parameter>> =
    LazyLock::new(|| [vec![CAMERAS_ROW], NodeParams::parameters()].concat());

/// The parameters of a camera; with several cameras, each has them under its name.
pub(crate) static CAMERA: LazyLock<Vec<Parameter>> = LazyLock::new(CameraParams::table);
