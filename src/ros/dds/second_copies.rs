//! Sends large replies a second time, in a form that clients can read.
//!
//! RustDDS 0.15.1 cuts a reply that exceeds the MTU into fragments whose inline QoS begins with a stray byte
//! (`docs/upstream/rustdds-data-frag.md`), so clients that are identified there, as those of `rmw_fastrtps`, take none of
//! them. This module sends well-formed fragments of the same sample to the same reader: same writer, same number. The
//! reader acknowledges the sample to RustDDS.
//!
//! Everything is bounded, because anybody on the network can announce a reader with any address: copies go to unicast
//! addresses that the reader itself announced, at most [`MAX_ADDRESSES`], at most six times, and the node as a whole
//! sends less than 10 MB/s of them.

use std::{
    cmp::Reverse,
    net::{IpAddr, SocketAddr, UdpSocket},
    sync::{
        Arc,
        mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use futures::{FutureExt, future::BoxFuture};
use rustdds::GUID;

use super::{participant::RawDataWriter, rtps::Reply};
/// Largest reply of which copies are sent, bytes.
const MAX_BYTES: usize = 1 << 20;
/// Most addresses of one reader; a host announces one per network interface.
const MAX_ADDRESSES: usize = 4;
/// Most replies that wait for acknowledgement.
const MAX_REPLIES: usize = 16;
/// Most replies that wait to be sent first.
const MAX_QUEUED: usize = 32;
/// Delays before a reply that is not yet acknowledged is sent again. Fast DDS acknowledges 5 ms after a heartbeat, and
/// RustDDS sends one each 100 ms.
const DELAYS: [Duration; 5] = [
    Duration::from_millis(30),
    Duration::from_millis(120),
    Duration::from_millis(250),
    Duration::from_millis(500),
    Duration::from_secs(1),
];
/// Datagrams between pauses, fewer than the default receive buffer holds (about 90), and the pause.
const BURST: usize = 16;
const PAUSE: Duration = Duration::from_millis(2);

/// The reader of a reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Recipient {
    pub(super) reader: GUID,
    /// As announced; only unicast ones are used.
    pub(super) addresses: Vec<SocketAddr>,
}

/// A reply under way.
pub(super) struct Delivery {
    pub(super) reply: Reply,
    pub(super) recipient: Recipient,
    pub(super) acknowledged: Acknowledged,
}

/// Acknowledgement by all readers of everything written so far. Keeps the writer until then.
pub(super) struct Acknowledged(Option<BoxFuture<'static, ()>>);

impl Acknowledged {
    /// Covers the last sample of a writer.
    pub(super) fn of(writer: &Arc<RawDataWriter>) -> Self {
        let writer = Arc::clone(writer);
        // Without an answer of the writer there is nothing to wait for.
        let wait = async move { drop(writer.async_wait_for_acknowledgments().await) };
        let mut acknowledged = Self(Some(wait.boxed()));
        // RustDDS looks up the last sample when the future is polled first.
        acknowledged.check();
        acknowledged
    }

    fn check(&mut self) -> bool {
        if self.0.as_mut().is_some_and(|wait| wait.now_or_never().is_some()) {
            self.0 = None;
        }
        self.0.is_none()
    }
}

/// The thread that sends copies. It ends when dropped.
pub(super) struct SecondCopies {
    queue: Option<SyncSender<Delivery>>,
    thread: Option<JoinHandle<()>>,
}

impl SecondCopies {
    /// Starts the thread, which sends by `socket`.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn start(socket: UdpSocket) -> std::io::Result<Self> {
        let wire = Wire { socket, datagram: Vec::new(), num_since_pause: 0 };
        let (queue, deliveries) = mpsc::sync_channel(MAX_QUEUED);
        let thread = thread::Builder::new()
            .name("dds large replies".to_owned())
            .spawn(move || send(wire, &deliveries))?;
        Ok(Self { queue: Some(queue), thread: Some(thread) })
    }

    /// Sends copies of a reply until it is acknowledged, within bounds. Returns at once.
    pub(super) fn send(&self, mut delivery: Delivery) {
        let bytes = delivery.reply.payload_bytes();
        let reader = delivery.recipient.reader;
        delivery.recipient.addresses = usable(&delivery.recipient.addresses);
        let unsent = if delivery.recipient.addresses.is_empty() {
            Some("the client announces no unicast IPv4 address")
        } else if bytes > MAX_BYTES {
            Some("it is longer than 1 MiB")
        } else {
            let is_full = self.queue.as_ref().is_some_and(|queue| {
                matches!(queue.try_send(delivery), Err(TrySendError::Full(_)))
            });
            is_full.then_some("too many are under way")
        };
        if let Some(why) = unsent {
            tracing::warn!("a reply of {bytes} bytes may not reach {reader:?}: {why}");
        }
    }
}

impl Drop for SecondCopies {
    fn drop(&mut self) {
        drop(self.queue.take());
        if self.thread.take().is_some_and(|thread| thread.join().is_err()) {
            tracing::error!("the thread of large DDS replies panicked");
        }
    }
}

/// Returns the announced addresses that datagrams of this node may be sent to.
pub(super) fn usable(announced: &[SocketAddr]) -> Vec<SocketAddr> {
    let is_usable = |address: &&SocketAddr| match address.ip() {
        IpAddr::V4(ip) => {
            address.port() != 0 && !(ip.is_unspecified() || ip.is_multicast() || ip.is_broadcast())
        }
        IpAddr::V6(_) => false,
    };
    let mut usable: Vec<_> = announced.iter().filter(is_usable).copied().collect();
    usable.sort_unstable();
    usable.dedup();
    usable.truncate(MAX_ADDRESSES);
    usable
}

/// A delivery, when it is sent next and how often it was sent.
struct Open {
    delivery: Delivery,
    due: Instant,
    num_sent: usize,
}

fn send(mut wire: Wire, deliveries: &Receiver<Delivery>) {
    let mut open: Vec<Open> = Vec::new();
    loop {
        let due = open.iter().map(|open| open.due).min();
        let next = match due {
            None => deliveries.recv().map_err(|_ended| RecvTimeoutError::Disconnected),
            Some(due) => deliveries.recv_timeout(due.saturating_duration_since(Instant::now())),
        };
        match next {
            Ok(delivery) => {
                open.retain_mut(|open| !open.delivery.acknowledged.check());
                if open.len() == MAX_REPLIES {
                    open.remove(oldest_of_busiest(&open));
                }
                open.push(Open { delivery, due: Instant::now(), num_sent: 0 });
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        // A short reply may have arrived by RustDDS's own datagram before its first copy is due.
        open.retain_mut(|open| !open.delivery.acknowledged.check());
        open.retain_mut(|open| open.due > Instant::now() || open.send(&mut wire));
    }
}

/// Returns the oldest reply of the reader with most of them. One reader that waits keeps the replies to others from
/// being acknowledged; those of a busy one must not push its own out.
fn oldest_of_busiest(open: &[Open]) -> usize {
    let reader = |at: usize| open[at].delivery.recipient.reader;
    let num_of = |at: usize| (0..open.len()).filter(|other| reader(*other) == reader(at)).count();
    (0..open.len()).max_by_key(|at| (num_of(*at), Reverse(*at))).unwrap_or(0)
}

impl Open {
    /// Sends the reply; returns false if it was the last time.
    fn send(&mut self, wire: &mut Wire) -> bool {
        let Delivery { reply, recipient, .. } = &self.delivery;
        for number in 1..=reply.num_fragments().unwrap_or(0) {
            reply.encode(number, recipient.reader, &mut wire.datagram);
            recipient.addresses.iter().for_each(|address| wire.send(*address));
        }
        let Some(delay) = DELAYS.get(self.num_sent) else {
            tracing::debug!("a reply to {:?} is not acknowledged", recipient.reader);
            return false;
        };
        self.num_sent += 1;
        self.due = Instant::now() + *delay;
        true
    }
}

/// The socket, and the rate of what it sends.
struct Wire {
    socket: UdpSocket,
    datagram: Vec<u8>,
    num_since_pause: usize,
}

impl Wire {
    fn send(&mut self, address: SocketAddr) {
        if let Err(error) = self.socket.send_to(&self.datagram, address) {
            tracing::debug!("a reply to {address}: {error}");
        }
        self.num_since_pause += 1;
        if self.num_since_pause == BURST {
            thread::sleep(PAUSE);
            self.num_since_pause = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use futures::future;
    use rustdds::{SequenceNumber, bytes::Bytes, rpc::SampleIdentity};

    use super::*;

    /// A reply of three fragments to a socket, whose bytes are all `mark`.
    fn delivery(to: &UdpSocket, mark: u8, acknowledged: Acknowledged) -> Delivery {
        let identity = SampleIdentity {
            writer_guid: GUID::from_bytes([1; 16]),
            sequence_number: SequenceNumber::new(1),
        };
        let body = Bytes::from(vec![mark; 3000]);
        let recipient = Recipient {
            reader: GUID::from_bytes([2; 16]),
            addresses: vec![to.local_addr().unwrap()],
        };
        let reply = Reply { sample: identity, related: identity, body };
        Delivery { reply, recipient, acknowledged }
    }

    fn socket() -> UdpSocket {
        let socket = UdpSocket::bind(("127.0.0.1", 0)).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        socket
    }

    /// The last byte of a datagram, which is the mark of its reply.
    fn next(reader: &UdpSocket) -> u8 {
        let mut datagram = [0; 2048];
        let length = reader.recv(&mut datagram).unwrap();
        datagram[length - 1]
    }

    #[test]
    fn a_reply_is_sent_until_it_is_acknowledged_and_six_times_at_most() {
        let reader = socket();
        let copies = SecondCopies::start(socket()).unwrap();
        let never = || Acknowledged(Some(future::pending().boxed()));
        copies.send(delivery(&reader, 7, Acknowledged(None)));
        copies.send(delivery(&reader, 8, never()));
        for _ in 0..3 * (1 + DELAYS.len()) {
            assert_eq!(next(&reader), 8, "the other one is acknowledged");
        }
        copies.send(delivery(&reader, 9, never()));
        assert_eq!(next(&reader), 9, "this is not the seventh time");
    }

    #[test]
    fn the_replies_of_a_busy_client_make_room_for_its_own_only() {
        let socket = socket();
        let open = |mark: u8| {
            let mut delivery = delivery(&socket, mark, Acknowledged(None));
            delivery.recipient.reader = GUID::from_bytes([mark; 16]);
            Open { delivery, due: Instant::now(), num_sent: 1 }
        };
        assert_eq!(oldest_of_busiest(&[1, 2, 3, 2].map(open)), 1);
        assert_eq!(oldest_of_busiest(&[1, 2, 3].map(open)), 0);
    }

    #[test]
    fn only_a_few_unicast_addresses_are_used() {
        let announced = [
            "10.0.0.1:7411",
            "0.0.0.0:7411",
            "255.255.255.255:7411",
            "239.255.0.1:7411",
            "[::1]:7411",
            "10.0.0.2:0",
            "10.0.0.1:7411",
            "127.0.0.1:7411",
        ];
        let announced = announced.map(|address| address.parse().unwrap());
        let expected = ["10.0.0.1:7411", "127.0.0.1:7411"].map(|address| address.parse().unwrap());
        assert_eq!(usable(&announced), expected);
        let many = (1..=9).map(|port| SocketAddr::from(([10, 0, 0, 1], port)));
        assert_eq!(usable(&many.collect::<Vec<_>>()).len(), MAX_ADDRESSES);
    }
}
