//! Syncs files to the disk on a thread of its own, so that the recording does not wait.

use std::{
    fs::File,
    io,
    sync::{Arc, Mutex},
    thread,
};

use crate::node::{
    queue::{Bound, Queue, WhenFull},
    watch::Watch,
};

use super::lock;

/// Bound of queued files. Beyond it the oldest are dropped, and the operating system writes them in its own time.
const BOUND: Bound = Bound { items: 8, bytes: 0 };

/// Handle of a thread that syncs files to the disk, one after another. After the handle is dropped, the thread syncs
/// the queued files and ends; dropping does not wait for it, because a disk may hang.
pub(super) struct Syncer {
    files: Arc<Queue<File>>,
    fault: Arc<Mutex<Option<io::Error>>>,
}

impl Syncer {
    /// Starts the thread.
    pub(super) fn start(watch: Watch) -> io::Result<Self> {
        let files = Arc::new(Queue::<File>::new(BOUND, WhenFull::DropOldest));
        let fault = Arc::new(Mutex::new(None));
        let syncer = Self { files: Arc::clone(&files), fault: Arc::clone(&fault) };
        thread::Builder::new().name("recording sync".to_owned()).spawn(move || {
            let _guard = watch.guard("the thread that syncs recordings to the disk");
            while let Some(file) = files.pop() {
                if let Err(error) = file.sync_data() {
                    lock(&fault).get_or_insert(error);
                }
            }
        })?;
        Ok(syncer)
    }

    /// Queues a file.
    pub(super) fn sync(&self, file: File) {
        // A dropped file is not an error, and only `drop` closes the queue.
        let _num_dropped = self.files.push(file, 0);
    }

    /// Returns the first disk error since the last call, if any.
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
    fn a_disk_error_is_reported() {
        let syncer = Syncer::start(Watch::default()).unwrap();
        let (reader, _writer) = pipe().unwrap();
        // Syncing a pipe fails.
        syncer.sync(File::from(std::os::fd::OwnedFd::from(reader)));
        let fault = std::iter::repeat_with(|| {
            thread::sleep(Duration::from_millis(1));
            syncer.take_fault()
        });
        assert!(fault.take(10_000).flatten().next().is_some());
    }
}
