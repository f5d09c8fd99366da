//! A series of pictures: the order, stamp, number and position of each, and what all have in common.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::{KINDS, PictureError};
use super::natural;
use super::numbering::{Gap, Numbering};
use super::table::{Row, Table};
use crate::bag::Topic;
use crate::msg::convert::file_kind::FileKind;
use crate::msg::qos::QosProfile;
use crate::msg::schema::Message;
use crate::msg::sensor_msgs::{CompressedImage, Image, JointState};

/// Rate of pictures without a stated one, hertz. Nothing may depend on it but the order.
const ASSUMED_RATE_HZ: f64 = 10.0;
/// Depth of the topics' queues in the recorded quality of service.
const DEPTH: u64 = 10;
/// Gaps listed in a note.
const MAX_LISTED: usize = 4;
const NS: i64 = 1_000_000_000;

/// How pictures become a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureOptions {
    /// Pictures per second; `None` if unknown.
    pub frame_rate_hz: Option<f64>,
    /// CSV file with stamps and positions.
    pub positions: Option<PathBuf>,
}

/// One picture.
#[derive(Debug)]
pub(super) struct Entry {
    /// The file.
    pub(super) path: PathBuf,
    /// Number of its message, from 1; missing pictures have numbers, too.
    pub(super) sequence: u32,
    /// Its time, nanoseconds.
    pub(super) stamp_ns: i64,
    /// Position of the part, metres or radians.
    pub(super) position: Option<f64>,
    /// True if it is not in the table that states stamps and positions.
    pub(super) is_unlisted: bool,
}

/// A series of pictures.
#[derive(Debug)]
pub(in crate::bag) struct PictureSequence {
    pub(super) entries: Vec<Entry>,
    /// Columns and rows of the first readable picture; others of another size are rejected.
    pub(super) size_px: [u32; 2],
    /// Topic of the images: files as they are, or their pixels if no tool displays such files in a message.
    pub(super) images: Arc<Topic>,
    /// Topic of the positions, if there are any.
    pub(super) joints: Option<Arc<Topic>>,
    /// Size limit of a file and of its pixels, bytes.
    pub(super) limit_bytes: u64,
    has_assumed_stamps: bool,
}

impl PictureSequence {
    /// Orders pictures, which are in natural order, and looks at the first ones until one can be read.
    ///
    /// # Errors
    /// No picture can be read, or the table is wrong.
    pub(super) fn new(
        path: &Path,
        files: Vec<PathBuf>,
        options: &PictureOptions,
        limit_bytes: u64,
        notes: &mut Vec<String>,
    ) -> Result<Self, PictureError> {
        let table = options.positions.as_deref().map(Table::read).transpose()?;
        let rate_hz = options.frame_rate_hz.unwrap_or(ASSUMED_RATE_HZ);
        let has_stamps = table.as_ref().is_some_and(|table| table.has_stamps);
        let has_assumed_stamps = !has_stamps && options.frame_rate_hz.is_none();
        let has_positions = table.as_ref().is_some_and(|table| table.has_positions);
        let entries = match table {
            Some(table) => tabulated(files, table, rate_hz, notes),
            None => numbered(path, files, rate_hz, notes),
        };
        let (kind, size_px) = first_readable(&entries, limit_bytes)?;
        let topic = |name, kind| Arc::new(Topic::new(name, kind, QosProfile::reliable(DEPTH)));
        let images = match kind {
            FileKind::Png | FileKind::Jpeg | FileKind::Tiff => {
                topic("/image_raw/compressed", CompressedImage::TYPE)
            }
            FileKind::Bmp | FileKind::Pnm => topic("/image_raw", Image::TYPE),
        };
        let joints = has_positions.then(|| topic("/joint_states", JointState::TYPE));
        Ok(Self { entries, size_px, images, joints, limit_bytes, has_assumed_stamps })
    }

    /// Topics, sorted by name.
    pub(in crate::bag) fn topics(&self) -> Vec<Arc<Topic>> {
        [&self.images].into_iter().chain(&self.joints).map(Arc::clone).collect()
    }

    /// Number of messages by topic name.
    pub(in crate::bag) fn counts(&self) -> BTreeMap<&str, u64> {
        let num_images = self.num_pictures();
        let num_positions = self.entries.iter().filter(|entry| entry.position.is_some()).count();
        let joints = self.joints.iter().map(|topic| (topic.name.as_str(), num_positions as u64));
        [(self.images.name.as_str(), num_images)].into_iter().chain(joints).collect()
    }

    /// Number of pictures.
    pub(in crate::bag) fn num_pictures(&self) -> u64 {
        self.entries.len() as u64
    }

    /// True for the topic of the images.
    pub(in crate::bag) fn is_image(&self, topic: &Topic) -> bool {
        self.images.name == topic.name
    }

    /// Times of the first and last picture, nanoseconds.
    pub(in crate::bag) fn time_range_ns(&self) -> Option<RangeInclusive<i64>> {
        Some(self.entries.first()?.stamp_ns..=self.entries.last()?.stamp_ns)
    }

    /// True if nothing states the time between two pictures.
    pub(in crate::bag) const fn has_assumed_stamps(&self) -> bool {
        self.has_assumed_stamps
    }
}

/// Time of the picture with that number, from 1: a stamp of 0 would mean that the camera has no clock.
fn stamp_ns(sequence: u32, rate_hz: f64) -> i64 {
    (f64::from(sequence) / rate_hz * NS as f64).round() as i64
}

/// Pictures in the order of their names. Missing numbers are missing pictures.
fn numbered(path: &Path, files: Vec<PathBuf>, rate_hz: f64, notes: &mut Vec<String>) -> Vec<Entry> {
    let names: Vec<_> = files.iter().map(|path| path.as_os_str().as_encoded_bytes()).collect();
    let numbering = Numbering::of(&names);
    if let Some(numbering) = numbering.as_ref().filter(|numbering| !numbering.gaps.is_empty()) {
        notes.push(format!(
            "{}: {} pictures are missing by their numbers: {}; they count as lost, and the others keep their places",
            path.display(),
            numbering.num_missing(),
            listed(&numbering.gaps)
        ));
    }
    let place = |index: usize| {
        let of_number = numbering.as_ref().and_then(|numbering| numbering.places.get(index));
        of_number.copied().unwrap_or_else(|| u32::try_from(index).unwrap_or(u32::MAX))
    };
    let entry = |(index, path)| {
        let sequence = place(index).saturating_add(1);
        let stamp_ns = stamp_ns(sequence, rate_hz);
        Entry { path, sequence, stamp_ns, position: None, is_unlisted: false }
    };
    files.into_iter().enumerate().map(entry).collect()
}

fn listed(gaps: &[Gap]) -> String {
    let mut texts: Vec<_> = gaps
        .iter()
        .take(MAX_LISTED)
        .map(|&Gap { first, last, count }| match count {
            1 => first.to_string(),
            _ => format!("{first} to {last}"),
        })
        .collect();
    if gaps.len() > MAX_LISTED {
        texts.push(format!("and {} more gaps", gaps.len() - MAX_LISTED));
    }
    texts.join(", ")
}

/// Pictures in the order of the table's stamps, or of their names if it has none. Those that the table does not name
/// and those that it names in vain stay in the series: each is rejected with its reason when it is read.
fn tabulated(
    files: Vec<PathBuf>,
    table: Table,
    rate_hz: f64,
    notes: &mut Vec<String>,
) -> Vec<Entry> {
    let Table { path: of_table, mut rows, has_stamps, .. } = table;
    let folder = files.first().and_then(|path| path.parent()).unwrap_or(Path::new("")).to_owned();
    let mut pictures: Vec<(PathBuf, Option<Row>)> = files
        .into_iter()
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let row = rows.remove(&name).or_else(|| rows.remove(&*path.to_string_lossy()));
            (path, row)
        })
        .collect();
    pictures.extend(rows.into_iter().map(|(name, row)| (folder.join(name), Some(row))));
    let bytes = |path: &Path| path.as_os_str().as_encoded_bytes().to_vec();
    pictures.sort_by(|(first, _), (second, _)| natural::compare(&bytes(first), &bytes(second)));
    let mut shift_ns = 0;
    if has_stamps {
        // Pictures without a stamp come last; a stable sort keeps the order of their names.
        let stamp = |row: Option<Row>| row.and_then(|row| row.stamp_ns).unwrap_or(i64::MAX);
        pictures.sort_by_key(|(_, row)| stamp(*row));
        let first_ns = pictures.first().map_or(NS, |(_, row)| stamp(*row));
        if first_ns <= 0 {
            shift_ns = NS.saturating_sub(first_ns);
            notes.push(format!(
                "{}: the first stamp is not after 0, which means that a camera has no clock; all stamps are moved by {} s",
                of_table.display(),
                shift_ns as f64 / NS as f64
            ));
        }
    }
    let mut last_ns = 0;
    let entry = |(index, (path, row)): (usize, (PathBuf, Option<Row>))| {
        let sequence = u32::try_from(index).unwrap_or(u32::MAX).saturating_add(1);
        let Row { stamp_ns: stated_ns, position } = row.unwrap_or_default();
        let stamp_ns = match stated_ns {
            Some(stated_ns) => stated_ns.saturating_add(shift_ns),
            None if has_stamps => last_ns,
            None => stamp_ns(sequence, rate_hz),
        };
        last_ns = stamp_ns;
        Entry { path, sequence, stamp_ns, position, is_unlisted: row.is_none() }
    };
    pictures.into_iter().enumerate().map(entry).collect()
}

/// Kind and size of the first picture that can be read.
fn first_readable(
    entries: &[Entry],
    limit_bytes: u64,
) -> Result<(FileKind, [u32; 2]), PictureError> {
    let mut file = Vec::new();
    let mut first_fault = None;
    for entry in entries {
        match load(entry, limit_bytes, &mut file) {
            Ok(found) => return Ok(found),
            Err(why) => first_fault = first_fault.or_else(|| Some((entry.path.clone(), why))),
        }
    }
    let (first, why) = first_fault.unwrap_or_default();
    Err(PictureError::NoneReadable { num: entries.len(), first, why })
}

/// Reads a picture file into `file` and returns its kind and size.
///
/// # Errors
/// The reason why it cannot be read.
pub(super) fn load(
    entry: &Entry,
    limit_bytes: u64,
    file: &mut Vec<u8>,
) -> Result<(FileKind, [u32; 2]), String> {
    if entry.is_unlisted {
        return Err("is not named in the file of --positions".to_owned());
    }
    file.clear();
    let opened = File::open(&entry.path).map_err(|error| error.to_string())?;
    let length = opened.metadata().map_err(|error| error.to_string())?.len();
    if length > limit_bytes {
        return Err(format!(
            "has {length} bytes, more than the limit of {limit_bytes} (max_frame_bytes)"
        ));
    }
    file.reserve(length as usize);
    opened.take(limit_bytes).read_to_end(file).map_err(|error| error.to_string())?;
    let kind = FileKind::of(file).ok_or_else(|| match file.len() {
        0 => "is empty".to_owned(),
        _ => format!("is no picture: its first bytes are not those of {KINDS}"),
    })?;
    let size_px = kind.size_px(file).map_err(|error| format!("cannot be decoded: {error}"))?;
    Ok((kind, size_px))
}
