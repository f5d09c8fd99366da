//! Parameters that a node declares, in the order of a parameter file.

use std::sync::LazyLock;

pub(crate) use laser_triangulation::parameters::{Kind, Parameter};

use super::{camera_params::CameraParams, node_params::NodeParams};

/// Parameter that declares the cameras; each has the parameters of [`CAMERA`].
const CAMERAS_ROW: Parameter = Parameter {
    name: CAMERAS,
    unit: "",
    kind: Kind::TextList { max_items: MAX_CAMERAS },
    is_read_only: true,
    text: "Names of several cameras; empty: one camera without a name. Each camera has its own worker, topics \
         (left/image_raw, ~/left/centerline) and parameters (left.extraction.method).",
};

/// Name of the parameter that declares the cameras.
pub(super) const CAMERAS: &str = "cameras";

const MAX_CAMERAS: usize = 16;

/// Parameters of the node itself.
pub(crate) static NODE: LazyLock<Vec<Parameter>> =
    LazyLock::new(|| [vec![CAMERAS_ROW], NodeParams::parameters()].concat());

/// Parameters of a camera; with several cameras, prefixed by the camera's name.
pub(crate) static CAMERA: LazyLock<Vec<Parameter>> = LazyLock::new(CameraParams::table);
