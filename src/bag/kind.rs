//! Recognises a file by its first bytes, whatever its name.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::MAGIC;

/// First bytes of a Zstandard frame.
pub(super) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";
const ROS1_MAGIC: &[u8] = b"#ROSBAG V";
const GZIP_MAGIC: &[u8] = &[0x1f, 0x8b];
/// The longest of these.
const START_BYTES: u64 = 16;
/// Ends of the names of recordings.
const ENDINGS: [&str; 3] = ["mcap", "db3", "bag"];
/// End of the names of files that are compressed as a whole.
const PACKED_ENDING: &str = "zstd";
/// Among more other files, only those named as recordings or as compressed are looked at.
const MAX_LOOKED_AT: usize = 1024;

/// Content of a file, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// An MCAP recording.
    Mcap,
    /// `SQLite`, the storage of rosbag2 before MCAP.
    Sqlite,
    /// A ROS 1 recording.
    Ros1,
    /// A file packed by gzip.
    Gzip,
    /// Fewer bytes than the MCAP signature has.
    Short,
    /// No bytes.
    Empty,
    /// None of these.
    Other,
}

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    /// True if the file is compressed as a whole, as in rosbag2's compression mode FILE.
    pub(super) is_packed: bool,
    /// The content, decompressed.
    pub(super) content: Content,
}

impl Kind {
    /// Recognises a file.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        let start = start_of(File::open(path)?)?;
        if !start.starts_with(&ZSTD_MAGIC) {
            return Ok(Self { is_packed: false, content: content(&start) });
        }
        let unpacked = start_of(zstd::Decoder::new(File::open(path)?)?);
        // A damaged file still is what its signature says.
        let content = unpacked.map_or(Content::Other, |start| content(&start));
        Ok(Self { is_packed: true, content })
    }

    /// True if the file is read.
    pub(super) fn is_readable(self) -> bool {
        self.content == Content::Mcap
    }

    /// The reason why a file of this kind is not read; without its name.
    pub(super) fn refusal(self) -> String {
        let why = match self.content {
            Content::Mcap => "it is an MCAP file",
            Content::Sqlite => "it is an SQLite recording of rosbag2, which is not read",
            Content::Ros1 => "it is a recording of ROS 1, which is not read",
            Content::Gzip => "it is compressed by gzip; unpack it with gunzip",
            Content::Short => {
                "not an MCAP file: it is shorter than the eight bytes of the MCAP signature"
            }
            Content::Empty => "not an MCAP file: the file is empty",
            Content::Other => "not an MCAP file: the first eight bytes are not the MCAP signature",
        };
        if self.is_packed { format!("decompressed, {why}") } else { why.to_owned() }
    }
}

/// The recordings among the files of a directory, with their kinds: those that begin as one, and those that are named as
/// one, because a recording may be empty or damaged.
pub(super) fn recordings(mut paths: Vec<PathBuf>) -> Vec<(PathBuf, Kind)> {
    // A directory, a pipe or a device is no recording.
    paths.retain(|path| path.is_file());
    let is_likely = |path: &PathBuf| is_named_recording(path) || has_ending(path, PACKED_ENDING);
    if paths.iter().filter(|path| !is_likely(path)).count() > MAX_LOOKED_AT {
        paths.retain(is_likely);
    }
    // A file that cannot be opened is as good as an unknown one; it is named if it matters.
    let unknown = Kind { is_packed: false, content: Content::Other };
    let with_kind = |path: PathBuf| (Kind::of(&path).unwrap_or(unknown), path);
    let is_recording = |(path, kind): &(PathBuf, Kind)| {
        is_named_recording(path)
            || matches!(kind.content, Content::Mcap | Content::Sqlite | Content::Ros1)
    };
    let files = paths.into_iter().map(with_kind).map(|(kind, path)| (path, kind));
    files.filter(is_recording).collect()
}

/// True for the name of a recording, packed or not. Other packed files, such as archives, are not.
fn is_named_recording(path: &Path) -> bool {
    let unpacked = path.with_extension("");
    let path = if has_ending(path, PACKED_ENDING) { &unpacked } else { path };
    ENDINGS.iter().any(|ending| has_ending(path, ending))
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|extension| extension == ending)
}

fn start_of(file: impl Read) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    file.take(START_BYTES).read_to_end(&mut start)?;
    Ok(start)
}

fn content(start: &[u8]) -> Content {
    match start {
        [] => Content::Empty,
        start if start.starts_with(MAGIC) => Content::Mcap,
        start if start.starts_with(SQLITE_MAGIC) => Content::Sqlite,
        start if start.starts_with(ROS1_MAGIC) => Content::Ros1,
        start if start.starts_with(GZIP_MAGIC) => Content::Gzip,
        start if start.len() < MAGIC.len() => Content::Short,
        _ => Content::Other,
    }
}

/// True if the writer of an MCAP file finished it.
pub(super) fn is_finished(path: &Path) -> bool {
    let read = || {
        let mut file = BufReader::new(File::open(path)?);
        let mut end = [0; MAGIC.len()];
        file.seek(SeekFrom::End(-(MAGIC.len() as i64)))?;
        file.read_exact(&mut end)?;
        io::Result::Ok(end == MAGIC)
    };
    read().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_bytes_decide_and_not_the_name() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.mcap");
        let packed = |content: &[u8]| zstd::encode_all(content, 1).unwrap();
        let kind = |is_packed, content| Kind { is_packed, content };
        for (bytes, expected) in [
            (MAGIC.to_vec(), kind(false, Content::Mcap)),
            (b"SQLite format 3\0and its pages".to_vec(), kind(false, Content::Sqlite)),
            (b"#ROSBAG V2.0\nand its records".to_vec(), kind(false, Content::Ros1)),
            (vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3], kind(false, Content::Gzip)),
            (b"abc".to_vec(), kind(false, Content::Short)),
            (vec![], kind(false, Content::Empty)),
            (b"a diary of a scan".to_vec(), kind(false, Content::Other)),
            (packed(&[MAGIC, b"and records"].concat()), kind(true, Content::Mcap)),
            (packed(b"SQLite format 3\0and its pages"), kind(true, Content::Sqlite)),
            (packed(b""), kind(true, Content::Empty)),
            (ZSTD_MAGIC.to_vec(), kind(true, Content::Other)),
        ] {
            std::fs::write(&path, &bytes).unwrap();
            assert_eq!(Kind::of(&path).unwrap(), expected, "{bytes:?}");
        }
    }
}
