//! A series of pictures: the order, stamp, number and position of each, and what all have in common.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::PictureError;
use super::find::{name_of, without_ending};
use super::natural;
use super::numbering::{self, Gap, Numbering};
use super::table::{Row, Table};
use super::{stamp_ns, topic};
use crate::bag::Topic;
use crate::bag::unpack::size_bytes;
use crate::msg::convert::{FrameRejected, file_kind::FileKind};
use crate::msg::schema::Message;
use crate::msg::sensor_msgs::{CompressedImage, Image, JointState};

/// Rate of pictures without a stated one, hertz. Nothing may depend on it but the order.
pub(in crate::bag) const ASSUMED_RATE_HZ: f64 = 10.0;
/// Gaps listed in a note.
const MAX_LISTED: usize = 4;
const NS: i64 = 1_000_000_000;
/// Why a picture is rejected that no row names.
const NOT_NAMED: &str =
    "is not named in the file of --positions, or only by a name that another picture has, too";
/// Why a picture is rejected that only a row names.
const NOT_GIVEN: &str =
    "is named in the file of --positions, but is none of the pictures to be read";

/// How pictures become a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureOptions {
    /// Pictures per second; `None` if unknown.
    pub frame_rate_hz: Option<f64>,
    /// CSV file with stamps and positions.
    pub positions: Option<PathBuf>,
}

/// One picture.
#[derive(Debug, Default)]
pub(super) struct Entry {
    /// The file.
    pub(super) path: PathBuf,
    /// Number of its message, from 1; missing pictures have numbers, too.
    pub(super) sequence: u32,
    /// Its time, nanoseconds.
    pub(super) stamp_ns: i64,
    /// Position of the part, metres or radians.
    pub(super) position: Option<f64>,
    /// The reason not to read it, if it does not fit the table of stamps and positions.
    pub(super) refusal: Option<&'static str>,
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
        if let Some(table) = &table {
            table.check(&files)?;
            notes.extend(table.ignored_columns());
        }
        let entries = match table {
            Some(Table { path: of_table, rows, has_stamps: true, .. }) => {
                stamped(tabulated(files, rows), &of_table, notes)
            }
            Some(Table { rows, .. }) => {
                let entries = tabulated(files, rows).into_iter().map(|(entry, _)| entry);
                numbered(path, entries.collect(), rate_hz, notes)
            }
            None => {
                let entries = files.into_iter().map(|path| Entry { path, ..Entry::default() });
                numbered(path, entries.collect(), rate_hz, notes)
            }
        };
        let (kind, size_px) = first_readable(&entries, limit_bytes)?;
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

    /// Size of the files that are there, bytes.
    pub(in crate::bag) fn num_bytes(&self) -> u64 {
        self.entries.iter().map(|entry| size_bytes(&entry.path)).sum()
    }

    /// True if nothing states the time between two pictures.
    pub(in crate::bag) const fn has_assumed_stamps(&self) -> bool {
        self.has_assumed_stamps
    }
}

/// Gives pictures in the order of their names the numbers in them, and stamps. Missing numbers are missing pictures.
fn numbered(
    path: &Path,
    mut entries: Vec<Entry>,
    rate_hz: f64,
    notes: &mut Vec<String>,
) -> Vec<Entry> {
    // Pictures of one series may have several endings.
    let stems: Vec<_> = entries.iter().map(|entry| without_ending(&entry.path)).collect();
    let names: Vec<_> = stems.iter().map(|stem| stem.as_os_str().as_encoded_bytes()).collect();
    let numbering = Numbering::of(&names);
    match &numbering {
        Some(numbering) if !numbering.gaps.is_empty() => notes.push(format!(
            "{}: pictures are missing by their numbers: {} ({}); they count as lost, and the others keep their places",
            path.display(),
            numbering.num_missing(),
            listed(&numbering.gaps)
        )),
        Some(_) => {}
        None => notes.extend(numbering::fault(&names).map(|fault| {
            format!(
                "{}: {fault}: missing numbers are not looked for, and each picture is one step after the one before",
                path.display()
            )
        })),
    }
    for (index, entry) in entries.iter_mut().enumerate() {
        let of_number = numbering.as_ref().and_then(|numbering| numbering.places.get(index));
        entry.sequence =
            of_number.map_or_else(|| one_based(index), |place| place.saturating_add(1));
        entry.stamp_ns = stamp_ns(entry.sequence, rate_hz);
    }
    entries
}

fn one_based(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX).saturating_add(1)
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

/// Pictures in the order of their names, each with its row. Those that the table does not name and those that it names in
/// vain stay in the series: each is rejected with its reason when it is read.
fn tabulated(files: Vec<PathBuf>, mut rows: BTreeMap<String, Row>) -> Vec<(Entry, Row)> {
    let folder = files.first().and_then(|path| path.parent()).unwrap_or(Path::new("")).to_owned();
    let entry = |path, row: Row, refusal: Option<_>| {
        let position = row.position.filter(|_| refusal.is_none());
        (Entry { path, position, refusal, ..Entry::default() }, row)
    };
    let mut num_named = BTreeMap::<_, usize>::new();
    for path in &files {
        *num_named.entry(name_of(path)).or_default() += 1;
    }
    let is_unique = |name: &str| num_named.get(name).is_none_or(|num| *num == 1);
    let mut of_file = |path: PathBuf| {
        let name = name_of(&path);
        let by_name = || Some(name).filter(|name| is_unique(name));
        let row = rows.remove(&*path.to_string_lossy());
        let row = row.or_else(|| by_name().and_then(|name| rows.remove(&name)));
        entry(path, row.unwrap_or_default(), row.is_none().then_some(NOT_NAMED))
    };
    let mut entries: Vec<_> = files.into_iter().map(&mut of_file).collect();
    rows.retain(|name, _| is_unique(name));
    entries.extend(rows.into_iter().map(|(name, row)| {
        let path = folder.join(name);
        let is_there = path.symlink_metadata().is_ok();
        entry(path, row, is_there.then_some(NOT_GIVEN))
    }));
    let bytes = |path: &Path| path.as_os_str().as_encoded_bytes().to_vec();
    entries.sort_by(|(first, _), (second, _)| {
        natural::compare(&bytes(&first.path), &bytes(&second.path))
    });
    entries
}

/// Pictures in the order of the table's stamps.
fn stamped(mut rows: Vec<(Entry, Row)>, of_table: &Path, notes: &mut Vec<String>) -> Vec<Entry> {
    // Pictures without a stamp come last; a stable sort keeps the order of their names.
    let stamp = |row: &Row| row.stamp_ns.unwrap_or(i64::MAX);
    rows.sort_by_key(|(_, row)| stamp(row));
    let first_ns = rows.first().map_or(NS, |(_, row)| stamp(row));
    let shift_ns = if first_ns > 0 { 0 } else { NS.saturating_sub(first_ns) };
    if shift_ns > 0 {
        notes.push(format!(
            "{}: the first stamp is not after 0, which means that a camera has no clock; all stamps are moved by {} s",
            of_table.display(),
            shift_ns as f64 / NS as f64
        ));
    }
    let mut last_ns = 0;
    let entry = |(index, (entry, row)): (usize, (Entry, Row))| {
        last_ns = row.stamp_ns.map_or(last_ns, |stamp_ns| stamp_ns.saturating_add(shift_ns));
        Entry { sequence: one_based(index), stamp_ns: last_ns, ..entry }
    };
    rows.into_iter().enumerate().map(entry).collect()
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
    if let Some(refusal) = entry.refusal {
        return Err(refusal.to_owned());
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
        _ => FrameRejected::NoPicture.to_string(),
    })?;
    let size_px = kind.size_px(file).map_err(|error| format!("cannot be decoded: {error}"))?;
    if kind.is_cut_off(file) {
        return Err(format!("is cut off: a {kind} file of {length} bytes without its end"));
    }
    Ok((kind, size_px))
}
