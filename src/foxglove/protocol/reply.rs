//! Messages of the server.

use serde::Serialize;

use super::Parameter;

/// Bytes before the payload of a topic's message.
pub(in crate::foxglove) const MESSAGE_HEADER_BYTES: usize = 13;

/// A text of the server.
#[derive(Debug, Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(in crate::foxglove) enum Reply<'a> {
    /// Description of the server and its capabilities; the first message.
    ServerInfo {
        name: &'a str,
        capabilities: &'a [&'a str],
        supported_encodings: &'a [&'a str],
        session_id: &'a str,
        #[serde(skip_serializing_if = "Option::is_none")]
        data_start_time: Option<Time>,
        #[serde(skip_serializing_if = "Option::is_none")]
        data_end_time: Option<Time>,
    },
    /// New topics.
    Advertise { channels: Vec<AdvertisedChannel<'a>> },
    /// Topics that are gone.
    Unadvertise { channel_ids: &'a [u64] },
    /// New services.
    AdvertiseServices { services: Vec<AdvertisedService<'a>> },
    /// Services that are gone.
    UnadvertiseServices { service_ids: &'a [u32] },
    /// A text for the viewer's list of problems.
    Status {
        level: u8,
        message: &'a str,
        #[serde(skip_serializing_if = "Option::is_none")]
        id: Option<&'a str>,
    },
    /// Values of parameters.
    ParameterValues {
        parameters: Vec<&'a Parameter>,
        #[serde(skip_serializing_if = "Option::is_none")]
        id: Option<&'a str>,
    },
    /// Changes of the connection graph.
    ConnectionGraphUpdate {
        published_topics: Vec<GraphTopic<'a>>,
        subscribed_topics: Vec<GraphTopic<'a>>,
        advertised_services: [(); 0],
        removed_topics: Vec<&'a str>,
        removed_services: [(); 0],
    },
    /// A service that failed.
    ServiceCallFailure { service_id: u32, call_id: u32, message: &'a str },
}

/// How serious a status is.
#[derive(Clone, Copy, Debug)]
pub(in crate::foxglove) enum Level {
    /// Worth knowing.
    Warning = 1,
    /// The viewer's request failed.
    Error = 2,
}

/// A time.
#[derive(Clone, Copy, Debug, Serialize)]
pub(in crate::foxglove) struct Time {
    sec: u32,
    nsec: u32,
}

impl Time {
    /// Converts nanoseconds since the epoch.
    pub(in crate::foxglove) fn from_ns(time_ns: u64) -> Self {
        let sec = u32::try_from(time_ns / 1_000_000_000).unwrap_or(u32::MAX);
        Self { sec, nsec: (time_ns % 1_000_000_000) as u32 }
    }
}

/// A topic.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::foxglove) struct AdvertisedChannel<'a> {
    pub(in crate::foxglove) id: u64,
    pub(in crate::foxglove) topic: &'a str,
    pub(in crate::foxglove) encoding: &'static str,
    pub(in crate::foxglove) schema_name: &'a str,
    pub(in crate::foxglove) schema_encoding: &'static str,
    pub(in crate::foxglove) schema: &'a str,
}

/// A service.
#[derive(Debug, Serialize)]
pub(in crate::foxglove) struct AdvertisedService<'a> {
    pub(in crate::foxglove) id: u32,
    pub(in crate::foxglove) name: &'a str,
    pub(in crate::foxglove) r#type: &'a str,
    pub(in crate::foxglove) request: ServiceSchema<'a>,
    pub(in crate::foxglove) response: ServiceSchema<'a>,
}

/// Half of a service.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::foxglove) struct ServiceSchema<'a> {
    pub(in crate::foxglove) encoding: &'static str,
    pub(in crate::foxglove) schema_name: String,
    pub(in crate::foxglove) schema_encoding: &'static str,
    pub(in crate::foxglove) schema: &'a str,
}

/// A topic of the connection graph. Viewers read the list by either name.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::foxglove) struct GraphTopic<'a> {
    pub(in crate::foxglove) name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::foxglove) publisher_ids: Option<&'a [String]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::foxglove) subscriber_ids: Option<&'a [String]>,
}

impl Reply<'_> {
    /// Encodes the text.
    pub(in crate::foxglove) fn encode(&self) -> String {
        // Only maps with keys other than texts fail to become JSON, and there are none.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Returns the head of a topic's message.
pub(in crate::foxglove) fn message_header(
    subscription: u32,
    time_ns: u64,
) -> [u8; MESSAGE_HEADER_BYTES] {
    let mut header = [1; MESSAGE_HEADER_BYTES];
    header[1..5].copy_from_slice(&subscription.to_le_bytes());
    header[5..].copy_from_slice(&time_ns.to_le_bytes());
    header
}

/// Encodes the time of the playback, nanoseconds since the epoch.
pub(in crate::foxglove) fn time(time_ns: u64) -> Vec<u8> {
    [&[2], time_ns.to_le_bytes().as_slice()].concat()
}

/// Encodes the response of a service.
pub(in crate::foxglove) fn service_response(
    service_id: u32,
    call_id: u32,
    payload: &[u8],
) -> Vec<u8> {
    const ENCODING: &[u8] = b"cdr";
    let numbers = [service_id, call_id, ENCODING.len() as u32].map(u32::to_le_bytes).concat();
    [&[3], numbers.as_slice(), ENCODING, payload].concat()
}
