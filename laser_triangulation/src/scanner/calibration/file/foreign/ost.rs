//! `ost.txt` of ROS's `camera_calibration`: titles in a line of their own, numbers below them.

use super::RawCamera;

pub(super) fn is_ost(text: &str) -> bool {
    let mut lines = text.lines().map(str::trim);
    lines.clone().any(|line| line == "[image]") && lines.any(|line| line == "camera matrix")
}

pub(super) fn read(text: &str) -> Result<RawCamera, String> {
    let is_name = |line: &&str| line.starts_with('[') && line.ends_with(']') && *line != "[image]";
    let name = text.lines().map(str::trim).find(is_name);
    let coefficients = below(text, "distortion")?;
    // The format does not state the model.
    let model = match coefficients.len() {
        4 => return Err("four coefficients are those of a common lens or of a fisheye: use ost.yaml, which states the model".to_owned()),
        0..=5 => "plumb_bob",
        _ => "rational_polynomial",
    };
    Ok(RawCamera {
        camera_name: name.map_or("camera", |name| name.trim_matches(['[', ']'])).to_owned(),
        width_px: size_px(text, "width")?,
        height_px: size_px(text, "height")?,
        matrix: below(text, "camera matrix")?,
        model: model.to_owned(),
        coefficients,
        tilt_rad: [0.0; 2],
    })
}

fn size_px(text: &str, title: &str) -> Result<u32, String> {
    match below(text, title)?.as_slice() {
        [size] if (1.0..=65_535.0).contains(size) && size.fract() == 0.0 => Ok(*size as u32),
        _ => Err(format!("{title} is not a whole number from 1 to 65535 pixels")),
    }
}

/// Returns the numbers below a title, up to the next line that is not of numbers.
fn below(text: &str, title: &str) -> Result<Vec<f64>, String> {
    let mut lines = text.lines().map(str::trim);
    lines.find(|line| *line == title).ok_or_else(|| format!("{title} is missing"))?;
    let mut numbers = Vec::new();
    for line in lines.skip_while(|line| line.is_empty()) {
        let row: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        match row {
            Ok(row) if row.iter().any(|number| !number.is_finite()) => {
                return Err(format!("{title} has a number that is not finite: {line}"));
            }
            Ok(row) if !row.is_empty() => numbers.extend(row),
            _ => break,
        }
    }
    Ok(numbers)
}
