//! OpenCV's `FileStorage` as YAML or JSON. Programs choose the keys themselves; the usual ones are known.

use super::{Node, RawCamera, Value, numbers, size_px};

/// Keys without underscores, in lower case.
const MATRIX: [&str; 5] = ["cameramatrix", "k", "mtx", "intrinsicmatrix", "cameramatrix1"];
const COEFFICIENTS: [&str; 7] = [
    "distortioncoefficients",
    "distortioncoeffs",
    "distcoeffs",
    "distcoeff",
    "distcoefs",
    "dist",
    "d",
];
const WIDTH: [&str; 3] = ["imagewidth", "width", "imgwidth"];
const HEIGHT: [&str; 3] = ["imageheight", "height", "imgheight"];
const SIZE: [&str; 4] = ["imagesize", "size", "resolution", "imgsize"];

/// `%YAML:1.0` is not a directive of YAML.
pub(super) fn without_directive(text: &str) -> String {
    let is_directive = |line: &&str| line.starts_with("%YAML");
    let lines = text.lines().map(|line| if is_directive(&line) { "" } else { line });
    lines.collect::<Vec<_>>().join("\n")
}

pub(super) fn read(document: &Node) -> Result<RawCamera, String> {
    let matrix = required(document, &MATRIX, "camera_matrix")?;
    let coefficients = data(
        "distortion_coefficients",
        required(document, &COEFFICIENTS, "distortion_coefficients")?,
    )?;
    let (width_px, height_px) = size(document)?;
    let is_fisheye =
        find(document, &["fisheyemodel"]).is_some_and(|node| node.number() == Some(1.0));
    let stated = find(document, &["distortionmodel"]).and_then(Node::text);
    let model = match (stated, coefficients.len()) {
        (Some(model), _) => model,
        (None, _) if is_fisheye => "equidistant",
        (None, 4) if find(document, &["fisheyemodel"]).is_none() => {
            return Err("four coefficients are those of a common lens or of a fisheye: add the key `distortion_model` \
                        with `plumb_bob` (k1, k2, p1, p2) or `equidistant` (k1, k2, k3, k4)"
                .to_owned());
        }
        (None, 0..=5) => "plumb_bob",
        (None, _) => "rational_polynomial",
    };
    let name = find(document, &["cameraname"]).and_then(Node::text).unwrap_or("camera");
    Ok(RawCamera {
        camera_name: name.to_owned(),
        width_px,
        height_px,
        matrix: data("camera_matrix", matrix)?,
        model: model.to_owned(),
        coefficients,
        tilt_rad: [0.0; 2],
    })
}

/// True for a camera matrix as a list, or under another name than ROS's.
pub(super) fn has_other_keys(document: &Node) -> bool {
    match document.get("camera_matrix") {
        Some(matrix) => matrix.entries().is_empty(),
        None => find(document, &MATRIX).is_some() && find(document, &COEFFICIENTS).is_some(),
    }
}

fn find<'a>(document: &'a Node, names: &[&str]) -> Option<&'a Node> {
    let plain = |key: &str| key.replace(['_', '-', ' '], "").to_lowercase();
    names.iter().find_map(|name| {
        document.entries().iter().find_map(|(key, node)| (plain(key) == *name).then_some(node))
    })
}

fn required<'a>(document: &'a Node, names: &[&str], wanted: &str) -> Result<&'a Node, String> {
    let keys =
        || document.entries().iter().map(|(key, _)| key.as_str()).collect::<Vec<_>>().join(", ");
    find(document, names).ok_or_else(|| format!("{wanted} is missing; its keys are {}", keys()))
}

/// Returns the numbers of a matrix, or of a list.
fn data(key: &str, node: &Node) -> Result<Vec<f64>, String> {
    let Some(values) = node.get("data") else { return numbers(key, node) };
    let values = numbers(key, values)?;
    let side = |side: &str| node.get(side)?.text()?.parse::<usize>().ok();
    let product = side("rows").zip(side("cols")).and_then(|(rows, cols)| rows.checked_mul(cols));
    if product != Some(values.len()) {
        let count = values.len();
        return Err(format!("line {}: {key} has {count} numbers, not rows x cols", node.line));
    }
    Ok(values)
}

fn size(document: &Node) -> Result<(u32, u32), String> {
    if let (Some(width), Some(height)) = (find(document, &WIDTH), find(document, &HEIGHT)) {
        return Ok((size_px("image_width", width)?, size_px("image_height", height)?));
    }
    let both = find(document, &SIZE).and_then(|node| match &node.value {
        Value::List(sides) => Some(sides.as_slice()),
        _ => None,
    });
    if let Some([width, height]) = both {
        return Ok((size_px("image_size", width)?, size_px("image_size", height)?));
    }
    Err("the image size is missing: add the keys `image_width` and `image_height`, in pixels, of the \
         pictures that it was calibrated with"
        .to_owned())
}
