//! Makes a recording of pictures.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::record::RecordSummary;
use super::{
    BagError, BagReader, Filter, MetadataRecord, RecordError, RecordOptions, Recorder, Times, place,
};

/// Metadata record of a recording that was made of pictures.
const OWN_RECORD: &str = "pictures";
/// Key of the origin of the stamps in that record.
const STAMPS: &str = "stamps";
/// Value of that key if nothing states the time between two pictures.
const ASSUMED: &str = "assumed";
/// Maximum number of unusable pictures that are returned with their reasons.
const MAX_NAMED: usize = 10;

/// The reason that no recording was made.
#[derive(Debug, Error)]
pub(crate) enum ImportError {
    /// The input is a recording already.
    #[error("{}: is no series of pictures; recordings need no import", .0.display())]
    NotPictures(PathBuf),
    /// Several series have stamps that do not continue each other.
    #[error("{0} series of pictures: import them one by one, each into a recording of its own")]
    Several(usize),
    /// The output would replace the input.
    #[error("{0}; choose another output")]
    SamePlace(io::Error),
    /// Reading failed.
    #[error(transparent)]
    Read(#[from] BagError),
    /// Writing failed.
    #[error(transparent)]
    Write(#[from] RecordError),
}

/// Report of an import.
#[derive(Debug)]
pub(crate) struct Imported {
    /// The new recording.
    pub(crate) output: RecordSummary,
    /// Pictures in it.
    pub(crate) num_pictures: u64,
    /// Pictures that cannot be used.
    pub(crate) num_left_out: u64,
    /// The first of them, with their reasons.
    pub(crate) left_out: Vec<String>,
    /// True if it was interrupted.
    pub(crate) was_interrupted: bool,
}

/// Writes a series of pictures to a new recording, message by message as a replay of the pictures reads them.
///
/// PNG, JPEG and TIFF files are copied as they are, into compressed images; of BMP and PGM files the pixels are stored.
/// `go_on` is called with the number of pictures after each, and ends the import if it returns false.
///
/// # Errors
/// The input is no single series of pictures, or the output cannot be written.
pub(crate) fn import(
    inputs: &[BagReader],
    output: &Path,
    options: RecordOptions,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Imported, ImportError> {
    let [bag] = inputs else { return Err(ImportError::Several(inputs.len())) };
    if !bag.is_pictures() {
        return Err(ImportError::NotPictures(bag.path().into()));
    }
    place::refuse_same(bag.path(), output).map_err(ImportError::SamePlace)?;
    let mut recorder = Recorder::create(output, options)?;
    recorder.metadata(&description(bag))?;
    for topic in bag.topics() {
        recorder.add_topic(topic)?;
    }
    let (mut num_pictures, mut num_left_out, mut left_out) = (0, 0, Vec::new());
    let mut was_interrupted = false;
    let mut messages = bag.messages(&Filter::all());
    while let Some(item) = messages.next() {
        match item {
            Ok(message) => {
                let id = recorder.add_topic(&message.topic)?;
                let times = Times {
                    log_ns: message.log_time_ns,
                    publish_ns: message.publish_time_ns,
                    sequence: message.sequence,
                };
                recorder.write(id, times, &message.data)?;
                num_pictures += u64::from(bag.is_image(&message.topic));
                messages.recycle(message.data);
            }
            Err(error @ BagError::Picture { .. }) => {
                num_left_out += 1;
                if left_out.len() < MAX_NAMED {
                    left_out.push(error.to_string());
                }
            }
            Err(error) => return Err(error.into()),
        }
        if !go_on(num_pictures + num_left_out) {
            was_interrupted = true;
            break;
        }
    }
    let output = recorder.finish()?;
    Ok(Imported { output, num_pictures, num_left_out, left_out, was_interrupted })
}

fn description(bag: &BagReader) -> MetadataRecord {
    let stamps = if bag.has_assumed_stamps() { ASSUMED } else { "stated" };
    let entries = [("input", bag.name()), (STAMPS, stamps)];
    let entries = entries.map(|(key, value)| (key.to_owned(), value.to_owned()));
    MetadataRecord { name: OWN_RECORD.to_owned(), entries: BTreeMap::from(entries) }
}

/// Returns a recording's statement about its import: `None` if it was not made of pictures, otherwise true if the time between
/// two pictures is unknown.
pub(super) fn has_assumed_stamps(bag: &BagReader) -> Option<bool> {
    let mut records = bag.metadata().filter_map(Result::ok);
    let own = records.find(|record| record.name == OWN_RECORD)?;
    Some(own.entries.get(STAMPS).is_some_and(|stamps| stamps == ASSUMED))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bag::pictures;
    use crate::bag::{PictureOptions, ReadOptions};

    #[test]
    fn an_interrupted_import_is_a_recording_of_the_pictures_before() {
        let place = tempfile::tempdir().unwrap();
        let (folder, output) = (place.path().join("scan"), place.path().join("bag"));
        std::fs::create_dir(&folder).unwrap();
        for number in 0..5 {
            std::fs::write(folder.join(format!("{number}.pgm")), b"P5 1 1 255\n0").unwrap();
        }
        let read = ReadOptions::default();
        let inputs = pictures::open_all(&[folder], &read, &PictureOptions::default()).unwrap();
        let options = RecordOptions::default();
        let imported = import(&inputs, &output, options, &mut |num| num < 3).unwrap();
        assert_eq!((imported.num_pictures, imported.was_interrupted), (3, true));
        let bag = BagReader::open(&output, &read).unwrap();
        assert!(bag.is_indexed());
        assert_eq!(bag.messages(&Filter::all()).map(Result::unwrap).count(), 3);
    }
}
