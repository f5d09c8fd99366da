//! Suggestions for undeclared names.

use crate::ros::{qos_overrides, table::CAMERA};

use super::Parameters;

const LIST: &str = "`laser_profiler parameters` lists them";

impl Parameters {
    /// Returns the missing or unknown camera; otherwise a parameter whose last word has a common beginning; otherwise a
    /// reference to the list.
    pub(super) fn hint(&self, name: &str) -> String {
        if name.starts_with(qos_overrides::PREFIX) {
            return "set overrides of quality of service when starting the node".to_owned();
        }
        let of_camera = |name: &str| CAMERA.iter().any(|row| row.name == name);
        let cameras = self.cameras().join(", ");
        let is_named = !cameras.is_empty();
        if let (true, Some(first)) = (is_named && of_camera(name), self.cameras().first()) {
            return format!("each of the cameras [{cameras}] has its own, such as {first}.{name}");
        }
        if let Some((camera, row)) = name.split_once('.')
            && of_camera(row)
        {
            return if is_named {
                format!("there is no camera {camera:?}, only [{cameras}]")
            } else {
                format!("the only camera has no name: write {row}, or add {camera:?} to cameras")
            };
        }
        match self.similar(name) {
            Some(similar) => format!("did you mean {similar}? {LIST}"),
            None => LIST.to_owned(),
        }
    }

    fn similar(&self, name: &str) -> Option<&str> {
        let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
        let given = last(name);
        let is_similar = |declared: &str| {
            let declared = last(declared);
            !given.is_empty() && (declared.starts_with(&given) || given.starts_with(&declared))
        };
        self.iter().map(super::Declared::name).find(|declared| is_similar(declared))
    }
}
