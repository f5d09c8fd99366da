//! Waits for the disk to have what was written, so that the recording itself need not.

use std::{
    fs::File,
    io,
    sync::{Arc, Mutex},
    thread,
};

use crate::node::queue::{Bound, Queue, WhenFull};

use super::lock;

/// Files that wait; of more, the oldest are left to the operating system.
const BOUND: Bound = Bound { items: 8, bytes: 0 };

/// A thread that has files written to the disk, one after another. It ends behind the last one when this is dropped;
/// nobody waits for it, since a disk may hang.
pub(super) struct Syncer {
    files: Arc<Queue<File>>,
    fault: Arc<Mutex<Option<io::Error>>>,
}

impl Syncer {
    /// Starts the thread.
    pub(super) fn start() -> io::Result<Self> {
        let files = Arc::new(Queue::<File>::new(BOUND, WhenFull::DropOldest));
        let fault = Arc::new(Mutex::new(None));
        let syncer = Self { files: Arc::clone(&files), fault: Arc::clone(&fault) };
        thread::Builder::new().name("recording sync".to_owned()).spawn(move || {
            while let Some(file) = files.pop() {
                if let Err(error) = file.sync_data() {
                    lock(&fault).get_or_insert(error);
                }
            }
        })?;
        Ok(syncer)
    }

    /// Hands over a file.
    pub(super) fn sync(&self, file: File) {
        // The queue drops what it has no room for, and is closed by `drop` alone.
        let _num_dropped = self.files.push(file, 0);
    }

    /// Returns the disk error since the last call, if any.
    pub(super) fn take_fault(&self) -> Option<io::Error> {
        lock(&self.fault).take()
    }
}

impl Drop for Syncer {
    fn drop(&mut self) {
        self.files.close();
    }
}

#[cfg(test)]
mod tests {
    use std::{io::pipe, time::Duration};

    use super::*;

    #[test]
    fn a_fault_of_the_disk_is_handed_on() {
        let syncer = Syncer::start().unwrap();
        let (reader, _writer) = pipe().unwrap();
        // Nothing can be synchronised with a pipe.
        syncer.sync(File::from(std::os::fd::OwnedFd::from(reader)));
        let fault = std::iter::repeat_with(|| {
            thread::sleep(Duration::from_millis(1));
            syncer.take_fault()
        });
        assert!(fault.take(10_000).flatten().next().is_some());
    }
}
