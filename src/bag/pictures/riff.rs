//! Checks that an AVI file is whole. `ffmpeg` reads one that ends between two frames without a word, and the number of frames
//! that such a file states counts dropped ones.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Maximum number of chunks that are looked at: each holds up to 4 GiB.
const MAX_CHUNKS: usize = 4096;
/// Bytes before the content of a chunk: its name and its length.
const HEAD_BYTES: u64 = 8;

/// Number of bytes that are missing at the end of an AVI file; 0 for a file of another kind or without a stated length.
pub(super) fn missing_bytes(path: &Path) -> io::Result<u64> {
    let mut file = File::open(path)?;
    let file_bytes = file.metadata()?.len();
    let mut start = 0;
    // Files of more than some gigabytes are several chunks one after another.
    for _ in 0..MAX_CHUNKS {
        file.seek(SeekFrom::Start(start))?;
        let mut head = Vec::new();
        file.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
        let Some(&[b'R', b'I', b'F', b'F', a, b, c, d]) = head.first_chunk() else { break };
        let length = u32::from_le_bytes([a, b, c, d]);
        // Programs that did not finish a file, or could not go back in it, leave these.
        if length == 0 || length == u32::MAX {
            break;
        }
        let end = start + HEAD_BYTES + u64::from(length);
        if end > file_bytes {
            return Ok(end - file_bytes);
        }
        start = end.next_multiple_of(2);
    }
    Ok(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_missing_up_to_the_stated_length() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a.avi");
        let chunk = |length: u32| [&b"RIFF"[..], &length.to_le_bytes(), b"AVI 4567"].concat();
        for (content, missing) in [
            (chunk(8), 0),
            (chunk(7), 0),
            (chunk(20), 12),
            (chunk(0), 0),
            (chunk(u32::MAX), 0),
            ([chunk(8), chunk(9)].concat(), 1),
            ([chunk(8), b"an appendix".to_vec()].concat(), 0),
            (b"RIFF".to_vec(), 0),
            (b"\0\0\0 ftypisom".to_vec(), 0),
            (vec![], 0),
        ] {
            std::fs::write(&path, &content).unwrap();
            assert_eq!(missing_bytes(&path).unwrap(), missing, "{content:?}");
        }
        assert!(missing_bytes(&place.path().join("gone.avi")).is_err());
    }
}
