//! Calls `ffmpeg` and `ffprobe` as child processes.

use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;
use std::process::{ChildStderr, Command, Stdio};
use std::thread::{self, JoinHandle};

use serde::Deserialize;

use super::error::PictureError;

/// Longest line of a list of frames, bytes.
const MAX_LINE_BYTES: u64 = 200;
/// Bytes of error messages that are kept.
const MAX_ERROR_BYTES: u64 = 2000;
const NS: f64 = 1e9;

/// The answer of `ffprobe`.
#[derive(Deserialize)]
struct Probed {
    #[serde(default)]
    streams: Vec<Stream>,
}

#[derive(Deserialize)]
pub(super) struct Stream {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pix_fmt: String,
    #[serde(default)]
    pub(super) avg_frame_rate: String,
}

/// A command that reads a file and nothing else, without the frames that the end of the file cuts off.
pub(super) fn command(program: &str, path: &Path, before: &[&str]) -> Command {
    let mut command = Command::new(program);
    let mut input = std::ffi::OsString::from("file:");
    input.push(path);
    command.args(before).args(["-v", "error", "-fflags", "+discardcorrupt"]);
    command.args(["-protocol_whitelist", "file", "-i"]).arg(input);
    command.stdin(Stdio::null());
    command
}

pub(super) fn no_program(
    path: &Path,
    program: &'static str,
    error: &std::io::Error,
) -> PictureError {
    match error.kind() {
        ErrorKind::NotFound => PictureError::NoFfmpeg { path: path.into() },
        _ => PictureError::Video { path: path.into(), why: format!("{program}: {error}") },
    }
}

pub(super) fn probe(path: &Path) -> Result<Stream, PictureError> {
    let entries =
        ["-select_streams", "v:0", "-show_entries", "stream=width,height,pix_fmt,avg_frame_rate"];
    let mut command = command("ffprobe", path, &[]);
    let output = command.args(entries).args(["-of", "json"]).output();
    let output = output.map_err(|error| no_program(path, "ffprobe", &error))?;
    let invalid = |why: String| PictureError::Video { path: path.into(), why };
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(invalid(format!("ffprobe: {}", excerpt(&text))));
    }
    let probed: Probed = serde_json::from_slice(&output.stdout)
        .map_err(|error| invalid(format!("ffprobe's answer: {error}")))?;
    probed.streams.into_iter().next().ok_or_else(|| invalid("has no video".to_owned()))
}

/// Time of every frame that can be decoded, in the order in which they are shown, nanoseconds; `None` where the file states
/// none. With them, what `ffprobe` says is wrong with the file.
pub(super) fn frame_stamps_ns(path: &Path) -> Result<(Vec<Option<i64>>, String), PictureError> {
    let mut command = command("ffprobe", path, &[]);
    command.args(["-select_streams", "v:0"]);
    command.args(["-show_entries", "frame=best_effort_timestamp_time", "-of", "csv=p=0"]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let failed = |error: std::io::Error| no_program(path, "ffprobe", &error);
    let mut child = command.spawn().map_err(failed)?;
    let errors = child.stderr.take().map(collect).transpose().map_err(failed)?;
    let mut stamps_ns = Vec::new();
    if let Some(output) = child.stdout.take() {
        let mut lines = BufReader::new(output);
        let mut line = Vec::new();
        while lines.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line).unwrap_or(0) > 0 {
            let text = String::from_utf8_lossy(&line);
            let text = text.trim().trim_end_matches(',');
            if !text.is_empty() {
                let seconds = text.parse::<f64>().ok();
                stamps_ns.push(seconds.map(|seconds| (seconds * NS).round() as i64));
            }
            line.clear();
        }
    }
    // A damaged file is reported when the frames are read.
    drop(child.wait());
    let errors = errors.and_then(|thread| thread.join().ok()).unwrap_or_default();
    Ok((stamps_ns, excerpt(&errors)))
}

/// Reads error messages to their end on a thread of its own, because a full pipe would stop the program, and keeps the first
/// ones.
pub(super) fn collect(errors: ChildStderr) -> std::io::Result<JoinHandle<String>> {
    let read = move || {
        let mut kept = Vec::new();
        let mut errors = BufReader::new(errors);
        drop(errors.by_ref().take(MAX_ERROR_BYTES).read_to_end(&mut kept));
        drop(std::io::copy(&mut errors, &mut std::io::sink()));
        String::from_utf8_lossy(&kept).into_owned()
    };
    thread::Builder::new().name("ffmpeg".to_owned()).spawn(read)
}

pub(super) fn ratio(text: &str) -> Option<f64> {
    let (over, under) = text.split_once('/').unwrap_or((text, "1"));
    let ratio = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
    (ratio.is_finite() && ratio > 0.0).then_some(ratio)
}

pub(super) fn excerpt(text: &str) -> String {
    let lines: Vec<_> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines.iter().rev().take(3).rev().copied().collect::<Vec<_>>().join("; ")
}

/// Options for one output frame per frame of the file. Versions before 5.1 know another name.
pub(super) fn every_frame() -> [&'static str; 2] {
    let output = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).output();
    let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let version = text.ok().and_then(|text| {
        let word = text.split_whitespace().nth(2)?.to_owned();
        let mut numbers =
            word.split(|letter: char| !letter.is_ascii_digit()).map(str::parse::<u32>);
        Some((numbers.next()?.ok()?, numbers.next().and_then(Result::ok).unwrap_or(0)))
    });
    if version.is_some_and(|version| version < (5, 1)) {
        ["-vsync", "passthrough"]
    } else {
        ["-fps_mode", "passthrough"]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_ratios() {
        assert_eq!(ratio("30000/1001"), Some(30000.0 / 1001.0));
        assert_eq!(ratio("25"), Some(25.0));
        for text in ["0/0", "", "25/", "-1/2"] {
            assert_eq!(ratio(text), None, "{text}");
        }
    }
}
