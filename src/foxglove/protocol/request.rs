//! Messages of viewers.

use serde::Deserialize;
use thiserror::Error;

use super::{Parameter, PlaybackControlRequest, split};

/// Reason that a message of a viewer is not understood.
#[derive(Debug, Error)]
pub(in crate::foxglove) enum BadRequest {
    /// A binary message ends early.
    #[error("a binary message ends early")]
    Short,
    /// A binary message of an unknown kind.
    #[error(
        "a binary message is of kind {0}, but must be a service call (2) or playback control (3)"
    )]
    Kind(u8),
    /// An unknown playback command.
    #[error("playback command {0}: must be 0 (play) or 1 (pause)")]
    Command(u8),
    /// A text is no JSON of a known message.
    #[error("a text is no request of this protocol: {0}")]
    Json(#[from] serde_json::Error),
}

/// A request of a viewer.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::foxglove) enum Request {
    /// Sends topics from now on.
    Subscribe(Vec<Subscription>),
    /// Sends topics no longer, by subscription.
    Unsubscribe(Vec<u32>),
    /// Reads parameters; all of them if there are no names.
    Get(Vec<String>, Option<String>),
    /// Sets parameters.
    Set(Vec<Parameter>, Option<String>),
    /// Reports changes of parameters from now on.
    Watch(Vec<String>),
    /// Reports changes of parameters no longer.
    Unwatch(Vec<String>),
    /// Reports the connection graph from now on.
    WatchGraph,
    /// Reports the connection graph no longer.
    UnwatchGraph,
    /// Calls a service.
    Call(ServiceCall),
    /// Controls the playback.
    Control(PlaybackControlRequest),
    /// Something that this server does not offer.
    Unoffered(&'static str),
}

/// A wish for the messages of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::foxglove) struct Subscription {
    /// Number that the viewer chose.
    pub(in crate::foxglove) id: u32,
    /// Number of the topic.
    pub(in crate::foxglove) channel_id: u64,
}

/// A call of a service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::foxglove) struct ServiceCall {
    /// Number of the service.
    pub(in crate::foxglove) service_id: u32,
    /// Number that the viewer chose.
    pub(in crate::foxglove) call_id: u32,
    /// Encoding of the request.
    pub(in crate::foxglove) encoding: String,
    /// The request.
    pub(in crate::foxglove) payload: Vec<u8>,
}

#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum Text {
    Subscribe { subscriptions: Vec<Subscription> },
    Unsubscribe { subscription_ids: Vec<u32> },
    GetParameters { parameter_names: Vec<String>, id: Option<String> },
    SetParameters { parameters: Vec<Parameter>, id: Option<String> },
    SubscribeParameterUpdates { parameter_names: Vec<String> },
    UnsubscribeParameterUpdates { parameter_names: Vec<String> },
    SubscribeConnectionGraph,
    UnsubscribeConnectionGraph,
    Advertise,
    Unadvertise,
    FetchAsset,
}

impl Request {
    /// Reads a text.
    ///
    /// # Errors
    /// It is no request of the protocol.
    pub(in crate::foxglove) fn from_text(text: &str) -> Result<Self, BadRequest> {
        Ok(match serde_json::from_str(text)? {
            Text::Subscribe { subscriptions } => Self::Subscribe(subscriptions),
            Text::Unsubscribe { subscription_ids } => Self::Unsubscribe(subscription_ids),
            Text::GetParameters { parameter_names, id } => Self::Get(parameter_names, id),
            Text::SetParameters { parameters, id } => {
                Self::Set(parameters.into_iter().map(Parameter::with_stated_type).collect(), id)
            }
            Text::SubscribeParameterUpdates { parameter_names } => Self::Watch(parameter_names),
            Text::UnsubscribeParameterUpdates { parameter_names } => Self::Unwatch(parameter_names),
            Text::SubscribeConnectionGraph => Self::WatchGraph,
            Text::UnsubscribeConnectionGraph => Self::UnwatchGraph,
            Text::Advertise | Text::Unadvertise => Self::Unoffered("topics of viewers"),
            Text::FetchAsset => Self::Unoffered("assets"),
        })
    }

    /// Reads a binary message; `None` if it is empty.
    ///
    /// # Errors
    /// It is no request of the protocol.
    pub(in crate::foxglove) fn from_bytes(bytes: &[u8]) -> Result<Option<Self>, BadRequest> {
        let Some((&kind, data)) = bytes.split_first() else { return Ok(None) };
        Ok(Some(match kind {
            1 => Self::Unoffered("topics of viewers"),
            2 => Self::Call(ServiceCall::decode(data)?),
            3 => Self::Control(PlaybackControlRequest::decode(data)?),
            other => return Err(BadRequest::Kind(other)),
        }))
    }
}

impl ServiceCall {
    fn decode(data: &[u8]) -> Result<Self, BadRequest> {
        let (service_id, data) = split(data)?;
        let (call_id, data) = split(data)?;
        let (length, data) = split(data)?;
        let length = u32::from_le_bytes(length) as usize;
        let (encoding, payload) = data.split_at_checked(length).ok_or(BadRequest::Short)?;
        Ok(Self {
            service_id: u32::from_le_bytes(service_id),
            call_id: u32::from_le_bytes(call_id),
            encoding: String::from_utf8_lossy(encoding).into_owned(),
            payload: payload.to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{ParameterType, ParameterValue, PlaybackCommand},
        *,
    };

    #[test]
    fn texts_are_read() {
        let read = |text: &str| Request::from_text(text).unwrap();
        let text = r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":7}]}"#;
        assert_eq!(read(text), Request::Subscribe(vec![Subscription { id: 1, channel_id: 7 }]));
        let text = r#"{"op":"unsubscribe","subscriptionIds":[3]}"#;
        assert_eq!(read(text), Request::Unsubscribe(vec![3]));
        let text = r#"{"op":"getParameters","parameterNames":["a"]}"#;
        assert_eq!(read(text), Request::Get(vec!["a".to_owned()], None));
        let text = r#"{"op":"setParameters","id":"s","parameters":[{"name":"a","type":"float64","value":35}]}"#;
        let value = Some(ParameterValue::Float64(35.0));
        let parameter =
            Parameter { name: "a".to_owned(), r#type: Some(ParameterType::Float64), value };
        assert_eq!(read(text), Request::Set(vec![parameter], Some("s".to_owned())));
        assert_eq!(read(r#"{"op":"subscribeConnectionGraph"}"#), Request::WatchGraph);
        let text = r#"{"op":"fetchAsset","uri":"file:///etc/passwd","requestId":1}"#;
        assert_eq!(read(text), Request::Unoffered("assets"));
    }

    #[test]
    fn what_is_no_request_is_refused() {
        for text in ["", "[]", "{}", r#"{"op":"dance"}"#, r#"{"op":"subscribe"}"#] {
            assert!(matches!(Request::from_text(text), Err(BadRequest::Json(_))), "{text}");
        }
        assert!(matches!(Request::from_bytes(&[9]), Err(BadRequest::Kind(9))));
        assert!(matches!(Request::from_bytes(&[]), Ok(None)));
        // An encoding that is longer than the message.
        let call = [&[2], [1, 1, u32::MAX].map(u32::to_le_bytes).concat().as_slice()].concat();
        for length in 1..=call.len() {
            assert!(matches!(Request::from_bytes(&call[..length]), Err(BadRequest::Short)));
        }
    }

    #[test]
    fn playback_control_is_read_and_cut_messages_are_refused() {
        let time = 1_700_000_000_000_000_000_u64;
        let head = [&[3, 1], 2.5_f32.to_le_bytes().as_slice(), &[1], &time.to_le_bytes()].concat();
        let whole = [head.as_slice(), &2_u32.to_le_bytes(), b"ab"].concat();
        let Ok(Some(Request::Control(request))) = Request::from_bytes(&whole) else { panic!() };
        assert_eq!(request.playback_command, PlaybackCommand::Pause);
        assert_eq!((request.seek_time, request.request_id.as_str()), (Some(time), "ab"));
        for length in 1..whole.len() {
            assert!(Request::from_bytes(&whole[..length]).is_err(), "{length}");
        }
        let unknown = [&[3, 9], &whole[2..]].concat();
        assert!(matches!(Request::from_bytes(&unknown), Err(BadRequest::Command(9))));
    }
}
