//! Compressed images of a recording are unpacked ahead of their workers, on every core: that takes longer than the
//! measurement. Workers take them in their order, so that nothing depends on which core was faster.

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
        convert::{
            FrameRejected,
            compressed::{self, Shape},
        },
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

/// Unpacked pictures take much memory, and beyond so many threads the file is read no faster.
const MAX_THREADS: usize = 8;

/// The pixels of a compressed image.
pub struct Picture {
    pixels: Vec<u8>,
    shape: Shape,
    took: Duration,
    /// Queue that takes back the memory of the pixels.
    home: Arc<Queue<Vec<u8>>>,
}

/// An image message, unpacked where that was possible: whoever takes one that was not finds out why.
pub struct Unpacked {
    /// The message.
    pub message: RawMessage,
    /// Its publisher.
    pub publisher: PublisherId,
    /// Its picture.
    pub picture: Option<Picture>,
}

/// A message whose picture is being unpacked.
#[derive(Debug)]
pub struct Ahead(Receiver<Unpacked>);

struct Job {
    message: RawMessage,
    publisher: PublisherId,
    max_frame_bytes: u64,
    done: SyncSender<Unpacked>,
}

/// The threads that unpack.
pub struct Unpacker {
    jobs: Queue<Job>,
    spare: Arc<Queue<Vec<u8>>>,
    num_threads: usize,
}

impl Picture {
    /// The picture as an image.
    ///
    /// # Errors
    /// None for what was unpacked.
    pub fn image(&self) -> Result<Image<'_>, FrameRejected> {
        self.shape.image(&self.pixels)
    }

    /// Duration of the unpacking.
    pub const fn took(&self) -> Duration {
        self.took
    }

    /// Gives its memory to one of the next.
    pub fn give_back(self) {
        // A closed or full queue: the memory is simply freed.
        _ = self.home.push(self.pixels, 0);
    }
}

impl Ahead {
    /// Waits for the picture. `None`: the thread that unpacked it is gone, and the message with it.
    pub fn wait(self) -> Option<Unpacked> {
        self.0.recv().ok()
    }
}

impl Unpacker {
    /// One thread a core.
    pub fn on_all_cores() -> Self {
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
    pub fn start<'scope>(&'scope self, scope: &'scope Scope<'scope, '_>) {
        for _ in 0..self.num_threads {
            named::spawn(scope, "unpack", || self.work());
        }
    }

    /// Pictures that may wait for a worker: enough to keep every thread busy.
    pub const fn num_ahead(&self) -> usize {
        self.num_threads + 1
    }

    /// Begins to unpack a message into a picture of at most `max_frame_bytes`. Waits while every thread is busy.
    ///
    /// # Errors
    /// The threads are gone.
    pub fn begin(
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

    /// Nothing more will come.
    pub fn close(&self) {
        self.jobs.close();
    }

    fn work(&self) {
        let _closed_at_the_end = CloseOnDrop(&self.jobs);
        while let Some(Job { message, publisher, max_frame_bytes, done }) = self.jobs.pop() {
            let picture = self.unpack(&message, max_frame_bytes);
            // The receiver is gone if its worker has failed, which reports that itself.
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
