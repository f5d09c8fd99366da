//! The messages of Foxglove's WebSocket protocol, `foxglove.sdk.v1`: JSON texts, and binary messages in little endian.

mod parameter;
mod playback;
mod reply;
mod request;

pub use parameter::{Parameter, ParameterType, ParameterValue};
pub use playback::{PlaybackCommand, PlaybackControlRequest, PlaybackState, PlaybackStatus};
pub(super) use reply::{
    AdvertisedChannel, AdvertisedService, GraphTopic, Level, MESSAGE_HEADER_BYTES, Reply,
    ServiceSchema, Time, message_header, service_response, time,
};
pub(super) use request::{BadRequest, Request, ServiceCall, Subscription};

/// Name of the protocol in the handshake.
pub(super) const SUBPROTOCOL: &str = "foxglove.sdk.v1";

/// Splits off a little-endian number at the start of a message.
fn split<const N: usize>(data: &[u8]) -> Result<([u8; N], &[u8]), BadRequest> {
    let (number, rest) = data.split_first_chunk().ok_or(BadRequest::Short)?;
    Ok((*number, rest))
}
