//! `sensor_msgs/CameraInfo` as `ros2 topic echo` prints it; ROS 1 wrote the keys in upper case.

use super::{Node, RawCamera, numbers, size_px};

pub(super) fn is_camera_info(document: &Node) -> bool {
    ["k", "d", "width", "height"].iter().all(|key| entry(document, key).is_some())
        || (entry(document, "k").is_some() && entry(document, "distortion_model").is_some())
}

fn entry<'a>(document: &'a Node, key: &str) -> Option<&'a Node> {
    let is_named =
        |(name, node): &'a (String, Node)| name.eq_ignore_ascii_case(key).then_some(node);
    document.entries().iter().find_map(is_named)
}

/// Reads one message; further messages must describe the same camera.
pub(super) fn read(documents: &[Node]) -> Result<RawCamera, String> {
    let mut cameras = documents.iter().map(message);
    let first = cameras.next().ok_or_else(|| "there is no message".to_owned())??;
    for other in cameras {
        if other? != first {
            return Err("its messages describe different cameras: keep one of them".to_owned());
        }
    }
    Ok(first)
}

fn message(document: &Node) -> Result<RawCamera, String> {
    let required = |key: &str| entry(document, key).ok_or_else(|| format!("{key} is missing"));
    let matrix = numbers("k", required("k")?)?;
    if matrix.first() == Some(&0.0) {
        return Err("k is all zero: this camera's driver has no calibration. Run `laser_profiler \
                    calibrate camera`"
            .to_owned());
    }
    let model = entry(document, "distortion_model").and_then(Node::text).unwrap_or_default();
    let frame_id = entry(document, "header").and_then(|header| entry(header, "frame_id"));
    let name = frame_id.and_then(Node::text).filter(|name| !name.is_empty());
    Ok(RawCamera {
        camera_name: name.unwrap_or("camera").to_owned(),
        width_px: size_px("width", required("width")?)?,
        height_px: size_px("height", required("height")?)?,
        matrix,
        // An empty name is ROS's default.
        model: if model.is_empty() { "plumb_bob" } else { model }.to_owned(),
        coefficients: numbers("d", required("d")?)?,
        tilt_rad: [0.0; 2],
    })
}
