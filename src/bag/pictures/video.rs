//! A video as a recording, through an installed `ffmpeg` as a child process.

use std::io::{BufReader, Read};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Stdio};
use std::sync::Arc;
use std::thread::JoinHandle;

use super::error::PictureError;
use super::ffmpeg::{
    Stream, collect, command, every_frame, excerpt, frame_stamps_ns, no_program, probe, ratio,
};
use super::riff::missing_bytes;
use super::{NS, stamp_ns, topic};
use crate::bag::unpack::size_bytes;
use crate::bag::{BagError, Filter, RawMessage, Topic};
use crate::msg::builtin_interfaces::Time;
use crate::msg::cdr;
use crate::msg::schema::Message;
use crate::msg::sensor_msgs::Image;
use crate::msg::std_msgs::Header;

/// Endings of the names of videos, lower case.
pub(super) const ENDINGS: [&str; 10] =
    ["mp4", "avi", "mov", "mkv", "webm", "m4v", "mpg", "mpeg", "wmv", "mts"];

/// How the pixels of a video are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pixels {
    Mono8,
    Mono16,
    Rgb8,
}

impl Pixels {
    /// Chooses the format in which a video of ffmpeg's format `name` is read.
    fn of(name: &str) -> Self {
        match name {
            "gray" | "gray8" | "ya8" | "monow" | "monob" => Self::Mono8,
            _ if name.starts_with("gray") || name.starts_with("ya16") => Self::Mono16,
            _ => Self::Rgb8,
        }
    }

    /// Name of ffmpeg, encoding of ROS, bytes a pixel.
    const fn names(self) -> (&'static str, &'static str, u32) {
        match self {
            Self::Mono8 => ("gray", "mono8", 1),
            Self::Mono16 => ("gray16le", "mono16", 2),
            Self::Rgb8 => ("rgb24", "rgb8", 3),
        }
    }
}

/// A video.
#[derive(Debug)]
pub(in crate::bag) struct Video {
    path: PathBuf,
    size_px: [u32; 2],
    pixels: Pixels,
    /// Stamp of each frame, nanoseconds.
    stamps_ns: Vec<i64>,
    /// Number of bytes that are missing at the end of the file, if it states its length; else 0.
    missing_bytes: u64,
    images: Arc<Topic>,
}

impl Video {
    /// Looks at a video. Stamps are those of the file, or number / rate with a stated rate, counted from 1.
    ///
    /// # Errors
    /// `ffmpeg` is missing, or the file is no video that it can read.
    pub(super) fn open(
        path: &Path,
        rate_hz: Option<f64>,
        limit_bytes: u64,
        notes: &mut Vec<String>,
    ) -> Result<Self, PictureError> {
        let invalid = |why: String| PictureError::Video { path: path.into(), why };
        // `ffprobe` waits for data at a pipe; a missing file has a clearer message than its own.
        let missing_bytes =
            missing_bytes(path).map_err(|source| PictureError::Io { path: path.into(), source })?;
        let stream = probe(path)?;
        let (size_px, pixels) = ([stream.width, stream.height], Pixels::of(&stream.pix_fmt));
        let bytes = frame_bytes(size_px, pixels);
        if bytes == 0 || bytes > limit_bytes {
            let [width, height] = size_px;
            return Err(invalid(format!(
                "has {width} x {height} pixels, {bytes} bytes a frame; the limit is {limit_bytes} (max_frame_bytes)"
            )));
        }
        let (stated_ns, errors) = frame_stamps_ns(path)?;
        if stated_ns.is_empty() {
            let errors = if errors.is_empty() { errors } else { format!("; ffprobe: {errors}") };
            return Err(invalid(format!("has no frames that can be decoded{errors}")));
        }
        let stamps_ns = match rate_hz {
            Some(rate_hz) => at_rate(stated_ns.len(), rate_hz),
            None => own_stamps_ns(path, &stream, &stated_ns, notes)?,
        };
        let images = topic("/image_raw", Image::TYPE);
        Ok(Self { path: path.into(), size_px, pixels, stamps_ns, missing_bytes, images })
    }

    /// Size of the file, bytes.
    pub(in crate::bag) fn num_bytes(&self) -> u64 {
        size_bytes(&self.path)
    }

    pub(in crate::bag) const fn images(&self) -> &Arc<Topic> {
        &self.images
    }

    pub(in crate::bag) const fn num_frames(&self) -> u64 {
        self.stamps_ns.len() as u64
    }

    pub(in crate::bag) fn time_range_ns(&self) -> Option<RangeInclusive<i64>> {
        Some(*self.stamps_ns.first()?..=*self.stamps_ns.last()?)
    }
}

/// Stamps by the times that a file states. If it has none, or they do not increase, its mean rate stands in for them, and a
/// note says so.
fn own_stamps_ns(
    path: &Path,
    stream: &Stream,
    stated_ns: &[Option<i64>],
    notes: &mut Vec<String>,
) -> Result<Vec<i64>, PictureError> {
    let rate_hz = ratio(&stream.avg_frame_rate);
    let known_ns = stated_ns.iter().copied().collect::<Option<Vec<i64>>>();
    if let Some(times_ns) = known_ns.filter(|times_ns| times_ns.is_sorted_by(|a, b| a < b)) {
        // Videos begin at 0, which would mean that the camera has no clock: the first frame is one period later.
        let period_ns = rate_hz.map_or(NS as i64, |rate_hz| stamp_ns(1, rate_hz));
        let first_ns = times_ns.first().copied().unwrap_or(0);
        let shift_ns = period_ns.max(1).saturating_sub(first_ns);
        return Ok(times_ns.iter().map(|time_ns| time_ns.saturating_add(shift_ns)).collect());
    }
    let what = "does not state a time for every frame that is later than the one before";
    let rate_hz = rate_hz.ok_or_else(|| PictureError::Video {
        path: path.into(),
        why: format!("{what}: give --frame-rate HZ"),
    })?;
    let path = path.display();
    notes
        .push(format!("{path}: {what}; frame n gets the stamp n / {rate_hz:.3} Hz, its mean rate"));
    Ok(at_rate(stated_ns.len(), rate_hz))
}

fn at_rate(num: usize, rate_hz: f64) -> Vec<i64> {
    (1_u32..).take(num).map(|number| stamp_ns(number, rate_hz)).collect()
}

fn frame_bytes([width, height]: [u32; 2], pixels: Pixels) -> u64 {
    let (_, _, bytes_per_pixel) = pixels.names();
    u64::from(width).saturating_mul(height.into()).saturating_mul(bytes_per_pixel.into())
}

/// The running decoder.
struct Decoder {
    child: Child,
    frames: BufReader<ChildStdout>,
    errors: Option<JoinHandle<String>>,
}

impl Decoder {
    fn start(video: &Video) -> Result<Self, PictureError> {
        let (format, _, _) = video.pixels.names();
        // As recorded, not as a player would turn it: calibrations are of the sensor.
        let mut command =
            command("ffmpeg", &video.path, &["-nostdin", "-noautorotate", "-hide_banner"]);
        command
            // Increasing times, because the output refuses others, aloud; those of the frames are known.
            .args(["-map", "0:v:0", "-vf", "setpts=N/TB"])
            .args(every_frame())
            .args(["-f", "rawvideo", "-pix_fmt", format, "-"]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let failed = |error: std::io::Error| no_program(&video.path, "ffmpeg", &error);
        let mut child = command.spawn().map_err(failed)?;
        let (Some(frames), Some(errors)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(failed(std::io::Error::other("has no output")));
        };
        let errors = collect(errors).map_err(failed)?;
        Ok(Self { child, frames: BufReader::new(frames), errors: Some(errors) })
    }

    /// Waits for the end and returns what was wrong.
    fn finish(&mut self) -> Option<String> {
        let status = self.child.wait();
        let text = self.errors.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        let is_sound = status.is_ok_and(|status| status.success()) && text.trim().is_empty();
        (!is_sound).then(|| format!("ffmpeg: {}", excerpt(&text)))
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // An error means that it has ended.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// The frames of a video as messages.
pub(in crate::bag) struct VideoMessages {
    video: Arc<Video>,
    filter: Filter,
    decoder: Option<Decoder>,
    next: usize,
    has_ended: bool,
    pixels: Vec<u8>,
    spare: Vec<Vec<u8>>,
}

impl VideoMessages {
    pub(in crate::bag) fn new(video: Arc<Video>, filter: Filter) -> Self {
        Self {
            video,
            filter,
            decoder: None,
            next: 0,
            has_ended: false,
            pixels: Vec::new(),
            spare: Vec::new(),
        }
    }

    pub(in crate::bag) fn recycle(&mut self, buffer: Vec<u8>) {
        if self.spare.is_empty() {
            self.spare.push(buffer);
        }
    }

    /// Returns the next frame; `None` at the end. An error takes the place of all frames that cannot be decoded.
    pub(in crate::bag) fn next(&mut self) -> Option<Result<RawMessage, BagError>> {
        if self.has_ended || !self.filter.takes(&self.video.images.name) {
            return None;
        }
        loop {
            match self.read() {
                Ok(true) => {}
                Ok(false) => {
                    self.has_ended = true;
                    return self.missing().map(Err);
                }
                Err(error) => {
                    self.has_ended = true;
                    return Some(Err(error.into()));
                }
            }
            let number = self.next;
            self.next += 1;
            // More frames than `ffprobe` finds: their times are unknown.
            let Some(&stamp_ns) = self.video.stamps_ns.get(number) else { continue };
            if stamp_ns >= self.filter.start_time() as i64 {
                return Some(self.message(number, stamp_ns));
            }
        }
    }

    /// Reads the pixels of the next frame; false at the end.
    fn read(&mut self) -> Result<bool, PictureError> {
        if self.decoder.is_none() {
            self.decoder = Some(Decoder::start(&self.video)?);
        }
        let Some(decoder) = &mut self.decoder else { return Ok(false) };
        self.pixels.resize(frame_bytes(self.video.size_px, self.video.pixels) as usize, 0);
        Ok(decoder.frames.read_exact(&mut self.pixels).is_ok())
    }

    fn message(&mut self, number: usize, stamp_ns: i64) -> Result<RawMessage, BagError> {
        let [width, height] = self.video.size_px;
        let (_, encoding, bytes_per_pixel) = self.video.pixels.names();
        let image = Image {
            header: Header { stamp: Time::from_ns(stamp_ns), frame_id: super::FRAME_ID.into() },
            height,
            width,
            encoding: encoding.into(),
            is_bigendian: 0,
            step: width * bytes_per_pixel,
            data: &self.pixels,
        };
        let mut data = self.spare.pop().unwrap_or_default();
        cdr::encode(&image, &mut data).map_err(|error| self.unusable(error.to_string()))?;
        Ok(RawMessage {
            topic: Arc::clone(&self.video.images),
            log_time_ns: stamp_ns,
            publish_time_ns: stamp_ns,
            sequence: u32::try_from(number).unwrap_or(u32::MAX).saturating_add(1),
            data,
            file: None,
        })
    }

    /// The part that is missing at the end.
    fn missing(&mut self) -> Option<BagError> {
        let told = self.decoder.as_mut().and_then(Decoder::finish);
        let (found, timed) = (self.next, self.video.stamps_ns.len());
        let cut_bytes = Some(self.video.missing_bytes).filter(|bytes| *bytes > 0);
        let cut = cut_bytes.map(|bytes| format!("{bytes} bytes are missing at its end"));
        let reasons: Vec<_> = cut.into_iter().chain(told).collect();
        let what = if found < timed {
            format!("{found} of {timed} frames could be decoded")
        } else if found > timed {
            format!("only {timed} of {found} frames have a known time; the others are left out")
        } else if !reasons.is_empty() {
            format!("is damaged or cut off: {found} frames could be decoded")
        } else {
            return None;
        };
        Some(self.unusable([vec![what], reasons].concat().join("; ")))
    }

    fn unusable(&self, why: String) -> BagError {
        BagError::Picture { path: self.video.path.clone(), why }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_follow_those_of_the_video() {
        for (name, pixels) in [
            ("gray", Pixels::Mono8),
            ("gray10le", Pixels::Mono16),
            ("gray16be", Pixels::Mono16),
            ("yuv420p", Pixels::Rgb8),
            ("bayer_rggb8", Pixels::Rgb8),
        ] {
            assert_eq!(Pixels::of(name), pixels, "{name}");
        }
    }
}
