//! A full disk: the error names the file, nothing panics, flushed messages are kept.

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use super::*;
use crate::bag::RecordError;

/// A disk of a given size.
#[derive(Clone)]
struct Disk {
    content: Arc<Mutex<Vec<u8>>>,
    size: usize,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut content = self.content.lock().unwrap();
        let room = (self.size - content.len()).min(bytes.len());
        if room == 0 && !bytes.is_empty() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        content.extend_from_slice(&bytes[..room]);
        Ok(room)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_disk_full_at_any_byte_keeps_all_flushed_messages() {
    let directory = tempfile::tempdir().unwrap();
    let large = Disk { content: Arc::default(), size: usize::MAX };
    assert_eq!(fill(large.clone(), directory.path()), (12, true));
    let whole = large.content.lock().unwrap().len();
    for size in (0..whole).step_by(7) {
        let disk = Disk { content: Arc::default(), size };
        let content = Arc::clone(&disk.content);
        let (flushed, is_finished) = fill(disk, directory.path());
        assert!(!is_finished, "{whole} bytes do not fit on {size}");
        let path = bare(directory.path(), &content.lock().unwrap());
        if let Ok((messages, errors)) = read_all(&path, &ReadOptions::default()) {
            assert!(
                messages.len() >= flushed,
                "{} of {flushed} flushed messages on {size} bytes",
                messages.len()
            );
            assert!(messages.len() == 12 || !errors.is_empty());
        } else {
            assert_eq!(flushed, 0, "unreadable with {size} bytes");
        }
    }
}

/// Records until the disk is full. Returns the number of flushed messages, and true if everything fitted.
fn fill(disk: Disk, directory: &Path) -> (usize, bool) {
    let name = "bag_0.mcap".to_owned();
    let Ok(mut recorder) = Recorder::on(Box::new(disk), directory, name, Compression::None) else {
        return (0, false);
    };
    let mut flushed = 0;
    let mut write_all = || {
        let topics = ["/image_raw", "/profile"].map(topic);
        let ids = [recorder.add_topic(&topics[0])?, recorder.add_topic(&topics[1])?];
        for (number, (topic, times, data)) in small_entries().iter().enumerate() {
            recorder.write(ids[*topic], *times, data)?;
            if number % 2 == 1 {
                recorder.flush()?;
                flushed = number + 1;
            }
        }
        Ok::<_, RecordError>(ids[0])
    };
    match write_all() {
        Ok(_) => {}
        Err(error) => {
            assert!(error.to_string().contains("bag_0.mcap"), "{error}");
            assert!(
                matches!(error, RecordError::Io { source, .. } if source.kind() == io::ErrorKind::StorageFull)
            );
            assert!(matches!(recorder.flush(), Err(RecordError::Stopped(_))));
            assert!(matches!(recorder.attach(&calibration()), Err(RecordError::Stopped(_))));
        }
    }
    (flushed, recorder.finish().is_ok())
}
