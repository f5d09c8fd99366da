//! The calibration file: YAML, with the camera in the format of ROS's `camera_info` files.

mod camera;
mod foreign;
mod id;
mod plain;
mod plain_words;
mod raw;
mod tree;
mod write;

use serde::{
    Deserialize,
    de::{DeserializeOwned, IgnoredAny},
};

use super::{Calibration, CalibrationError, CameraCalibration};

pub(super) use id::Id;
pub(super) use write::{write, write_camera};

const TYPES: &str = "camera_and_plane, vertical_incidence or projective";

/// References in a file. Other programs write a few for lists that are alike; each could repeat a long text.
const MAX_ALIASES: usize = 32;

/// The entries that determine how the rest is read.
#[derive(Deserialize)]
struct Head {
    #[serde(rename = "type")]
    kind: Option<String>,
    camera_matrix: Option<IgnoredAny>,
    id: Option<String>,
}

/// Reads a calibration that can measure.
pub(super) fn read(text: &str) -> Result<Calibration, CalibrationError> {
    if let Some(foreign) = foreign::recognise(text) {
        return Err(foreign.camera_only());
    }
    let head: Head = parse(text)?;
    let calibration = match head.kind.as_deref() {
        Some("vertical_incidence") => parse::<plain::VerticalFile>(text)?.calibration()?,
        Some("projective") => parse::<plain::ProjectiveFile>(text)?.calibration()?,
        Some("camera_and_plane") => {
            let geometry = parse::<camera::CameraFile>(text)?.camera_and_plane()?;
            Calibration::CameraAndPlane(Box::new(geometry))
        }
        Some("camera") => {
            return Err(CalibrationError::CameraOnly { kind: "a file of `calibrate camera`" });
        }
        // ROS's calibrators write no type.
        None if head.camera_matrix.is_some() => {
            let kind = "a camera file of ROS's camera_calibration (ost.yaml)";
            return Err(CalibrationError::CameraOnly { kind });
        }
        Some(kind) => return Err(CalibrationError::value("type", kind, TYPES)),
        None => return Err(CalibrationError::value("type", "missing", TYPES)),
    };
    check_id(head.id, calibration.id())?;
    Ok(calibration)
}

/// Reads the camera of a file, with or without a laser plane.
pub(super) fn read_camera(text: &str) -> Result<CameraCalibration, CalibrationError> {
    if let Some(foreign) = foreign::recognise(text) {
        return foreign.camera();
    }
    let head: Head = parse(text)?;
    match head.kind.as_deref() {
        None | Some("camera") => {
            let camera = parse::<camera::CameraFile>(text)?.camera_alone()?;
            check_id(head.id, camera.id())?;
            Ok(camera)
        }
        Some("camera_and_plane") => {
            let geometry = parse::<camera::CameraFile>(text)?.camera_and_plane()?;
            check_id(head.id, geometry.id())?;
            Ok(CameraCalibration {
                camera_name: geometry.camera_name,
                camera: geometry.camera,
                quality: geometry.camera_quality,
                calibrated_at: geometry.calibrated_at,
            })
        }
        Some(kind) => Err(CalibrationError::value("type", kind, "camera or camera_and_plane")),
    }
}

fn parse<T: DeserializeOwned>(text: &str) -> Result<T, CalibrationError> {
    let options =
        serde_saphyr::options! { budget: serde_saphyr::budget! { max_aliases: MAX_ALIASES } };
    serde_saphyr::from_str_with_options(text, options)
        .map_err(|error| CalibrationError::Syntax(plain_words::explain(text, &error)))
}

fn check_id(stated: Option<String>, actual: String) -> Result<(), CalibrationError> {
    match stated {
        Some(stated) if stated != actual => Err(CalibrationError::Edited { stated, actual }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
