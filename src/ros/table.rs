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

/// Parameter that allows peers more files.
const ALLOWED_DIRECTORIES_ROW: Parameter = Parameter {
    name: ALLOWED_DIRECTORIES,
    unit: "",
    kind: Kind::TextList { max_items: MAX_DIRECTORIES },
    is_read_only: true,
    text: "Directories in which the files and directories that are set while the node runs may lie, besides the working \
         directory (unless it is /), those of the parameter files, and those of the files set when starting the node. A \
         relative path starts at the parameter file that sets it, or at the working directory if set by -p.",
};

/// Name of the parameter that allows peers more files.
pub(crate) const ALLOWED_DIRECTORIES: &str = "allowed_directories";

const MAX_DIRECTORIES: usize = 64;

/// Parameters that name a file, without the name of a camera.
const FILES: [&str; 2] = ["calibration_file", "extraction.background_file"];
/// Parameters that name a directory.
const DIRECTORIES: [&str; 1] = ["recording.directory"];

/// True if the parameter names a file or a directory.
pub(crate) fn is_path(row: &Parameter) -> bool {
    FILES.contains(&row.name) || is_directory(row)
}

/// True if the parameter names a directory.
pub(crate) fn is_directory(row: &Parameter) -> bool {
    DIRECTORIES.contains(&row.name)
}

/// Name of the parameter that declares the cameras.
pub(super) const CAMERAS: &str = "cameras";

const MAX_CAMERAS: usize = 16;

/// Parameters of the node itself.
pub(crate) static NODE: LazyLock<Vec<Parameter>> = LazyLock::new(|| {
    [vec![CAMERAS_ROW, ALLOWED_DIRECTORIES_ROW], NodeParams::parameters()].concat()
});

/// Parameters of a camera; with several cameras, prefixed by the camera's name.
pub(crate) static CAMERA: LazyLock<Vec<Parameter>> = LazyLock::new(CameraParams::table);
