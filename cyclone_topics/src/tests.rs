//! Two participants of one process, on the loopback interface: with sockets of their own, like two processes.

use std::{
    net::{Ipv4Addr, TcpListener},
    process,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use crate::{
    Config, Discovery, Domain, Durability, Error, History, Message, Qos, Reader, Received,
    Reliability, Side, Writer, config::tests::config, qos::tests::reliable, sockets::Sockets,
};

mod delivery;
mod joining;

const TYPE: &str = "std_msgs::msg::dds_::String_";
/// Deadline for events that happen on their own.
const PATIENCE: Duration = Duration::from_secs(30);
const LIMIT_BYTES: usize = 64 << 20;

/// A domain that no other test has, in this process or another, while this lives.
struct Claim {
    id: u32,
    _port: TcpListener,
}

fn claim() -> Claim {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let first = process::id() + NEXT.fetch_add(1, Ordering::Relaxed);
    let mut ids = (0..100).map(|offset| 1 + (first + offset) % 100);
    let claimed = ids.find_map(|id| {
        let port = u16::try_from(21_700 + id).unwrap();
        Some(Claim { id, _port: TcpListener::bind((Ipv4Addr::LOCALHOST, port)).ok()? })
    });
    claimed.expect("one domain of a hundred is free")
}

fn join(claim: &Claim) -> Domain {
    join_with(&config(claim.id))
}

fn join_with(config: &Config) -> Domain {
    Domain::join(config, b"enclave=/;", |_| {}).unwrap()
}

/// A reader and what it receives.
struct Inbox {
    reader: Reader,
    received: mpsc::Receiver<Received>,
}

impl Inbox {
    fn open(domain: &Domain, topic: &str, qos: &Qos) -> Self {
        Self::open_up_to(domain, topic, qos, LIMIT_BYTES)
    }

    fn open_up_to(domain: &Domain, topic: &str, qos: &Qos, limit_bytes: usize) -> Self {
        let (sender, received) = mpsc::sync_channel(1000);
        let on_received = move |message| drop(sender.try_send(message));
        let reader = domain.reader([topic, TYPE], qos, limit_bytes, on_received).unwrap();
        Self { reader, received }
    }

    fn next(&self) -> Message {
        match self.received.recv_timeout(PATIENCE).expect("something arrives") {
            Received::Message(message) => message,
            Received::TooLarge { bytes } => panic!("{bytes} bytes"),
        }
    }
}

fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until both ends have found each other.
fn meet(writer: &Writer, inbox: &Inbox) {
    eventually("reader and writer meet", || {
        writer.num_matched() >= 1 && inbox.reader.num_matched() >= 1
    });
}

/// A message of that many bytes, told apart by its number.
fn message(bytes: usize, number: usize) -> Arc<[u8]> {
    let mut message: Vec<u8> = (0..bytes).map(|at| ((at + number) % 251) as u8).collect();
    message[..4].copy_from_slice(&[0, 1, 0, 0]);
    message.into()
}
