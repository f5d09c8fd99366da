//! Location of new bags: unused names and the free space.

use std::{fs, io, path::Path};

use jiff::Timestamp;

use crate::bag::{Compression, RecordError, SplitLimits, SplitRecorder, Topic};

use super::{error::RecordingError, params::RecordingParams};

/// Space for the head of a new bag, bytes.
const HEAD_BYTES: u64 = 256 << 10;

/// Maximum number of bags with the same base name.
const MAX_SAME_NAME: u32 = 10_000;

/// Returns a bag's base name: the program, the camera if there are several, and the time in UTC.
pub(super) fn name(camera: &str, now: Timestamp) -> String {
    let camera = if camera.is_empty() { String::new() } else { format!("_{camera}") };
    format!("{}{camera}_{}", env!("CARGO_PKG_NAME"), now.strftime("%Y_%m_%d-%H_%M_%S"))
}

/// Name of a bag; a number may be inserted between its parts.
#[derive(Clone, Copy)]
pub(super) struct BagName<'a> {
    pub(super) base: &'a str,
    pub(super) suffix: &'a str,
}

/// Creates the bag `<base><suffix>`, or `<base>_1<suffix>` and so on if it exists already.
///
/// # Errors
/// There is too little free space, or writing fails.
pub(super) fn create(
    params: &RecordingParams,
    name: BagName<'_>,
    compression: Compression,
    topics: &[Topic],
) -> Result<SplitRecorder, RecordingError> {
    let directory = &params.directory;
    let BagName { base, suffix } = name;
    fs::create_dir_all(directory)
        .map_err(|source| RecordingError::System { directory: directory.clone(), source })?;
    require_space(directory, params.min_free_bytes, HEAD_BYTES)?;
    let limits: SplitLimits = params.split_limits();
    for number in 0..MAX_SAME_NAME {
        let number = if number == 0 { String::new() } else { format!("_{number}") };
        let path = directory.join(format!("{base}{number}{suffix}"));
        match SplitRecorder::create(&path, compression, limits, topics.to_vec()) {
            Err(RecordError::Exists(_)) => {}
            created => return Ok(created?),
        }
    }
    Err(RecordError::Exists(directory.join(format!("{base}{suffix}"))).into())
}

/// Returns the space available to unprivileged users, bytes.
///
/// # Errors
/// The directory is missing, or the file system does not report its free space.
pub(crate) fn free_bytes(directory: &Path) -> io::Result<u64> {
    let found = rustix::fs::statvfs(directory)?;
    Ok(found.f_bavail.saturating_mul(found.f_frsize))
}

/// Checks that `min_free_bytes` stay free if `needed_bytes` are written. Returns the free space, bytes.
///
/// # Errors
/// Less would be free, or the directory does not exist.
pub(super) fn require_space(
    directory: &Path,
    min_free_bytes: u64,
    needed_bytes: u64,
) -> Result<u64, RecordingError> {
    let free_bytes = free_bytes(directory)
        .map_err(|source| RecordingError::System { directory: directory.into(), source })?;
    if free_bytes < min_free_bytes.saturating_add(needed_bytes) {
        return Err(RecordingError::LowSpace {
            directory: directory.into(),
            free_bytes,
            needed_bytes,
            min_free_bytes,
        });
    }
    Ok(free_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_the_time_in_utc() {
        let leap_day: Timestamp = "2024-02-29T23:59:07.9+00:00".parse().unwrap();
        assert_eq!(name("", leap_day), "laser_profiler_2024_02_29-23_59_07");
        assert_eq!(name("left", leap_day), "laser_profiler_left_2024_02_29-23_59_07");
    }

    #[test]
    fn existing_names_get_a_number() {
        let place = tempfile::tempdir().unwrap();
        let params = RecordingParams {
            directory: place.path().join("made/here"),
            min_free_bytes: 0,
            ..RecordingParams::default()
        };
        let names = [(); 3].map(|()| {
            let bag =
                create(&params, BagName { base: "a", suffix: "_images" }, Compression::None, &[])
                    .unwrap();
            bag.directory().file_name().unwrap().to_str().unwrap().to_owned()
        });
        assert_eq!(names, ["a_images", "a_1_images", "a_2_images"]);
    }

    #[test]
    fn too_little_space_is_reported_with_its_figures() {
        let place = tempfile::tempdir().unwrap();
        require_space(place.path(), 0, 0).unwrap();
        assert!(require_space(place.path(), 0, u64::MAX).is_err());
        let text = require_space(place.path(), u64::MAX, 7).unwrap_err().to_string();
        for part in [
            &*place.path().display().to_string(),
            "min_free_bytes 18446744073709551615",
            "free; 7 more",
        ] {
            assert!(text.contains(part), "{text}");
        }
        let gone = require_space(&place.path().join("gone"), 0, 0).unwrap_err().to_string();
        assert!(gone.contains("gone") && gone.contains("No such file"), "{gone}");
    }
}
