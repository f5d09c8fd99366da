//! Pictures as a recording: a folder, several files or a pattern; and videos. Memory holds their names and one of them at
//! a time.

mod natural;
mod numbering;
mod error;
mod table;
mod find;
mod sequence;
mod messages;
mod ffmpeg;
mod riff;
mod video;
mod series;

pub use error::PictureError;
pub(super) use sequence::ASSUMED_RATE_HZ;
pub use sequence::PictureOptions;
pub(super) use series::{Series, SeriesMessages};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(crate) use find::is_picture;
use find::{Found, Input};
use sequence::PictureSequence;
use table::Table;
use video::Video;

use super::{BagError, BagReader, ReadOptions, Topic};
use crate::msg::{qos::QosProfile, schema::MessageType};

/// Coordinate frame of the images.
const FRAME_ID: &str = "camera";
/// Depth of the topics' queues in the recorded quality of service.
const DEPTH: u64 = 10;
const NS: f64 = 1e9;

/// A topic of images or positions.
fn topic(name: &str, kind: &MessageType) -> Arc<Topic> {
    Arc::new(Topic::new(name, kind, QosProfile::reliable(DEPTH)))
}

/// Time of the image with that number, from 1, in nanoseconds: a stamp of 0 would mean that the camera has no clock.
fn stamp_ns(number: u32, rate_hz: f64) -> i64 {
    (f64::from(number) / rate_hz * NS).round() as i64
}

/// Opens inputs in order: recordings, folders of pictures, videos, and all single pictures together as one series in the
/// place of the first of them. Patterns (`*`, `?`, `[...]`) are expanded.
///
/// # Errors
/// An input that cannot be opened; options for pictures without pictures.
pub(crate) fn open_all(
    paths: &[PathBuf],
    options: &ReadOptions,
    pictures: &PictureOptions,
) -> Result<Vec<BagReader>, BagError> {
    let inputs = find::sort(paths)?;
    let of_pictures = |input: &&Input| matches!(input, Input::Pictures(_));
    let num_series = inputs.iter().filter(of_pictures).count();
    let num_recordings = inputs.iter().filter(|input| matches!(input, Input::Recording(_))).count();
    if num_recordings == inputs.len() && *pictures != PictureOptions::default() {
        return Err(PictureError::NotPictures.into());
    }
    if let Some(Input::Video(path)) = inputs.iter().find(|input| matches!(input, Input::Video(_)))
        && pictures.positions.is_some()
    {
        return Err(PictureError::TableOfVideo(path.clone()).into());
    }
    if num_series > 1 && pictures.positions.is_some() {
        return Err(PictureError::SeveralSeries(num_series).into());
    }
    inputs.into_iter().map(|input| open_input(input, options, pictures)).collect()
}

/// An input of a command that reads picture files by itself.
#[derive(Debug)]
pub(crate) enum PictureInput {
    /// A series of pictures in natural order, and notes for the user about it.
    Pictures(Vec<PathBuf>, Vec<String>),
    /// Anything else: see [`open`].
    Recording(PathBuf),
}

/// Sorts inputs like [`open_all`] and opens none.
///
/// # Errors
/// A folder that cannot be read or has neither a recording nor pictures; a pattern without a match.
pub(crate) fn sort(paths: &[PathBuf]) -> Result<Vec<PictureInput>, PictureError> {
    let sorted = |input| match input {
        Input::Pictures(Found { pictures, notes, .. }) => PictureInput::Pictures(pictures, notes),
        Input::Video(path) | Input::Recording(path) => PictureInput::Recording(path),
    };
    Ok(find::sort(paths)?.into_iter().map(sorted).collect())
}

/// Returns the positions that a table states, by the name of their picture.
///
/// # Errors
/// The table cannot be read, or it states none.
pub(crate) fn stated_positions(table: &Path) -> Result<BTreeMap<String, f64>, PictureError> {
    let Table { rows, has_positions, .. } = Table::read(table)?;
    if !has_positions {
        let what = "the column position is missing".to_owned();
        return Err(PictureError::Table { path: table.into(), line: 1, what });
    }
    Ok(rows.into_iter().filter_map(|(name, row)| Some((name, row.position?))).collect())
}

/// Opens one input like [`open_all`], with the default stamps.
///
/// # Errors
/// The input cannot be opened, or is a pattern that matches several.
pub(crate) fn open(path: &Path, options: &ReadOptions) -> Result<BagReader, BagError> {
    let mut inputs = find::sort(&[path.into()])?;
    match (inputs.pop(), inputs.is_empty()) {
        (Some(input), true) => open_input(input, options, &PictureOptions::default()),
        (last, _) => {
            inputs.extend(last);
            let (pattern, matches) = (path.display().to_string(), find::listed_inputs(&inputs));
            Err(PictureError::SeveralMatches { pattern, matches }.into())
        }
    }
}

fn open_input(
    input: Input,
    options: &ReadOptions,
    pictures: &PictureOptions,
) -> Result<BagReader, BagError> {
    let limit_bytes = options.max_frame_bytes;
    match input {
        Input::Recording(path) => BagReader::open(&path, options),
        Input::Pictures(Found { path, name, pictures: files, mut notes }) => {
            let sequence = PictureSequence::new(&path, files, pictures, limit_bytes, &mut notes)?;
            let series = Series::Pictures(Arc::new(sequence));
            Ok(BagReader::of_series((path, name), series, notes, *options))
        }
        Input::Video(path) => {
            let mut notes = Vec::new();
            let video = Video::open(&path, pictures.frame_rate_hz, limit_bytes, &mut notes)?;
            let name = find::name_of(&path);
            let series = Series::Video(Arc::new(video));
            Ok(BagReader::of_series((path, name), series, notes, *options))
        }
    }
}
