//! Unpacks files that are compressed as a whole, as in rosbag2's compression mode FILE.
//!
//! Reading needs random access, for the index and for messages in order of time, which a compressed stream does not
//! offer. So the content goes into a temporary file without a name, which the operating system deletes with its last
//! handle, even after a crash. Memory holds one block and the decoder's window.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::{env, fs};

use super::BagError;

/// Bytes that are decompressed at a time.
const BLOCK_BYTES: usize = 128 << 10;
/// Free space that stays on the disk, bytes.
const MIN_FREE_BYTES: u64 = 256 << 20;
/// Bytes that are written between two looks at the free space.
const LOOK_EVERY_BYTES: u64 = 16 << 20;

/// Content that any file may have, bytes.
const MIN_CONTENT_BYTES: u64 = 1 << 30;
/// Content of larger files, in multiples of their size. Images of a dark scene without noise reach a few hundred.
const MAX_RATIO: u64 = 1000;

/// The content of a compressed file.
#[derive(Debug)]
pub(super) struct Unpacked {
    pub(super) file: File,
    /// The reason why the content ends early; `None` if it is complete.
    pub(super) fault: Option<String>,
}

/// Decompresses a file. A damaged or truncated one gives the content before the damage.
///
/// # Errors
/// The file cannot be read, or there is no room for its content.
pub(super) fn unpack(path: &Path) -> Result<Unpacked, BagError> {
    unpack_within(path, MIN_CONTENT_BYTES)
}

/// Like [`unpack`]; content of up to `min_content_bytes` is never too much.
fn unpack_within(path: &Path, min_content_bytes: u64) -> Result<Unpacked, BagError> {
    let io_error = |source| BagError::Io { path: path.into(), source };
    let packed = File::open(path).map_err(io_error)?;
    let packed_bytes = packed.metadata().map_err(io_error)?.len();
    let max_bytes = packed_bytes.saturating_mul(MAX_RATIO).max(min_content_bytes);
    let mut content = zstd::Decoder::new(packed).map_err(io_error)?;
    let place = temporary_directory();
    let no_room = |what: String| {
        let place = place.display();
        io_error(io::Error::other(format!(
            "its content cannot be unpacked into {place}: {what}; set TMPDIR to a directory with more room"
        )))
    };
    let mut file = tempfile::tempfile_in(&place).map_err(|error| no_room(error.to_string()))?;
    let mut block = vec![0; BLOCK_BYTES];
    let (mut written_bytes, mut looked_bytes) = (0, 0);
    loop {
        if written_bytes >= looked_bytes {
            require_space(&place).map_err(|error| no_room(error.to_string()))?;
            looked_bytes = written_bytes + LOOK_EVERY_BYTES;
        }
        let num_read = match content.read(&mut block) {
            Ok(0) => return Ok(Unpacked { file, fault: None }),
            Ok(num_read) => num_read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Ok(Unpacked { file, fault: Some(error.to_string()) }),
        };
        if written_bytes + num_read as u64 > max_bytes {
            let fault = format!("more than {max_bytes} bytes in a file of {packed_bytes}");
            return Ok(Unpacked { file, fault: Some(fault) });
        }
        let (read, _) = block.split_at(num_read);
        file.write_all(read).map_err(|error| no_room(error.to_string()))?;
        written_bytes += num_read as u64;
    }
}

/// The directory that `TMPDIR` names, else `/var/tmp`, which is on a disk more often than `/tmp`.
fn temporary_directory() -> PathBuf {
    let on_disk = || Some(PathBuf::from("/var/tmp")).filter(|place| place.is_dir());
    let named = env::var_os("TMPDIR").filter(|name| !name.is_empty()).map(PathBuf::from);
    named.or_else(on_disk).unwrap_or_else(env::temp_dir)
}

fn require_space(place: &Path) -> io::Result<()> {
    let found = rustix::fs::statvfs(place)?;
    let free_bytes = found.f_bavail.saturating_mul(found.f_frsize);
    if free_bytes >= MIN_FREE_BYTES {
        return Ok(());
    }
    Err(io::Error::new(io::ErrorKind::StorageFull, format!("only {free_bytes} bytes are free")))
}

/// Size of a file on the disk, bytes; 0 if there is none.
pub(super) fn size_bytes(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |found| found.len())
}

#[cfg(test)]
mod tests {
    use std::io::{Seek, SeekFrom};

    use super::*;

    fn content(packed: &[u8]) -> (Vec<u8>, Option<String>) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.mcap.zstd");
        fs::write(&path, packed).unwrap();
        let mut unpacked = unpack(&path).unwrap();
        let mut found = Vec::new();
        unpacked.file.seek(SeekFrom::Start(0)).unwrap();
        unpacked.file.read_to_end(&mut found).unwrap();
        (found, unpacked.fault)
    }

    #[test]
    fn all_frames_of_a_file_are_unpacked() {
        let parts = [vec![1; 300_000], b"the second frame".to_vec(), vec![], vec![7; 5]];
        let packed = parts.each_ref().map(|part| zstd::encode_all(&part[..], 3).unwrap()).concat();
        assert_eq!(content(&packed), (parts.concat(), None));
    }

    #[test]
    fn content_out_of_proportion_is_not_unpacked() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.mcap.zstd");
        let packed = zstd::encode_all(&*vec![0; 64 << 20], 3).unwrap();
        fs::write(&path, &packed).unwrap();
        let limit_bytes = packed.len() as u64 * MAX_RATIO;
        assert!(limit_bytes < 64 << 20, "{limit_bytes}");
        let unpacked = unpack_within(&path, 1 << 20).unwrap();
        assert!(unpacked.fault.unwrap().contains("more than"));
        assert!(unpacked.file.metadata().unwrap().len() <= limit_bytes);
        assert_eq!(unpack(&path).unwrap().fault, None, "any file may have that much");
    }

    #[test]
    fn a_truncated_file_gives_what_is_before_its_end() {
        // Xorshift, because a constant would compress into one block.
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let original: Vec<_> = std::iter::repeat_with(|| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state as u8
        })
        .take(1 << 20)
        .collect();
        let packed = zstd::encode_all(&original[..], 1).unwrap();
        for length in [packed.len() / 3, packed.len() / 2, packed.len() - 1] {
            let (found, fault) = content(&packed[..length]);
            assert!(original.starts_with(&found), "{length}");
            assert!(length - found.len() < 300_000, "{length}: only {} bytes", found.len());
            assert!(fault.is_some(), "{length}");
        }
    }
}
