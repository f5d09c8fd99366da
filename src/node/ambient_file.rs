//! Loads the frame without laser that a parameter names.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::named_file;
use crate::{
    msg::{
        convert::{compressed, frame::FrameRejected},
        sensor_msgs::CompressedImage,
    },
    ros::camera_params::CameraParams,
    scanner::image::OwnedImage,
};

/// The reason that the frame without laser cannot be loaded.
#[derive(Debug, Error)]
pub(crate) enum AmbientFileError {
    /// It cannot be used.
    #[error("extraction.background_file {}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: FrameRejected,
    },
    /// It cannot be read.
    #[error("extraction.background_file {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The I/O error.
        source: io::Error,
    },
}

/// Reads the PNG file that a camera's parameters name; `None` if they name none.
///
/// # Errors
/// The file is missing, no regular file, not a PNG image, or larger than `max_frame_bytes` allows.
pub(crate) fn load(camera: &CameraParams) -> Result<Option<OwnedImage>, AmbientFileError> {
    camera.background_file.as_deref().map(|path| read(path, camera.max_frame_bytes)).transpose()
}

fn read(path: &Path, max_frame_bytes: u64) -> Result<OwnedImage, AmbientFileError> {
    let io = |source| AmbientFileError::Io { path: path.to_owned(), source };
    // The file of an incompressible image is slightly longer than its pixels.
    let max_bytes = max_frame_bytes.saturating_add(max_frame_bytes / 8 + 4096);
    let data = named_file::read(path, max_bytes).map_err(|source| match source.kind() {
        io::ErrorKind::FileTooLarge => {
            io(io::Error::other(format!("{source}; raise max_frame_bytes for a larger image")))
        }
        _ => io(source),
    })?;
    let message =
        CompressedImage { format: "png".into(), data: &data, ..CompressedImage::default() };
    let mut pixels = Vec::new();
    let image = compressed::image(&message, max_frame_bytes, &mut pixels)
        .map_err(|source| AmbientFileError::Content { path: path.to_owned(), source })?;
    Ok(OwnedImage::from(&image))
}
