"""Loads a topic with images, or measures what arrives on one; prints one JSON object.

    python tests/peers/zenoh_images.py send --width 2592 --height 2048 --fps 22 --seconds 60
    python tests/peers/zenoh_images.py receive --topic /laser_profiler/centerline \
        --type laser_profiler_msgs/msg/Centerline --hash RIHS01_… --idle 5
"""

import argparse
import sys
import threading
import time

import rmw_zenoh
from rmw_zenoh import Node, attachment, image, open_session, read_attachment, say, stamp_ns


def send(arguments, node):
    kind = (arguments.type, arguments.hash)
    publisher = node.publisher(arguments.topic, kind, reliable=arguments.reliable)
    node.wait_for_subscribers(arguments.topic, kind, arguments.subscribers)
    node.wait_for_route(publisher)
    count = arguments.count or int(arguments.seconds * arguments.fps)
    log = open(arguments.log, "w", buffering=1) if arguments.log else None
    start = time.monotonic()
    for number in range(count):
        due = start + number / arguments.fps
        time.sleep(max(0.0, due - time.monotonic()))
        now_ns = time.time_ns()
        message = image(number, arguments.width, arguments.height, now_ns, is_stripe=arguments.stripe)
        publisher.put(message, attachment=attachment(number + 1, node.gid, now_ns))
        if log:
            print(number + 1, now_ns, file=log)
    seconds = time.monotonic() - start
    say(event="sent", sent=count, seconds=round(seconds, 3), fps=round(count / seconds, 2))
    # Zenoh's queues are emptied behind the last put.
    linger(arguments.linger)


class Received:
    """Counts and latencies of one topic."""

    def __init__(self, slow):
        self.slow = slow
        self.lock = threading.Lock()
        self.latencies_ms, self.sequences, self.bytes, self.bad = [], [], 0, 0
        self.shared = 0
        self.first = self.last = time.monotonic()

    def take(self, sample):
        time.sleep(self.slow)
        now_ns = time.time_ns()
        message = sample.payload.to_bytes()
        with self.lock:
            self.last = time.monotonic()
            self.first = self.first if self.sequences else self.last
            try:
                sequence, _, _ = read_attachment(sample.attachment and sample.attachment.to_bytes())
            except ValueError:
                self.bad += 1
                return
            self.sequences.append(sequence)
            self.bytes += len(message)
            self.shared += sample.payload.as_shm() is not None
            self.latencies_ms.append((now_ns - stamp_ns(message)) / 1e6)

    def summary(self):
        with self.lock:
            latencies = sorted(self.latencies_ms)
            received = len(self.sequences)
            wanted = max(self.sequences) - min(self.sequences) + 1 if received else 0
            return {
                "received": received,
                "lost": wanted - len(set(self.sequences)),
                "twice": received - len(set(self.sequences)),
                "bad_attachments": self.bad,
                "bytes": self.bytes,
                "in_shared_memory": self.shared,
                "seconds": round(self.last - self.first, 3),
                "latency_ms": {
                    name: round(latencies[min(received - 1, int(part * received))], 2) if received else None
                    for name, part in [("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("max", 1.0)]
                },
            }


def receive(arguments, node):
    received = Received(arguments.slow)
    kind = (arguments.type, arguments.hash)
    subscriber = node.subscriber(arguments.topic, kind, received.take)
    say(event="ready")
    begin = time.monotonic()
    while not is_over(arguments, received, begin):
        time.sleep(0.05)
    subscriber.undeclare()
    say(event="received", **received.summary())


def is_over(arguments, received, begin):
    now = time.monotonic()
    num, quiet = len(received.sequences), now - received.last
    if arguments.count and num >= arguments.count:
        return True
    if arguments.last and num and max(received.sequences) >= arguments.last:
        return True
    return (num and quiet > arguments.idle) or now - begin > arguments.seconds + arguments.idle


def linger(seconds):
    """Until whoever started this closes its standard input, or for some seconds."""
    closed = threading.Thread(target=sys.stdin.read, daemon=True)
    closed.start()
    closed.join(seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["send", "receive"])
    parser.add_argument("--connect", default="tcp/localhost:7447")
    parser.add_argument("--mode", default="peer", choices=["peer", "client"])
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--topic", default="/image_raw")
    parser.add_argument("--type", default=rmw_zenoh.IMAGE[0])
    parser.add_argument("--hash", default=rmw_zenoh.IMAGE[1])
    parser.add_argument("--width", type=int, default=2592)
    parser.add_argument("--height", type=int, default=2048)
    parser.add_argument("--fps", type=float, default=22.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--count", type=int, default=0, help="messages, instead of --seconds")
    parser.add_argument("--last", type=int, default=0, help="ends receiving at the message of this sequence number")
    parser.add_argument("--idle", type=float, default=5.0, help="ends receiving after this many quiet seconds")
    parser.add_argument("--linger", type=float, default=2.0, help="seconds a sender stays behind its last image")
    parser.add_argument("--subscribers", type=int, default=1, help="how many a sender waits for")
    parser.add_argument("--slow", type=float, default=0.0, help="seconds that a receiver takes for each message")
    parser.add_argument("--stripe", action="store_true", help="send a laser stripe instead of a pattern")
    parser.add_argument("--reliable", action="store_true", help="offer reliable instead of best effort")
    parser.add_argument("--log", help="file for the sequence number and the time of each image that is sent")
    parser.add_argument("--config", action="append", default=[], help="key=value of Zenoh's configuration")
    arguments = parser.parse_args()
    session = open_session([arguments.connect], mode=arguments.mode, overrides=arguments.config)
    node = Node(session, arguments.domain, f"load_{arguments.command}")
    (send if arguments.command == "send" else receive)(arguments, node)
    session.close()


main()
