//! An independent viewer: implements `foxglove.sdk.v1` from its specification, with another WebSocket library.

use std::{
    collections::BTreeMap,
    net::{SocketAddr, TcpStream},
    time::Duration,
};

use serde_json::{Value as Json, json};
use tungstenite::{Message, WebSocket, client::IntoClientRequest, http::HeaderValue};

/// Timeout, long enough for slow machines.
const TIMEOUT: Duration = Duration::from_mins(1);

/// A connection.
pub(super) struct Viewer {
    socket: WebSocket<TcpStream>,
    /// Numbers of topics, by name.
    pub(super) channels: BTreeMap<String, u64>,
    pub(super) services: BTreeMap<String, u64>,
    /// Subscribed topics, in the order of their subscription numbers from 1.
    topics: Vec<String>,
}

/// A message from the server.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Seen {
    Message(String, Vec<u8>),
    Answer(Vec<u8>),
    Text(Json),
}

impl Viewer {
    pub(super) fn connect(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        let mut request = format!("ws://{address}").into_client_request().unwrap();
        let protocol = HeaderValue::from_static("foxglove.sdk.v1");
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        let (channels, services) = (BTreeMap::new(), BTreeMap::new());
        Self { socket, channels, services, topics: Vec::new() }
    }

    /// Waits for the next message.
    pub(super) fn next(&mut self) -> Seen {
        loop {
            match self.socket.read().unwrap() {
                Message::Text(text) => {
                    let text: Json = serde_json::from_str(&text).unwrap();
                    self.note(&text);
                    return Seen::Text(text);
                }
                Message::Binary(bytes) if bytes[0] == 1 => {
                    let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
                    let topic = self.topics[subscription as usize - 1].clone();
                    return Seen::Message(topic, bytes[13..].to_vec());
                }
                Message::Binary(bytes) if bytes[0] == 3 => {
                    let length = u32::from_le_bytes(bytes[9..13].try_into().unwrap()) as usize;
                    return Seen::Answer(bytes[13 + length..].to_vec());
                }
                _ => {}
            }
        }
    }

    fn note(&mut self, text: &Json) {
        for (list, name, known) in
            [("channels", "topic", &mut self.channels), ("services", "name", &mut self.services)]
        {
            for item in text[list].as_array().into_iter().flatten() {
                let name = item[name].as_str().unwrap().to_owned();
                known.insert(name, item["id"].as_u64().unwrap());
            }
        }
    }

    /// Waits until `look` finds a value.
    pub(super) fn wait<T>(&mut self, mut look: impl FnMut(&Self, Seen) -> Option<T>) -> T {
        loop {
            let seen = self.next();
            if let Some(found) = look(self, seen) {
                return found;
            }
        }
    }

    pub(super) fn send(&mut self, text: &Json) {
        self.socket.send(Message::text(text.to_string())).unwrap();
    }

    pub(super) fn subscribe(&mut self, topics: &[&str]) {
        let is_there = |viewer: &Self| topics.iter().all(|it| viewer.channels.contains_key(*it));
        if !is_there(self) {
            self.wait(|viewer, _| is_there(viewer).then_some(()));
        }
        let mut subscriptions = Vec::new();
        for topic in topics {
            self.topics.push((*topic).to_owned());
            let channel = self.channels[*topic];
            subscriptions.push(json!({"id": self.topics.len(), "channelId": channel}));
        }
        self.send(&json!({"op": "subscribe", "subscriptions": subscriptions}));
    }

    /// Calls a service with CDR bytes and returns the CDR bytes of the response.
    pub(super) fn call(&mut self, service: &str, request: &[u8]) -> Vec<u8> {
        self.start_call(service, request);
        self.wait(|_, seen| match seen {
            Seen::Answer(data) => Some(data),
            _ => None,
        })
    }

    /// Calls a service without waiting for the response.
    pub(super) fn start_call(&mut self, service: &str, request: &[u8]) {
        if !self.services.contains_key(service) {
            self.wait(|viewer, _| viewer.services.contains_key(service).then_some(()));
        }
        let (number, encoding) = (self.services[service] as u32, b"cdr");
        let numbers = [number, 1, encoding.len() as u32].map(u32::to_le_bytes).concat();
        let call = [&[2], numbers.as_slice(), encoding, request].concat();
        self.socket.send(Message::binary(call)).unwrap();
    }
}
