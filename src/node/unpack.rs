//! Decompresses images of a recording ahead of their workers, on every core, because that takes longer than the
//! measurement. Workers process them in order, so that results do not depend on thread timing.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::{self, Scope},
    time::{Duration, Instant},
};

use crate::{
    bag::RawMessage,
    msg::{
        cdr,
        convert::{FrameRejected, compressed, decode::Shape},
        sensor_msgs::CompressedImage,
    },
    scanner::image::Image,
};

use super::{
    fan_out::CloseOnDrop,
    named,
    queue::{Bound, Closed, Popped, Queue, WhenFull},
    source::PublisherId,
};

/// Maximum number of threads: decompressed images need much memory, and more threads do not read the file faster.
const MAX_THREADS: usize = 8;

/// The pixels of a compressed image.
pub(crate) struct Picture {
    pixels: Vec<u8>,
    shape: Shape,
    took: Duration,
    /// Queue that takes back the memory of the pixels.
    home: Arc<Queue<Vec<u8>>>,
}

/// An image message, decompressed if possible. Otherwise the worker decodes it and reports the reason.
pub(crate) struct Unpacked {
    /// The message.
    pub(crate) message: RawMessage,
    /// Its publisher.
    pub(crate) publisher: PublisherId,
    /// Its decompressed image, if any.
    pub(crate) picture: Option<Picture>,
}

/// A message whose image is being decompressed.
#[derive(Debug)]
pub(crate) struct Ahead(Receiver<Unpacked>);

struct Job {
    message: RawMessage,
    publisher: PublisherId,
    max_frame_bytes: u64,
    done: SyncSender<Unpacked>,
}

/// A pool of threads that decompress images.
pub(crate) struct Unpacker {
    jobs: Queue<Job>,
    spare: Arc<Queue<Vec<u8>>>,
    num_threads: usize,
}

impl Picture {
    /// Returns the decompressed pixels as an image.
    ///
    /// # Errors
    /// None for decompressed pixels.
    pub(crate) fn image(&self) -> Result<Image<'_>, FrameRejected> {
        self.shape.image(&self.pixels)
    }

    /// Returns the duration of the decompression.
    pub(crate) const fn took(&self) -> Duration {
        self.took
    }

    /// Returns its memory for reuse.
    pub(crate) fn give_back(self) {
        // If the queue is closed or full, the memory is freed.
        _ = self.home.push(self.pixels, 0);
    }
}

impl Ahead {
    /// Waits for the image. Returns `None` if the decompressing thread has ended, which loses the message.
    pub(crate) fn wait(self) -> Option<Unpacked> {
        self.0.recv().ok()
    }
}

impl Unpacker {
    /// Creates a pool with one thread per core.
    pub(crate) fn on_all_cores() -> Self {
        let num_threads = thread::available_parallelism().map_or(1, usize::from).min(MAX_THREADS);
        Self {
            jobs: Queue::new(Bound { items: num_threads, bytes: usize::MAX }, WhenFull::Wait),
            spare: Arc::new(Queue::new(
                Bound { items: num_threads + 1, bytes: 0 },
                WhenFull::DropOldest,
            )),
            num_threads,
        }
    }

    /// Starts the threads; they end after [`close`](Self::close).
    pub(crate) fn start<'scope>(&'scope self, scope: &'scope Scope<'scope, '_>) {
        for _ in 0..self.num_threads {
            named::spawn(scope, "unpack", || self.work());
        }
    }

    /// Returns the number of images that may wait for a worker: enough to keep every thread busy.
    pub(crate) const fn num_ahead(&self) -> usize {
        self.num_threads + 1
    }

    /// Starts to decompress a message into an image of at most `max_frame_bytes`. Waits while every thread is busy.
    ///
    /// # Errors
    /// The threads have ended.
    pub(crate) fn begin(
        &self,
        message: RawMessage,
        publisher: PublisherId,
        max_frame_bytes: u64,
    ) -> Result<Ahead, Closed<()>> {
        let (done, unpacked) = sync_channel(1);
        let job = Job { message, publisher, max_frame_bytes, done };
        self.jobs.push(job, 0).map_err(|Closed(_)| Closed(()))?;
        Ok(Ahead(unpacked))
    }

    /// Closes the pool for further messages.
    pub(crate) fn close(&self) {
        self.jobs.close();
    }

    fn work(&self) {
        let _closed_at_the_end = CloseOnDrop(&self.jobs);
        while let Some(Job { message, publisher, max_frame_bytes, done }) = self.jobs.pop() {
            let picture = self.unpack(&message, max_frame_bytes);
            // The receiver no longer exists if its worker has failed; the worker reports that itself.
            _ = done.send(Unpacked { message, publisher, picture });
        }
    }

    fn unpack(&self, message: &RawMessage, max_frame_bytes: u64) -> Option<Picture> {
        let started = Instant::now();
        let mut pixels = match self.spare.pop_counted(Some(started)) {
            Popped::Item(pixels, _) => pixels,
            Popped::TimedOut | Popped::Closed => Vec::new(),
        };
        let message: CompressedImage<'_> = cdr::decode(&message.data).ok()?;
        let shape = compressed::unpack(&message, max_frame_bytes, &mut pixels).ok()?;
        Some(Picture { pixels, shape, took: started.elapsed(), home: Arc::clone(&self.spare) })
    }
}
