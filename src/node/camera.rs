//! Chooses the cameras to replay.

use thiserror::Error;

use crate::{
    bag::BagReader,
    ros::{
        camera_params::CameraParams,
        names::{NameError, NodeNames},
    },
};

use super::input;

/// The reason that no camera can be chosen.
#[derive(Debug, Error)]
pub(crate) enum CameraError {
    /// No camera has the requested name.
    #[error("no camera is called {name:?}; {}", list(.cameras))]
    Unknown {
        /// The requested name.
        name: String,
        /// Names of the existing cameras.
        cameras: Vec<String>,
    },
    /// There are several cameras, and the recordings contain images of none of them.
    #[error("no recording has images of a camera; {} (--ros-args -r {}/image_raw:=TOPIC names another topic)", list(.cameras), first(.cameras))]
    NotRecorded {
        /// Their names.
        cameras: Vec<String>,
    },
    /// A remap rule has a name that ROS does not allow.
    #[error(transparent)]
    Name(#[from] NameError),
}

fn list(cameras: &[String]) -> String {
    match cameras.join(", ") {
        names if names.is_empty() => "the parameter `cameras` is empty".to_owned(),
        names => format!("the cameras are {names}"),
    }
}

fn first(cameras: &[String]) -> &str {
    cameras.first().map_or("NAME", String::as_str)
}

/// Returns the camera called `name`. Without a name, returns the only camera, or all cameras whose images are in a
/// recording.
///
/// # Errors
/// No camera matches, or a remap rule has an invalid name.
pub(crate) fn choose(
    cameras: Vec<CameraParams>,
    name: Option<&str>,
    bags: &[BagReader],
    names: &NodeNames,
) -> Result<Vec<CameraParams>, CameraError> {
    let all: Vec<String> = cameras.iter().map(|camera| camera.name.clone()).collect();
    if let Some(name) = name {
        let found = cameras.into_iter().find(|camera| !name.is_empty() && camera.name == name);
        let found = found.map(|camera| vec![camera]);
        return found.ok_or_else(|| CameraError::Unknown { name: name.to_owned(), cameras: all });
    }
    let is_only = cameras.len() == 1;
    let mut found = Vec::new();
    for camera in cameras {
        let topic = input::image_topic_of(&camera.name, names)?;
        if is_only || bags.iter().any(|bag| has_images(bag, &topic)) {
            found.push(camera);
        }
    }
    if found.is_empty() { Err(CameraError::NotRecorded { cameras: all }) } else { Ok(found) }
}

/// True if a recording contains that topic, raw or compressed.
fn has_images(bag: &BagReader, topic: &str) -> bool {
    let mut names = bag.topics().iter().map(|topic| topic.name.as_str());
    names.any(|name| name == topic || name.strip_suffix("/compressed") == Some(topic))
}
