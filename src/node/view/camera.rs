//! Display of one camera's images: at full size, or as small previews at a limited rate with their centrelines.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use crate::{
    bag::Topic,
    foxglove::{Channel, Server, ViewError},
    msg::{
        builtin_interfaces::Time,
        cdr::{self, CdrError},
        convert::{FrameRejected, compressed, frame, preview},
        foxglove_msgs::ImageAnnotations,
        schema::Message,
        sensor_msgs::{CompressedImage, Image},
    },
    node::topics::of_camera,
    ros::{names::NodeNames, node_params::ImageTransport},
};

use super::{Images, serve_recorded, serve_type};

/// Minimum time between two previews.
pub(super) const PREVIEW_GAP: Duration = Duration::from_nanos(1_000_000_000 / 15);
/// Maximum number of previews that may still receive their centreline.
const MAX_CHOSEN: usize = 16;

/// An image message as received.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraImage<'a> {
    /// CDR bytes with their header.
    pub(super) data: &'a [u8],
    /// Image transport.
    pub(super) transport: ImageTransport,
    /// Time of reception, nanoseconds since the epoch.
    pub(super) time_ns: i64,
}

/// The viewer channels of a camera.
pub(super) struct CameraView {
    /// Channels of the previews and of their annotations.
    small: Option<[Arc<Channel>; 2]>,
    /// Channel of the full images.
    full: Option<Mutex<Option<Arc<Channel>>>>,
    max_frame_bytes: u64,
    choice: Mutex<Choice>,
    work: Mutex<Work>,
}

/// Selection of the images to show.
#[derive(Default)]
struct Choice {
    last: Option<Instant>,
    stamps: VecDeque<Time>,
    /// Side of the square of image pixels that becomes one preview pixel; 0 if unknown.
    factor: u32,
}

#[derive(Default)]
struct Work {
    pixels: Vec<u8>,
    small: Vec<u8>,
    bytes: Vec<u8>,
}

impl CameraView {
    /// Serves the images of a camera of this name. Images of more than `max_frame_bytes` are not shown.
    pub(super) fn open(
        server: &Server,
        names: &NodeNames,
        camera: &str,
        max_frame_bytes: u64,
        images: Images,
    ) -> Result<Self, ViewError> {
        let open = |name: &str, kind| {
            let name = of_camera(camera, name);
            // A remap rule that makes this name invalid also invalidates the names of the results, which report it.
            let name = names.resolve(&name).unwrap_or(name);
            serve_type(server, &name, kind, 0)
        };
        let small = match images {
            Images::Preview => Some([
                open("~/preview", Image::TYPE)?,
                open("~/preview_annotations", ImageAnnotations::TYPE)?,
            ]),
            Images::Full | Images::None => None,
        };
        let full = (images == Images::Full).then(Mutex::default);
        let (choice, work) = (Mutex::default(), Mutex::default());
        Ok(Self { small, full, max_frame_bytes, choice, work })
    }

    /// Serves the full images on their own topic if they were requested.
    pub(super) fn serve_full(&self, server: &Server, topic: &Topic) -> Result<(), ViewError> {
        if let Some(full) = &self.full {
            let channel = serve_recorded(server, topic)?;
            *lock(full) = Some(channel);
        }
        Ok(())
    }

    /// True if an image should be shown: a viewer has subscribed, and the last image was shown at least `min_gap` ago.
    pub(super) fn choose(&self, image: &CameraImage<'_>, min_gap: Duration) -> bool {
        if let Some(full) = &self.full {
            return lock(full).as_ref().is_some_and(|channel| channel.is_wanted());
        }
        let is_wanted = |[pictures, _]: &[Arc<Channel>; 2]| pictures.is_wanted();
        if !self.small.as_ref().is_some_and(is_wanted) {
            return false;
        }
        let mut choice = lock(&self.choice);
        let now = Instant::now();
        if choice.last.is_some_and(|last| now - last < min_gap) {
            return false;
        }
        let Ok((stamp, width)) = stamp_and_width(image) else { return false };
        choice.last = Some(now);
        if let Some(width) = width {
            choice.factor = preview::factor(width);
        }
        if choice.stamps.len() == MAX_CHOSEN {
            choice.stamps.pop_front();
        }
        choice.stamps.push_back(stamp);
        true
    }

    /// Shows a chosen image. The worker reports an invalid image.
    pub(super) fn show(&self, image: &CameraImage<'_>) {
        if let Some(full) = &self.full {
            if let Some(channel) = &*lock(full) {
                channel.send_once(image.data, image.time_ns);
            }
        } else if let Some([pictures, _]) = &self.small
            && let Err(error) = self.show_small(image, pictures)
        {
            tracing::debug!("an image has no preview: {error}");
        }
    }

    fn show_small(&self, image: &CameraImage<'_>, pictures: &Channel) -> Result<(), Unshown> {
        let Work { pixels, small, bytes } = &mut *lock(&self.work);
        let (header, view) = match image.transport {
            ImageTransport::Raw => {
                let message: Image<'_> = cdr::decode(image.data)?;
                let view = frame::image(&message, self.max_frame_bytes)?;
                (message.header, view)
            }
            ImageTransport::Compressed => {
                let message: CompressedImage<'_> = cdr::decode(image.data)?;
                let view = compressed::image(&message, self.max_frame_bytes, pixels)?;
                (message.header, view)
            }
        };
        let factor = preview::factor(view.width());
        lock(&self.choice).factor = factor;
        let (width, height) = preview::reduce(&view, factor, small);
        let message = Image {
            header,
            height,
            width,
            encoding: "mono8".into(),
            is_bigendian: 0,
            step: width,
            data: small,
        };
        cdr::encode(&message, bytes)?;
        pictures.send_once(bytes, image.time_ns);
        Ok(())
    }

    /// Shows the annotations of an image that was chosen.
    pub(super) fn annotate(&self, data: &[u8], time_ns: i64) {
        let Some([_, drawings]) = &self.small else { return };
        if !drawings.is_wanted() {
            return;
        }
        let Ok(mut annotations) = cdr::decode::<ImageAnnotations<'_>>(data) else { return };
        let factor = {
            let choice = lock(&self.choice);
            // An empty message has no stamp, but must clear the previous annotations.
            let first = annotations.points.first().map(|line| line.timestamp);
            if choice.factor == 0 || first.is_some_and(|stamp| !choice.stamps.contains(&stamp)) {
                return;
            }
            choice.factor
        };
        preview::scale(&mut annotations, factor);
        let bytes = &mut lock(&self.work).bytes;
        if cdr::encode(&annotations, bytes).is_ok() {
            drawings.send_once(bytes, time_ns);
        }
    }
}

/// Reason that an image has no preview.
#[derive(Debug, thiserror::Error)]
enum Unshown {
    #[error(transparent)]
    Cdr(#[from] CdrError),
    #[error(transparent)]
    Image(#[from] FrameRejected),
}

/// Returns the stamp and width of an image. The width of a compressed image is unknown until it is decoded.
fn stamp_and_width(image: &CameraImage<'_>) -> Result<(Time, Option<u32>), CdrError> {
    Ok(match image.transport {
        ImageTransport::Raw => {
            let message: Image<'_> = cdr::decode(image.data)?;
            (message.header.stamp, Some(message.width))
        }
        ImageTransport::Compressed => {
            let message: CompressedImage<'_> = cdr::decode(image.data)?;
            (message.header.stamp, None)
        }
    })
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
