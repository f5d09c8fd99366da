//! Control of the playback of a recording.

use super::{BadRequest, split};

/// State of the playback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaybackStatus {
    /// It is being played.
    Playing = 0,
    /// It stands still.
    Paused = 1,
    /// It is being read.
    Buffering = 2,
    /// Its end has been reached.
    Ended = 3,
}

/// The playback of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaybackState {
    /// Playing, paused or at the end.
    pub status: PlaybackStatus,
    /// Log time, nanoseconds since the epoch.
    pub current_time: u64,
    /// Speed relative to the recording.
    pub playback_speed: f32,
    /// True if the time has jumped.
    pub did_seek: bool,
    /// Id of the request that this state answers.
    pub request_id: Option<String>,
}

impl PlaybackState {
    /// Encodes the state.
    pub(in crate::foxglove) fn encode(&self) -> Vec<u8> {
        let id = self.request_id.as_deref().unwrap_or_default();
        let mut bytes = vec![5, self.status as u8];
        bytes.extend(self.current_time.to_le_bytes());
        bytes.extend(self.playback_speed.to_le_bytes());
        bytes.push(u8::from(self.did_seek));
        bytes.extend((id.len() as u32).to_le_bytes());
        bytes.extend(id.as_bytes());
        bytes
    }
}

/// A viewer's request about the playback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaybackCommand {
    /// Play.
    Play,
    /// Stand still.
    Pause,
}

/// A viewer's request to the playback.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaybackControlRequest {
    /// Play or stand still.
    pub playback_command: PlaybackCommand,
    /// Speed relative to the recording.
    pub playback_speed: f32,
    /// Log time to jump to, nanoseconds since the epoch.
    pub seek_time: Option<u64>,
    /// Id that the answer repeats.
    pub request_id: String,
}

impl PlaybackControlRequest {
    /// Decodes a request, without the leading byte of its kind.
    pub(super) fn decode(data: &[u8]) -> Result<Self, BadRequest> {
        let ([command], data) = split(data)?;
        let (speed, data) = split(data)?;
        let ([has_seek], data) = split(data)?;
        let (time, data) = split(data)?;
        let (length, data) = split(data)?;
        let id = data.get(..u32::from_le_bytes(length) as usize).ok_or(BadRequest::Short)?;
        Ok(Self {
            playback_command: match command {
                0 => PlaybackCommand::Play,
                1 => PlaybackCommand::Pause,
                other => return Err(BadRequest::Command(other)),
            },
            playback_speed: f32::from_le_bytes(speed),
            seek_time: (has_seek != 0).then_some(u64::from_le_bytes(time)),
            request_id: String::from_utf8_lossy(id).into_owned(),
        })
    }
}
