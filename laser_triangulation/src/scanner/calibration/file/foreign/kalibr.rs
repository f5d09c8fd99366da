//! Kalibr's `camchain.yaml`: `intrinsics: [fu, fv, pu, pv]`, `distortion_model: radtan` or `equidistant`, `resolution`.

use super::{Node, RawCamera, Value, numbers, size_px};

/// Returns the cameras of a chain and their names.
pub(super) fn cameras(document: &Node) -> impl Iterator<Item = &(String, Node)> {
    let is_camera = |(name, node): &&(String, Node)| {
        name.starts_with("cam")
            && (node.get("intrinsics").is_some() || node.get("camera_model").is_some())
    };
    document.entries().iter().filter(is_camera)
}

pub(super) fn read(document: &Node) -> Result<RawCamera, String> {
    let all: Vec<_> = cameras(document).collect();
    let [(name, camera)] = all.as_slice() else {
        let names: Vec<_> = all.iter().map(|(name, _)| name.as_str()).collect();
        return Err(format!(
            "it has {} cameras ({}): keep the one that sees the laser and delete the others",
            names.len(),
            names.join(", ")
        ));
    };
    let entry = |key: &str| camera.get(key).ok_or_else(|| format!("{name}.{key} is missing"));
    let text = |key: &str| Ok::<_, String>(entry(key)?.text().unwrap_or_default());
    let model = text("camera_model")?;
    if model != "pinhole" {
        return Err(format!(
            "{name}.camera_model is {model:?}: calibrate with pinhole-radtan or pinhole-equi instead"
        ));
    }
    let intrinsics = entry("intrinsics")?;
    let &[fu, fv, pu, pv] = numbers("intrinsics", intrinsics)?.as_slice() else {
        return Err(format!(
            "line {}: {name}.intrinsics must be four numbers [fu, fv, pu, pv]",
            intrinsics.line
        ));
    };
    let distortion = text("distortion_model")?;
    let (model, d) = match distortion {
        "radtan" => ("plumb_bob", entry("distortion_coeffs")?),
        "equidistant" | "equi" => ("equidistant", entry("distortion_coeffs")?),
        _ => {
            return Err(format!(
                "{name}.distortion_model is {distortion:?}: read are radtan and equidistant"
            ));
        }
    };
    let coefficients = numbers("distortion_coeffs", d)?;
    if coefficients.len() != 4 {
        let count = coefficients.len();
        return Err(format!(
            "line {}: {name}.distortion_coeffs has {count} numbers, not four",
            d.line
        ));
    }
    let resolution = entry("resolution")?;
    let size = numbers("resolution", resolution)?;
    let Value::List(sides) = &resolution.value else { return Err(String::new()) };
    let [width, height] = sides.as_slice() else {
        let count = size.len();
        return Err(format!(
            "line {}: {name}.resolution has {count} numbers, not two [width, height]",
            resolution.line
        ));
    };
    Ok(RawCamera {
        camera_name: name.clone(),
        width_px: size_px("resolution", width)?,
        height_px: size_px("resolution", height)?,
        matrix: vec![fu, 0.0, pu, 0.0, fv, pv, 0.0, 0.0, 1.0],
        model: model.to_owned(),
        coefficients,
        tilt_rad: [0.0; 2],
    })
}
