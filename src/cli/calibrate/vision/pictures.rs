//! Pictures of recordings and plain files, processed in parallel and returned in order.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError, mpsc},
    thread,
};

use anyhow::{Context, bail};

use crate::{
    bag::{
        BagReader, RawMessage,
        pictures::{self, PictureInput},
    },
    calibrate::GrayPicture,
    cli::{
        progress::progress_bar,
        recording::{Message, Recording, Wanted},
        settings::Settings,
    },
    msg::convert::picture_message,
    ros::camera_params::CameraParams,
    scanner::{
        image::{Image, OwnedImage},
        params::Params,
    },
};

/// Queue length per core.
const WAITING: usize = 2;

/// The pictures of all inputs.
pub(super) struct Pictures {
    sources: Vec<Source>,
    /// The node's parameters for these pictures.
    pub(super) params: CameraParams,
}

enum Source {
    Bag(String, Box<Recording>),
    Picture(PathBuf),
}

/// A picture and its result.
pub(super) struct View<T> {
    /// File name, or recording and frame number.
    pub(super) name: String,
    /// Time of the frame; the number of a plain picture.
    pub(super) stamp_ns: i64,
    /// The result, or the reason why there is none.
    pub(super) result: Result<T, String>,
}

/// A picture in the queue of a worker thread.
struct Task {
    index: usize,
    name: String,
    stamp_ns: i64,
    image: OwnedImage,
}

impl Pictures {
    /// Opens recordings, videos, pictures, patterns and folders of pictures. Pictures are in natural order.
    ///
    /// # Errors
    /// An input that cannot be opened or contains no pictures; [`Usage`](crate::cli::Usage) if a topic must be chosen.
    pub(super) fn open(inputs: &[PathBuf], settings: &Settings) -> anyhow::Result<Self> {
        let mut sources = Vec::new();
        let mut params = None;
        for input in pictures::sort(inputs)? {
            match input {
                PictureInput::Pictures(files, notes) => {
                    for note in notes {
                        tracing::warn!("{note}");
                    }
                    sources.extend(files.into_iter().map(Source::Picture));
                }
                PictureInput::Recording(path) => {
                    let recording = Recording::open(&path, settings)?;
                    params.get_or_insert_with(|| recording.camera.clone());
                    sources.push(Source::Bag(stem(&path), Box::new(recording)));
                }
            }
        }
        let params = match params {
            Some(params) => params,
            None => settings.camera(&[])?,
        };
        Ok(Self { sources, params })
    }

    /// Returns the topics of the given type in the recordings.
    pub(super) fn topics_of(&self, type_name: &str) -> Vec<String> {
        let bags = self.sources.iter().filter_map(|source| match source {
            Source::Bag(_, recording) => Some(&recording.bag),
            Source::Picture(_) => None,
        });
        let topics = bags.flat_map(BagReader::topics);
        let mut names: Vec<_> = topics
            .filter(|topic| topic.type_name == type_name)
            .map(|topic| topic.name.clone())
            .collect();
        names.sort();
        names.dedup();
        names
    }

    /// Returns the number of pictures if it is known.
    fn count(&self) -> Option<u64> {
        let counts = self.sources.iter().map(|source| match source {
            Source::Bag(_, recording) => recording.num_images(),
            Source::Picture(_) => Some(1),
        });
        counts.sum()
    }

    /// Processes every picture. The results are in the order of the pictures, on any number of cores.
    pub(super) fn map<T: Send>(
        &self,
        work: impl Fn(&Image<'_>) -> Result<T, String> + Sync,
    ) -> Vec<View<T>> {
        self.map_beside(None, |_| Ok(()), work)
    }

    /// Processes every picture, and passes the messages of another topic of the recordings to `on_other`.
    pub(super) fn map_beside<T: Send>(
        &self,
        other: Option<&str>,
        on_other: impl FnMut(&RawMessage) -> anyhow::Result<()>,
        work: impl Fn(&Image<'_>) -> Result<T, String> + Sync,
    ) -> Vec<View<T>> {
        let cores = thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let (sender, receiver) = mpsc::sync_channel::<Task>(WAITING * cores);
        let receiver = Mutex::new(receiver);
        let done = Mutex::new(Vec::new());
        let bar = progress_bar(self.count(), "pictures");
        let look = || {
            loop {
                let task = receiver.lock().unwrap_or_else(PoisonError::into_inner).recv();
                let Ok(Task { index, name, stamp_ns, image }) = task else { break };
                let view = View { name, stamp_ns, result: work(&image.view()) };
                done.lock().unwrap_or_else(PoisonError::into_inner).push((index, view));
                bar.inc(1);
            }
        };
        let unread = thread::scope(|scope| {
            (0..cores).for_each(|_| {
                scope.spawn(look);
            });
            let unread = self.read(other, on_other, &sender);
            drop(sender);
            unread
        });
        bar.finish_and_clear();
        let mut views = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        views.extend(unread);
        views.sort_by_key(|(index, _)| *index);
        views.into_iter().map(|(_, view)| view).collect()
    }

    /// Queues every picture that can be read; returns those that cannot.
    fn read<T>(
        &self,
        other: Option<&str>,
        mut on_other: impl FnMut(&RawMessage) -> anyhow::Result<()>,
        sender: &mpsc::SyncSender<Task>,
    ) -> Vec<(usize, View<T>)> {
        let mut unread = Vec::new();
        let mut index = 0;
        for source in &self.sources {
            match source {
                Source::Picture(path) => {
                    let (name, stamp_ns) = (path.display().to_string(), index as i64);
                    match self.picture(path) {
                        Ok(image) => {
                            // Workers run until this end is dropped.
                            let _sent = sender.send(Task { index, name, stamp_ns, image });
                        }
                        Err(error) => {
                            let result = Err(format!("{error:#}"));
                            unread.push((index, View { name, stamp_ns, result }));
                        }
                    }
                    index += 1;
                }
                Source::Bag(bag, recording) => {
                    let mut number = 0;
                    let read = recording.read(other, |message| {
                        match message {
                            Message::Other(message) => on_other(message)?,
                            Message::Frame(frame) => {
                                let image = OwnedImage::from(&frame.image);
                                let name = format!("{bag}:{number}");
                                let stamp_ns = frame.stamp_ns;
                                let _sent = sender.send(Task { index, name, stamp_ns, image });
                                (index, number) = (index + 1, number + 1);
                            }
                        }
                        Ok(Wanted::More)
                    });
                    if read.rejected > 0 {
                        let result = Err(format!("{} messages that cannot be read", read.rejected));
                        unread.push((index, View { name: bag.clone(), stamp_ns: 0, result }));
                        index += 1;
                    }
                }
            }
        }
        unread
    }

    fn picture(&self, path: &Path) -> anyhow::Result<OwnedImage> {
        let limit = self.params.max_frame_bytes;
        let length = fs::metadata(path).context("cannot be read")?.len();
        if length > limit {
            bail!("{length} bytes, more than max_frame_bytes, {limit}");
        }
        let data = fs::read(path).context("cannot be read")?;
        let mut pixels = Vec::new();
        Ok(OwnedImage::from(&picture_message::decode(&data, limit, &mut pixels)?))
    }
}

/// Converts a picture to 8-bit grey, the input of the detectors of boards and markers.
pub(super) fn gray(image: &Image<'_>, params: &Params) -> GrayPicture {
    let full_scale = params.full_scale_of(image.format());
    GrayPicture::from_image(image, full_scale.unwrap_or(image.format().white_level()))
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
