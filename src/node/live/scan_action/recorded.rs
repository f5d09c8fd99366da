//! The files of a scan that was recorded, with their hashes.

use std::{
    fmt::Write as _,
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

/// Bytes that are hashed at a time.
const BLOCK_BYTES: usize = 1 << 20;

/// A file of a recording.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct RecordedFile {
    /// Its URI.
    pub(super) uri: String,
    /// Its SHA-256, hexadecimal.
    pub(super) sha256: String,
}

/// Returns the files of a bag in order. Hashing takes seconds for each gigabyte: it ends when it is no longer wanted.
///
/// # Errors
/// A file cannot be read, or hashing ended.
pub(super) fn files(
    directory: &Path,
    is_wanted: &impl Fn() -> bool,
) -> io::Result<Vec<RecordedFile>> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(directory)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "mcap"));
    // Numbered without leading zeros.
    paths.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    paths.iter().map(|path| file(path, is_wanted)).collect()
}

fn file(path: &Path, is_wanted: &impl Fn() -> bool) -> io::Result<RecordedFile> {
    let (mut input, mut hash) = (File::open(path)?, Sha256::new());
    let mut block = vec![0; BLOCK_BYTES];
    loop {
        if !is_wanted() {
            return Err(io::Error::other(format!(
                "{}: not hashed, because the node ended",
                path.display()
            )));
        }
        match input.read(&mut block)? {
            0 => break,
            num => hash.update(&block[..num]),
        }
    }
    let sha256 = hash.finalize().iter().fold(String::with_capacity(64), |mut text, byte| {
        // Writing to a string cannot fail.
        _ = write!(text, "{byte:02x}");
        text
    });
    Ok(RecordedFile { uri: uri(&fs::canonicalize(path)?), sha256 })
}

/// Returns the URI of an absolute path (RFC 8089).
fn uri(path: &Path) -> String {
    let mut uri = String::from("file://");
    for byte in path.as_os_str().as_encoded_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' => {
                uri.push(char::from(*byte));
            }
            other => _ = write!(uri, "%{other:02X}"),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_uris_and_hashes_in_their_order() {
        let place = tempfile::tempdir().unwrap();
        for number in [10, 2] {
            fs::write(place.path().join(format!("a b_{number}.mcap")), "abc").unwrap();
        }
        fs::write(place.path().join("metadata.yaml"), "").unwrap();
        let found = files(place.path(), &|| true).unwrap();
        assert_eq!(found.len(), 2);
        assert!(found[0].uri.starts_with("file:///") && found[0].uri.ends_with("/a%20b_2.mcap"));
        let sha256 = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert!(found.iter().all(|file| file.sha256 == sha256));
        assert!(files(&place.path().join("gone"), &|| true).is_err());
        let unwanted = files(place.path(), &|| false).unwrap_err().to_string();
        assert!(unwanted.contains("not hashed"), "{unwanted}");
    }
}
