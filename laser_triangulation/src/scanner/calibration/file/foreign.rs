//! Camera files of other programs: recognised by their contents, and read as a camera.

mod camera_info;
mod kalibr;
mod opencv;
mod ost;

use super::{
    raw::RawCamera,
    tree::{Node, Value, documents},
};
use crate::scanner::calibration::{CalibrationError, CameraCalibration};

const NO_XML: &str = "save it as .yml or .json instead: XML is not read";

/// The program that wrote a camera file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// ROS's `camera_calibration`, an INI file.
    OstText,
    /// OpenCV's `FileStorage` as YAML or JSON.
    OpenCv,
    /// OpenCV's `FileStorage` as XML.
    OpenCvXml,
    /// A matrix and coefficients as lists, as scripts around `OpenCV` write them.
    OtherKeys,
    /// Kalibr's camera chain.
    Kalibr,
    /// Printed `sensor_msgs/CameraInfo` messages.
    CameraInfo,
}

impl Kind {
    const fn name(self) -> &'static str {
        match self {
            Self::OstText => "a camera file of ROS's camera_calibration (ost.txt)",
            Self::OpenCv => "a camera file of OpenCV (FileStorage)",
            Self::OpenCvXml => "an XML file of OpenCV (FileStorage)",
            Self::OtherKeys => "a camera file as scripts around OpenCV write it",
            Self::Kalibr => "a camera chain of Kalibr",
            Self::CameraInfo => "the output of `ros2 topic echo` on a camera_info topic",
        }
    }

    fn error(self, problem: impl Into<String>) -> CalibrationError {
        CalibrationError::Foreign { kind: self.name(), problem: problem.into() }
    }
}

/// A recognised file.
pub(super) struct Foreign {
    kind: Kind,
    documents: Vec<Node>,
    text: String,
}

/// Recognises a file of another program; `None` for a file of this program or of `camera_calibration` (`ost.yaml`), which has the
/// same layout, and for anything unknown.
pub(super) fn recognise(text: &str) -> Option<Foreign> {
    let text = text.trim_start_matches('\u{feff}');
    let found = |kind, documents| Some(Foreign { kind, documents, text: text.to_owned() });
    if text.trim_start().starts_with('<') {
        return text.contains("opencv_storage").then(|| found(Kind::OpenCvXml, Vec::new()))?;
    }
    if ost::is_ost(text) {
        return found(Kind::OstText, Vec::new());
    }
    let is_opencv = text.contains("opencv-matrix") || text.trim_start().starts_with("%YAML:");
    let documents = documents(&opencv::without_directive(text)).ok()?;
    let first = documents.first()?;
    if first.get("type").is_some() {
        return None;
    }
    if is_opencv {
        return found(Kind::OpenCv, documents);
    }
    if kalibr::cameras(first).next().is_some() {
        return found(Kind::Kalibr, documents);
    }
    if camera_info::is_camera_info(first) {
        return found(Kind::CameraInfo, documents);
    }
    opencv::has_other_keys(first).then(|| found(Kind::OtherKeys, documents))?
}

impl Foreign {
    /// Returns the reason why the file is no calibration, with the next step.
    pub(super) fn camera_only(&self) -> CalibrationError {
        match self.kind {
            Kind::OpenCvXml => self.kind.error(NO_XML),
            kind => CalibrationError::CameraOnly { kind: kind.name() },
        }
    }

    /// Reads the camera.
    ///
    /// # Errors
    /// Missing or contradicting entries; the error names the kind of file and the entry.
    pub(super) fn camera(&self) -> Result<CameraCalibration, CalibrationError> {
        let fail = |problem: String| self.kind.error(problem);
        let first = || self.documents.first().ok_or_else(|| fail("the file is empty".to_owned()));
        let raw = match self.kind {
            Kind::OpenCvXml => Err(NO_XML.to_owned()),
            Kind::OstText => ost::read(&self.text),
            Kind::OpenCv | Kind::OtherKeys => opencv::read(first()?),
            Kind::Kalibr => kalibr::read(first()?),
            Kind::CameraInfo => camera_info::read(&self.documents),
        };
        let raw = raw.map_err(fail)?;
        centre_is_inside(&raw).map_err(fail)?;
        raw.calibration()
    }
}

/// A principal point outside the image means that image size and camera matrix are not of one camera.
fn centre_is_inside(raw: &RawCamera) -> Result<(), String> {
    let centre = |index: usize| raw.matrix.get(index).copied().unwrap_or(0.0);
    for (axis, centre_px, size_px) in
        [("cx", centre(2), raw.width_px), ("cy", centre(5), raw.height_px)]
    {
        if !(0.0..=f64::from(size_px)).contains(&centre_px) {
            return Err(format!(
                "{axis} = {centre_px} px lies outside an image of {} x {} pixels: image size and camera matrix are not of one \
                 camera, or not in pixels",
                raw.width_px, raw.height_px
            ));
        }
    }
    Ok(())
}

/// Returns a size in pixels.
fn size_px(key: &str, node: &Node) -> Result<u32, String> {
    let size = node.number().filter(|size| (1.0..=65_535.0).contains(size) && size.fract() == 0.0);
    let wanted =
        || format!("line {}: {key} is not a whole number from 1 to 65535 pixels", node.line);
    size.map(|size| size as u32).ok_or_else(wanted)
}

/// Returns a list of numbers.
fn numbers(key: &str, node: &Node) -> Result<Vec<f64>, String> {
    node.numbers()
        .ok_or_else(|| format!("line {}: {key} is not a list of finite numbers", node.line))
}
