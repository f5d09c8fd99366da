//! Reads a file that a parameter names: a regular file, and no more of it than allowed. Peers can set parameters, and a
//! device or a pipe would block the node or fill its memory.

use std::{
    fs::{File, Metadata, OpenOptions},
    io::{self, Read},
    os::unix::fs::OpenOptionsExt,
    path::Path,
};

use rustix::fs::OFlags;

/// Reads a regular file of at most `max_bytes`.
///
/// # Errors
/// The file is missing, is no regular file, or is longer.
pub(super) fn read(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let file = open_regular(path)?;
    let refusal = |what: String| io::Error::new(io::ErrorKind::FileTooLarge, what);
    let size = file.metadata()?.len();
    if size > max_bytes {
        return Err(refusal(format!("{size} bytes exceed the limit of {max_bytes}")));
    }
    let mut data = Vec::new();
    // It may grow meanwhile.
    file.take(max_bytes.saturating_add(1)).read_to_end(&mut data)?;
    if data.len() as u64 > max_bytes {
        return Err(refusal(format!("it is longer than the limit of {max_bytes} bytes")));
    }
    Ok(data)
}

fn open_regular(path: &Path) -> io::Result<File> {
    let wait_for_nothing = (OFlags::NONBLOCK | OFlags::NOCTTY).bits().cast_signed();
    // Looked at before too: opening a device may already do something.
    require_regular(&std::fs::metadata(path)?)?;
    let file = OpenOptions::new().read(true).custom_flags(wait_for_nothing).open(path)?;
    require_regular(&file.metadata()?)?;
    Ok(file)
}

fn require_regular(metadata: &Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let what = "it is no regular file, but a directory, a pipe or a device";
    Err(io::Error::new(io::ErrorKind::InvalidInput, what))
}

#[cfg(test)]
mod tests {
    use std::{fs, process::Command};

    use super::*;

    #[test]
    fn only_regular_files_within_the_limit_are_read() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("file");
        fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        let error = read(&path, 4).unwrap_err().to_string();
        assert!(error.contains("5 bytes exceed the limit of 4"), "{error}");
        // A file of the system that states no length.
        let error = read(Path::new("/proc/self/maps"), 10).unwrap_err().to_string();
        assert!(error.contains("longer than the limit of 10"), "{error}");
        let pipe = place.path().join("pipe");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [&*pipe, Path::new("/dev/zero"), Path::new("/dev/null"), place.path()] {
            let error = read(path, 5).unwrap_err().to_string();
            assert!(error.contains("no regular file"), "{}: {error}", path.display());
        }
    }
}
