//! One viewer's connection: its handshake, what it is sent, and what it asks for.
//!
//! A viewer can cost no more than its limits: the time of the handshake, the bytes that wait for it (`outbox`), the bytes
//! of one request, and one request at a time. Whoever sends more waits.

use std::{
    pin::pin,
    sync::{Arc, atomic::Ordering},
    time::Duration,
};

use futures_util::{
    Sink, SinkExt, Stream, StreamExt,
    future::{Either, select},
};
use thiserror::Error;
use tokio::{
    io::{AsyncRead, AsyncWrite},
    task::spawn_blocking,
    time::{Instant, timeout, timeout_at},
};
use tokio_tungstenite::{
    WebSocketStream, accept_hdr_async_with_config,
    tungstenite::{
        self, Message,
        handshake::server::{ErrorResponse, Request as Head, Response},
        http::{HeaderValue, header},
        protocol::WebSocketConfig,
    },
};

use super::{
    access::{Access, Refusal, Rights},
    protocol::{
        BadRequest, PlaybackState, Reply, Request, SUBPROTOCOL, ServiceCall, service_response,
    },
    server::ServerState,
    viewers::{Viewer, lock},
};

/// Bytes of a request. The longest are values of parameters.
const MAX_REQUEST_BYTES: usize = 256 << 10;
/// Bytes of the buffers of a connection.
const BUFFER_BYTES: usize = 16 << 10;
/// Time in which a connection must close.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(500);
const LOOK_ONLY: &str = "this viewer may look only; open the view with its token to change things";

/// Times that a viewer has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// Between two questions whether it is still there.
    pub(super) ping: Duration,
    /// To take a message.
    pub(super) send: Duration,
    /// To show that it is there, else it is disconnected. It answers pings.
    pub(super) silence: Duration,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            ping: Duration::from_secs(20),
            send: Duration::from_secs(30),
            silence: Duration::from_secs(90),
        }
    }
}

/// Reason that a viewer is not admitted.
#[derive(Debug, Error)]
pub(super) enum Unadmitted {
    /// It is refused, and has been told so.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The handshake failed.
    #[error("{0}")]
    Failed(String),
}

/// Performs the handshake.
///
/// # Errors
/// The viewer is refused, or the handshake fails.
pub(super) async fn admit<S: AsyncRead + AsyncWrite + Unpin>(
    stream: S,
    access: &Access,
) -> Result<(WebSocketStream<S>, Rights), Unadmitted> {
    let mut verdict = None;
    #[allow(clippy::result_large_err, reason = "the type is the library's")]
    let judge = |head: &Head, mut response: Response| {
        let judged = access.judge(head);
        let answer = match &judged {
            Ok(_) => {
                let name = HeaderValue::from_static(SUBPROTOCOL);
                response.headers_mut().insert(header::SEC_WEBSOCKET_PROTOCOL, name);
                Ok(response)
            }
            Err(refusal) => {
                let mut refused = ErrorResponse::new(Some(refusal.to_string()));
                *refused.status_mut() = refusal.status();
                Err(refused)
            }
        };
        verdict = Some(judged);
        answer
    };
    let config = WebSocketConfig::default()
        .read_buffer_size(BUFFER_BYTES)
        .write_buffer_size(BUFFER_BYTES)
        .max_message_size(Some(MAX_REQUEST_BYTES))
        .max_frame_size(Some(MAX_REQUEST_BYTES));
    let accepted = accept_hdr_async_with_config(stream, judge, Some(config)).await;
    match (accepted, verdict) {
        (_, Some(Err(refusal))) => Err(refusal.into()),
        (Ok(socket), Some(Ok(rights))) => Ok((socket, rights)),
        (Err(error), _) => Err(Unadmitted::Failed(error.to_string())),
        (Ok(_), None) => Err(Unadmitted::Failed("it was not judged".to_owned())),
    }
}

/// Serves a viewer until it leaves or is disconnected.
pub(super) async fn serve<S: AsyncRead + AsyncWrite + Unpin>(
    socket: WebSocketStream<S>,
    state: &Arc<ServerState>,
    rights: Rights,
    times: Times,
) {
    let viewer = state.introduce(rights);
    let (mut sender, receiver) = socket.split();
    let is_sender_done = {
        let sending = pin!(send_all(&mut sender, &viewer, times));
        let answering = pin!(answer_all(receiver, state, &viewer, times.silence));
        matches!(select(sending, answering).await, Either::Left(_))
    };
    if is_sender_done {
        // It says goodbye to a viewer that still listens.
        _ = timeout(CLOSE_TIMEOUT, sender.close()).await;
    }
    state.dismiss(&viewer);
}

async fn send_all(
    sender: &mut (impl Sink<Message, Error = tungstenite::Error> + Unpin),
    viewer: &Viewer,
    times: Times,
) {
    let id = viewer.id;
    let mut next_ping = Instant::now() + times.ping;
    loop {
        // Also while messages wait: a viewer of a stream says nothing but pongs.
        let waited = if Instant::now() < next_ping {
            timeout_at(next_ping, viewer.outbox.next()).await.ok()
        } else {
            None
        };
        let message = match waited {
            Some(Some(message)) => message,
            Some(None) => return,
            None => {
                next_ping = Instant::now() + times.ping;
                Message::Ping(Vec::new().into())
            }
        };
        match timeout(times.send, sender.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return tracing::debug!("viewer {id}: {error}"),
            Err(_slow) => {
                return tracing::info!("viewer {id} takes no messages: it is disconnected");
            }
        }
    }
}

async fn answer_all(
    mut receiver: impl Stream<Item = Result<Message, tungstenite::Error>> + Unpin,
    state: &Arc<ServerState>,
    viewer: &Arc<Viewer>,
    silence: Duration,
) {
    let id = viewer.id;
    loop {
        let message = match timeout(silence, receiver.next()).await {
            Ok(Some(Ok(message))) => message,
            Ok(Some(Err(error))) => return tracing::debug!("viewer {id}: {error}"),
            Ok(None) => return,
            Err(_silent) => {
                return tracing::info!("viewer {id} is silent: it is disconnected");
            }
        };
        let request = match &message {
            Message::Text(text) => Request::from_text(text).map(Some),
            Message::Binary(bytes) => Request::from_bytes(bytes),
            Message::Close(_) => return,
            _ => Ok(None),
        };
        match request {
            Ok(Some(request)) => answer(state, viewer, request).await,
            Ok(None) => {}
            Err(error) => refuse(viewer, &error),
        }
    }
}

fn refuse(viewer: &Viewer, error: &BadRequest) {
    tracing::debug!("viewer {}: {error}", viewer.id);
    viewer.fail(&error.to_string());
}

/// Answers a request. What may block runs on a thread for it, and the viewer's next request waits.
async fn answer(state: &Arc<ServerState>, viewer: &Arc<Viewer>, request: Request) {
    match request {
        Request::Subscribe(subscriptions) => {
            for subscription in subscriptions {
                match state.channels.subscribe(viewer, subscription) {
                    Ok(topic) => state.desk.on_subscribe(&topic),
                    Err(reason) => viewer.fail(&reason),
                }
            }
        }
        Request::Unsubscribe(ids) => {
            for id in ids {
                state.channels.unsubscribe(viewer, id);
            }
        }
        Request::Unwatch(names) => {
            lock(&viewer.watched).retain(|watched| !names.contains(watched));
        }
        Request::WatchGraph => state.graph.introduce(viewer),
        Request::UnwatchGraph => viewer.wants_graph.store(false, Ordering::Relaxed),
        Request::Unoffered(what) => viewer.fail(&format!("this server takes no {what}")),
        Request::Control(request) => match viewer.rights {
            Rights::Look => viewer.fail(LOOK_ONLY),
            Rights::Change => {
                if let Some(state_now) = state.desk.control(&request) {
                    let request_id = Some(request.request_id);
                    state.publish_playback(&PlaybackState { request_id, ..state_now });
                }
            }
        },
        request => {
            let (state, viewer) = (Arc::clone(state), Arc::clone(viewer));
            let answered = spawn_blocking(move || answer_slowly(&state, &viewer, request)).await;
            if let Err(error) = answered {
                tracing::error!("a viewer's request failed: {error}");
            }
        }
    }
}

/// Answers a request that may wait for the node.
fn answer_slowly(state: &ServerState, viewer: &Viewer, request: Request) {
    match request {
        Request::Get(names, id) => {
            let values = state.desk.parameters(&names);
            let (parameters, id) = (values.iter().collect(), id.as_deref());
            viewer.tell(&Reply::ParameterValues { parameters, id });
        }
        Request::Set(parameters, id) => {
            let names: Vec<_> = parameters.iter().map(|it| it.name.clone()).collect();
            let reasons = match viewer.rights {
                Rights::Look => vec![LOOK_ONLY.to_owned()],
                Rights::Change => state.desk.set_parameters(parameters),
            };
            for reason in &reasons {
                viewer.fail(reason);
            }
            // The reply holds the current values, because a panel must not show refused ones.
            let in_force = state.desk.parameters(&names);
            if let Some(id) = id.as_deref() {
                let parameters = in_force.iter().collect();
                viewer.tell(&Reply::ParameterValues { parameters, id: Some(id) });
            }
            state.publish_parameters(&in_force);
        }
        Request::Watch(names) => {
            // Names that do not exist would take memory without end.
            let known = state.desk.parameters(&names).into_iter().map(|it| it.name);
            lock(&viewer.watched).extend(known);
        }
        Request::Call(call) => answer_call(state, viewer, call),
        _ => {}
    }
}

fn answer_call(state: &ServerState, viewer: &Viewer, call: ServiceCall) {
    let (service_id, call_id) = (call.service_id, call.call_id);
    let answered = match viewer.rights {
        Rights::Look => Err(LOOK_ONLY.to_owned()),
        Rights::Change => state.services.call(call),
    };
    match answered {
        Ok(payload) => {
            let response = service_response(service_id, call_id, &payload);
            viewer.outbox.push(Message::binary(response));
        }
        Err(message) => {
            let message = &*message;
            viewer.tell(&Reply::ServiceCallFailure { service_id, call_id, message });
        }
    }
}
