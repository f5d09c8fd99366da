//! Attacks on the live view: pages that an operator opens, strangers on the network, and viewers that only cost.

use std::{
    fmt::Write as _,
    io::{ErrorKind, Read, Write},
    net::TcpStream,
    path::Path,
    time::Duration,
};

use serde_json::{Value as Json, json};
use tungstenite::{Message, WebSocket, client::IntoClientRequest, http::HeaderValue};

use crate::{
    memory::resident_peak_kib,
    program::{Ended, end, laser_profiler},
    recordings::{image_of, record_images},
    view::Viewed,
};

const FILM: &[&str] =
    &["bags/film_defects", "--params-file", "bags/film_defects.params.yaml", "--view=0"];
/// Connections that the server serves at once.
const MAX_VIEWERS: usize = 16;
/// A server that does nothing fails the test, instead of hanging it. Shorter than the time between pings, each of which
/// would prolong it.
const DEADLINE: Duration = Duration::from_secs(15);
/// Bytes of topics that wait for one viewer at most.
const BACKLOG_KIB: u64 = 16 << 10;

fn film(more: &[&str]) -> Viewed {
    Viewed::replay(&[FILM, more].concat())
}

/// The address of a view, without its scheme and query.
fn address(viewed: &Viewed) -> String {
    let rest = viewed.url.split_once("://").unwrap().1;
    rest.split('/').next().unwrap().to_owned()
}

fn connected(viewed: &Viewed) -> TcpStream {
    let stream = TcpStream::connect(address(viewed)).unwrap();
    stream.set_read_timeout(Some(DEADLINE)).unwrap();
    stream
}

/// Sends the head of a handshake; returns the status of the answer and all of it, up to its blank line.
fn shake(viewed: &Viewed, path: &str, headers: &[(&str, &str)]) -> (u32, String, TcpStream) {
    let mut stream = connected(viewed);
    let mut head = format!(
        "GET {path} HTTP/1.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"
    );
    for (name, value) in headers {
        write!(head, "{name}: {value}\r\n").unwrap();
    }
    stream.write_all((head + "\r\n").as_bytes()).unwrap();
    let mut answer = Vec::new();
    let mut byte = [0];
    while !answer.ends_with(b"\r\n\r\n") && stream.read(&mut byte).unwrap() > 0 {
        answer.push(byte[0]);
    }
    let answer = String::from_utf8(answer).unwrap();
    let status = answer.split(' ').nth(1).unwrap_or("0").parse().unwrap();
    (status, answer, stream)
}

/// Waits until the server disconnects.
fn is_disconnected(mut stream: TcpStream) -> bool {
    let mut buffer = vec![0; 1 << 16];
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return true,
            Ok(_) => {}
            Err(error) => return error.kind() == ErrorKind::ConnectionReset,
        }
    }
}

#[test]
fn a_page_that_the_operator_opens_may_not_connect() {
    let viewed = film(&["--view-origin=https://lab.example"]);
    let local = ("Host", "localhost:8765");
    for (origin, status) in [
        ("https://app.foxglove.dev", 101),
        ("https://lab.example", 101),
        ("http://localhost:8080", 101),
        ("https://evil.example", 403),
        ("http://lab.example", 403),
        ("null", 403),
    ] {
        let (seen, answer, _) = shake(&viewed, "/", &[local, ("Origin", origin)]);
        assert_eq!(seen, status, "{origin}: {answer}");
    }
    assert_eq!(shake(&viewed, "/", &[local]).0, 101, "a program that is no browser");
    // A page of evil.example whose name was made to point to this machine.
    let rebound = [("Host", "evil.example:8765"), ("Origin", "https://app.foxglove.dev")];
    assert_eq!(shake(&viewed, "/", &rebound).0, 403);
    assert_eq!(shake(&viewed, "/", &[]).0, 403, "no host at all");
    let ended = viewed.interrupt();
    for words in ["the page https://evil.example", "--view-origin=https://evil.example"] {
        assert!(ended.stderr.contains(words), "{words}: {}", ended.stderr);
    }
    assert!(ended.stderr.contains("host name \"evil.example:8765\""), "{}", ended.stderr);
}

#[test]
fn refusals_do_not_fill_the_log() {
    let viewed = film(&[]);
    // Its escape would colour the screen.
    let hostile = ("Origin", "https://evil.example/\u{9b}31m");
    for _ in 0..300 {
        shake(&viewed, "/", &[("Host", "localhost"), hostile]);
    }
    let Ended { stderr, .. } = viewed.interrupt();
    let num_lines = stderr.matches("is refused").count();
    assert!((1..60).contains(&num_lines), "{num_lines} lines");
    assert!(!stderr.contains(['\u{1b}', '\u{9b}']), "{stderr}");
}

#[test]
fn a_handshake_that_does_not_end_is_ended() {
    let viewed = film(&[]);
    let silent = connected(&viewed);
    let mut half = connected(&viewed);
    half.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n").unwrap();
    let mut endless = connected(&viewed);
    let mut num_bytes = 0;
    while num_bytes < 64 << 20 {
        match endless.write(&[b'x'; 4096]) {
            Ok(sent) => num_bytes += sent,
            Err(_) => break,
        }
    }
    assert!(num_bytes < 64 << 20, "a head without end is not read");
    assert!(is_disconnected(half) && is_disconnected(silent));
    assert_eq!(shake(&viewed, "/", &[("Host", "localhost")]).0, 101);
}

#[test]
fn the_number_of_viewers_is_limited() {
    let viewed = film(&[]);
    // Silent connections take no place.
    let silent: Vec<_> = (0..MAX_VIEWERS).map(|_| connected(&viewed)).collect();
    let mut viewers: Vec<_> = (0..MAX_VIEWERS).map(|_| served(&viewed).unwrap()).collect();
    assert!(served(&viewed).is_none());
    viewers.pop();
    // Its place is free as soon as the server has seen it go.
    let is_in = (0..2000).any(|_| served(&viewed).is_some());
    assert!(is_in, "a place is free again");
    drop(silent);
    let words = "16 viewers are connected, the most this view serves; close one";
    let ended = viewed.interrupt();
    assert!(ended.stderr.contains(words), "{}", ended.stderr);
}

/// Connects; `None` if nothing follows the handshake.
fn served(viewed: &Viewed) -> Option<TcpStream> {
    let (status, answer, mut stream) = shake(viewed, "/", &[("Host", "localhost")]);
    assert_eq!(status, 101, "{answer}");
    stream.read_exact(&mut [0]).is_ok().then_some(stream)
}

/// A viewer that is no browser.
struct Viewer(WebSocket<TcpStream>);

impl Viewer {
    fn connect(viewed: &Viewed, path: &str) -> Self {
        let mut request = format!("ws://{}{path}", address(viewed)).into_client_request().unwrap();
        let protocol = HeaderValue::from_static("foxglove.sdk.v1");
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        Self(tungstenite::client(request, connected(viewed)).unwrap().0)
    }

    fn send(&mut self, text: &Json) {
        self.0.send(Message::text(text.to_string())).unwrap();
    }

    /// Waits for a text that is wanted.
    fn wait(&mut self, is_wanted: impl Fn(&Json) -> bool) -> Json {
        loop {
            if let Message::Text(text) = self.0.read().unwrap() {
                let text: Json = serde_json::from_str(&text).unwrap();
                if is_wanted(&text) {
                    return text;
                }
            }
        }
    }

    /// Sets a parameter; returns what is in force then, and the refusals before.
    fn set(&mut self, name: &str, value: &Json) -> (Json, Vec<String>) {
        self.send(&json!({"op": "setParameters", "id": "1", "parameters": [{"name": name, "value": value}]}));
        let mut refusals = Vec::new();
        loop {
            let text = self.wait(|it| it["op"] == "parameterValues" || it["level"] == 2);
            if text["op"] == "status" {
                refusals.push(text["message"].as_str().unwrap().to_owned());
            } else {
                return (text["parameters"][0]["value"].clone(), refusals);
            }
        }
    }
}

#[test]
fn with_a_token_others_may_only_look() {
    let viewed = film(&["--view-token=o-p.e_n.sesame"]);
    assert!(viewed.url.ends_with("/?token=o-p.e_n.sesame"), "{}", viewed.url);
    let method = "extraction.method";
    let mut looking = Viewer::connect(&viewed, "/");
    let (value, refusals) = looking.set(method, &json!("gray_gravity"));
    assert_ne!(value, "gray_gravity", "what is in force is shown");
    assert!(refusals[0].contains("may look only"), "{refusals:?}");
    // Playback control, kind 3: play at speed 1 without a jump.
    let play =
        [&[3, 0], 1.0_f32.to_le_bytes().as_slice(), &[0; 9], &1_u32.to_le_bytes(), b"p"].concat();
    looking.0.send(Message::binary(play)).unwrap();
    assert!(looking.wait(|it| it["level"] == 2)["message"].as_str().unwrap().contains("look only"));
    let mut changing = Viewer::connect(&viewed, "/?token=o-p.e_n.sesame");
    assert_eq!(changing.set(method, &json!("gray_gravity")), (json!("gray_gravity"), vec![]));
    let (status, ..) = shake(&viewed, "/?token=guess1", &[("Host", "localhost")]);
    assert_eq!(status, 401);
    let made = film(&["--view-token"]);
    let token = made.url.split_once("token=").unwrap().1;
    assert!(token.len() == 32 && token.bytes().all(|it| it.is_ascii_hexdigit()), "{token}");
}

#[test]
fn other_machines_need_tls() {
    for (arguments, words) in [
        (&["--view=0.0.0.0:0"][..], "--view-cert"),
        (&["--view=0.0.0.0:0"], "ssh -L"),
        (&["--view=0", "--view-cert=a.pem"], "both or neither"),
        (&["--view=0", "--view-token=ab"], "6 to 128"),
        (&["--view=0", "--view-origin=evil"], "must be an origin"),
        (&["--view=0", "--view-origin=*"], "must be an origin"),
    ] {
        let ended = end(laser_profiler(&["replay", FILM[0]]).args(arguments));
        assert_eq!(ended.code, Some(2), "{arguments:?}: {ended:?}");
        assert!(ended.stderr.contains(words), "{arguments:?}: {ended:?}");
    }
    let missing = ["--view=0.0.0.0:0", "--view-cert=/no/cert.pem", "--view-key=/no/key.pem"];
    let ended = end(laser_profiler(&["replay", FILM[0]]).args(missing));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("/no/cert.pem"), "{ended:?}");
}

/// Images of 1 MB that are all different.
fn write_images(bag: &Path) {
    const SIDE: u32 = 1024;
    let images: Vec<_> = (0..200)
        .map(|number| {
            let mut pixels = vec![5; (SIDE * SIDE) as usize];
            pixels[(500 * SIDE) as usize..][..2 * SIDE as usize].fill(200);
            pixels[number] = 9;
            image_of(&pixels, number, |image| {
                (image.width, image.height, image.step) = (SIDE, SIDE, SIDE);
            })
        })
        .collect();
    record_images(bag, &images);
}

#[test]
fn viewers_that_read_nothing_cost_bounded_memory() {
    let place = tempfile::tempdir().unwrap();
    let bag = place.path().join("bag");
    write_images(&bag);
    let bag = bag.to_str().unwrap();
    let options = ["--view=0", "--view-image=full", "--view-exit", "--rate=200"];
    let mut peaks = Vec::new();
    for num_viewers in [0, 8] {
        let mut command = laser_profiler(&["replay", bag]);
        let viewed = Viewed::start(command.args(options));
        let mut viewers: Vec<_> = (0..num_viewers).map(|_| Viewer::connect(&viewed, "/")).collect();
        for viewer in &mut viewers {
            let text = viewer.wait(|it| it["channels"][0]["topic"] == "/image_raw");
            let id = &text["channels"][0]["id"];
            viewer.send(&json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": id}]}));
        }
        peaks.push(resident_peak_kib(viewed.id()));
        let ended = viewed.wait();
        assert!(matches!(ended.code, Some(0 | 3)), "{ended:?}");
        eprintln!("{}", ended.stderr.lines().last().unwrap());
    }
    eprintln!("peak without viewers {} KiB, with 8 that read nothing {} KiB", peaks[0], peaks[1]);
    // What waits is shared, and each has a message under way, with a copy in the socket's buffer.
    assert!(peaks[1] < peaks[0] + BACKLOG_KIB + 8 * 4 * 1024, "{peaks:?} KiB");
}
