//! Tests the server with viewers of another WebSocket library.

use std::{
    fs,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    path::Path,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use serde_json::{Value as Json, json};
use tokio::runtime::Runtime;
use tokio_rustls::rustls::{
    ClientConfig, ClientConnection, RootCertStore, StreamOwned,
    crypto::ring,
    pki_types::{CertificateDer, ServerName, pem::PemObject},
};
use tungstenite::{Error, Message, WebSocket, client::IntoClientRequest, http::HeaderValue};

use super::{
    connection::{Times, admit, serve},
    server::ServerState,
    *,
};

/// A server that does nothing fails the test, instead of hanging it. Shorter than the time between pings, each of which
/// would prolong it.
const DEADLINE: Duration = Duration::from_secs(15);

/// A node with one parameter.
#[derive(Default)]
struct OneParameter(Mutex<Option<Parameter>>);

impl Desk for OneParameter {
    fn parameters(&self, names: &[String]) -> Vec<Parameter> {
        let value = self.0.lock().unwrap().clone();
        value.into_iter().filter(|it| names.is_empty() || names.contains(&it.name)).collect()
    }

    fn set_parameters(&self, parameters: Vec<Parameter>) -> Vec<String> {
        *self.0.lock().unwrap() = parameters.into_iter().next();
        Vec::new()
    }

    fn control(&self, _request: &PlaybackControlRequest) -> Option<PlaybackState> {
        None
    }

    fn on_viewer(&self) {}

    fn on_subscribe(&self, _topic: &str) {}
}

fn start(entrance: &Entrance) -> (Server, Arc<OneParameter>) {
    let desk = Arc::<OneParameter>::default();
    let handler = Arc::<OneParameter>::clone(&desk);
    (Server::start(entrance, &Settings::default(), handler).unwrap(), desk)
}

fn local() -> Entrance {
    Entrance::new(Address::parse("0").unwrap(), Vec::new(), None, None).unwrap()
}

fn stream(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", address.port())).unwrap();
    stream.set_read_timeout(Some(DEADLINE)).unwrap();
    stream
}

fn viewer<S: Read + Write>(url: &str, stream: S) -> Option<WebSocket<S>> {
    let mut request = url.into_client_request().unwrap();
    let protocol = HeaderValue::from_static("foxglove.sdk.v1");
    request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
    tungstenite::client(request, stream).ok().map(|(socket, _)| socket)
}

/// Sets the parameter; returns the answers to it.
fn set<S: Read + Write>(viewer: &mut WebSocket<S>) -> Vec<Json> {
    let request =
        json!({"op": "setParameters", "id": "1", "parameters": [{"name": "a", "value": 1}]});
    viewer.send(Message::text(request.to_string())).unwrap();
    let mut answers = Vec::new();
    while answers.last().is_none_or(|it: &Json| it["op"] != "parameterValues") {
        if let Message::Text(text) = viewer.read().unwrap() {
            answers.push(serde_json::from_str(&text).unwrap());
        }
    }
    answers
}

/// Makes a certificate for `localhost`.
fn certificate(place: &Path) -> TlsFiles {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let files = TlsFiles { certificate: place.join("cert.pem"), key: place.join("key.pem") };
    fs::write(&files.certificate, made.cert.pem()).unwrap();
    fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
    files
}

fn encrypted(files: &TlsFiles, stream: TcpStream) -> StreamOwned<ClientConnection, TcpStream> {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(&files.certificate).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = ServerName::try_from("localhost").unwrap();
    StreamOwned::new(ClientConnection::new(Arc::new(config), name).unwrap(), stream)
}

#[test]
fn a_view_for_other_machines_is_encrypted() {
    let place = tempfile::tempdir().unwrap();
    let files = certificate(place.path());
    let address = Address::parse("0.0.0.0:0").unwrap();
    assert!(Entrance::new(address, Vec::new(), None, None).unwrap_err().is_usage());
    let entrance = Entrance::new(address, Vec::new(), None, Some(files.clone())).unwrap();
    let (server, desk) = start(&entrance);
    let url = entrance.url(server.address());
    let token = url.split_once("/?token=").unwrap().1;
    let port = server.address().port();
    assert!(url.starts_with(&format!("wss://THIS_MACHINE:{port}/")) && token.len() == 32, "{url}");

    let plain = viewer("ws://localhost/", stream(server.address()));
    assert!(plain.is_none(), "nothing is served without encryption");
    let connected = || encrypted(&files, stream(server.address()));
    let mut looking = viewer("wss://robot.example/", connected()).unwrap();
    let answers = set(&mut looking);
    assert!(answers.iter().any(|it| it.to_string().contains("may look only")), "{answers:?}");
    assert_eq!(*desk.0.lock().unwrap(), None);
    let mut changing = viewer(&format!("wss://localhost/?token={token}"), connected()).unwrap();
    let answers = set(&mut changing);
    assert_eq!(answers.last().unwrap()["parameters"][0]["value"], 1);
    assert!(viewer("wss://localhost/?token=guess1", connected()).is_none());
}

#[test]
fn files_that_are_no_certificate_are_named() {
    let place = tempfile::tempdir().unwrap();
    let TlsFiles { certificate, key } = certificate(place.path());
    let text = place.path().join("text.pem");
    fs::write(&text, "secret").unwrap();
    for (certificate, key) in [(&text, &key), (&certificate, &text), (&key, &certificate)] {
        let files = TlsFiles { certificate: certificate.clone(), key: key.clone() };
        let error = files.load().err().unwrap().to_string();
        assert!(error.contains("--view-cert") && !error.contains("secret"), "{error}");
    }
}

#[test]
fn a_request_that_is_too_long_ends_the_connection() {
    let (server, _) = start(&local());
    let mut long = viewer("ws://localhost/", stream(server.address())).unwrap();
    let text =
        json!({"op": "getParameters", "parameterNames": ["x".repeat(300 << 10)]}).to_string();
    // It may be disconnected before all is sent.
    _ = long.send(Message::text(text));
    let error = loop {
        match long.read() {
            Ok(Message::Close(_)) => break None,
            Ok(_) => {}
            Err(error) => break Some(error),
        }
    };
    assert!(
        !matches!(error, Some(Error::Io(ref error)) if error.kind() == std::io::ErrorKind::WouldBlock)
    );
    // Others are served.
    set(&mut viewer("ws://localhost/", stream(server.address())).unwrap());
}

/// Starts a server of one connection with these times on a port.
fn serve_one(state: &Arc<ServerState>, times: Times) -> (SocketAddr, Runtime) {
    let runtime = Runtime::new().unwrap();
    let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
    let address = listener.local_addr().unwrap();
    let state = Arc::clone(state);
    runtime.spawn(async move {
        let (stream, _) = listener.accept().await.unwrap();
        let (socket, rights) = admit(stream, &Access::default()).await.unwrap();
        serve(socket, &state, rights, times).await;
    });
    (address, runtime)
}

#[test]
fn a_viewer_that_only_reads_a_stream_stays_connected() {
    let state = Arc::new(ServerState::new(Arc::<OneParameter>::default(), &Settings::default()));
    let description = ChannelDescription {
        name: "/stream".to_owned(),
        type_name: "std_msgs/msg/String".to_owned(),
        schema: b"string data".to_vec(),
        num_kept: 0,
    };
    let channel = state.channels.open(description).unwrap();
    let silence = Duration::from_millis(500);
    let times = Times { ping: Duration::from_millis(50), send: DEADLINE, silence };
    let (address, _runtime) = serve_one(&state, times);
    let mut reading = viewer("ws://localhost/", stream(address)).unwrap();
    let wish = json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]});
    reading.send(Message::text(wish.to_string())).unwrap();
    while !channel.is_wanted() {
        thread::sleep(Duration::from_millis(1));
    }
    let start = Instant::now();
    let mut num_pings = 0;
    // There is always a message on its way, and the server never waits for one.
    while start.elapsed() < 4 * silence {
        channel.send_once(&[0; 64], 1);
        num_pings += u32::from(reading.read().unwrap().is_ping());
    }
    assert!(num_pings > 3 && channel.is_wanted(), "{num_pings} pings");
    // It reads no more, and answers none.
    while channel.is_wanted() {
        assert!(start.elapsed() < DEADLINE, "a silent viewer is disconnected");
        thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn what_is_no_request_is_answered_and_harms_nothing() {
    let (server, _) = start(&local());
    let mut viewer = viewer("ws://localhost/", stream(server.address())).unwrap();
    let deep = "[".repeat(100_000);
    for message in [
        Message::text("{}"),
        Message::text(deep),
        Message::binary(vec![2, 0]),
        Message::binary(vec![9]),
        Message::text(
            json!({"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1}).to_string(),
        ),
        Message::text(
            json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}).to_string(),
        ),
    ] {
        viewer.send(message.clone()).unwrap();
        loop {
            if let Message::Text(text) = viewer.read().unwrap()
                && serde_json::from_str::<Json>(&text).unwrap()["level"] == 2
            {
                break;
            }
        }
    }
    set(&mut viewer);
}
