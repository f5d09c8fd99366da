"""What rmw_zenoh_cpp 0.2.5 and later do, in Python: sessions, keys, tokens, attachments, images.

Written from its sources for tests, not from this project's: two readings of the same rules.
"""

import json
import struct
import threading
import time
import uuid
from dataclasses import dataclass, field

import zenoh
import zenoh.ext

IMAGE = (
    "sensor_msgs/msg/Image",
    "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
)


def open_session(connect=(), listen=("tcp/localhost:0",), mode="peer", overrides=()):
    """A session as DEFAULT_RMW_ZENOH_SESSION_CONFIG.json5 has it, or a router."""
    values = {
        "mode": mode,
        "connect/endpoints": list(connect),
        "listen/endpoints": list(listen) if mode != "client" else [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/target": {"router": ["router", "peer"], "peer": ["router"]},
        "scouting/gossip/autoconnect_strategy": {
            "peer": {"to_router": "always", "to_peer": "greater-zid"}
        },
        "timestamping/enabled": {"router": True, "peer": True, "client": True},
        "routing/router/peers_failover_brokering": False,
        "queries_default_timeout": 60000,
        # Otherwise a sender gives up an image after 50 ms, and a client looks for its router every 4 s.
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 50000,
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 500000,
        "connect/retry": {"period_init_ms": 500, "period_max_ms": 1000, "period_increase_factor": 2},
        "transport/shared_memory/enabled": False,
    }
    config = zenoh.Config()
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    for override in overrides:
        key, value = override.split("=", 1)
        config.insert_json5(key, value)
    return zenoh.open(config)


SAYING = threading.Lock()


def say(**event):
    """One line; Zenoh's threads and the script's own say things at the same time."""
    with SAYING:
        print(json.dumps(event), flush=True)


def wire_type(name):
    package, kind, type_name = name.split("/")
    return f"{package}::{kind}::dds_::{type_name}_"


def data_key(domain, topic, kind):
    return f"{domain}/{topic.strip('/')}/{wire_type(kind[0])}/{kind[1]}"


def attachment(sequence, gid, now_ns=None):
    return struct.pack("<qqB", sequence, now_ns or time.time_ns(), len(gid)) + gid


def old_attachment(sequence, gid):
    """Before 0.2.5: every field behind its name."""

    def text(name):
        return bytes([len(name)]) + name.encode()

    parts = [text("sequence_number"), struct.pack("<q", sequence)]
    parts += [text("source_timestamp"), struct.pack("<q", time.time_ns())]
    parts += [text("source_gid"), bytes([len(gid)]), gid]
    return b"".join(parts)


def read_attachment(data):
    """(sequence, source time, gid); ValueError when it is another format."""
    if data is None or len(data) != 33 or data[16] != 16:
        raise ValueError(f"attachment {data!r}")
    return (*struct.unpack("<qq", data[:16]), data[17:])


@dataclass
class Node:
    """A node and its tokens; endpoints stay declared as long as it lives."""

    session: zenoh.Session
    domain: int
    name: str = "peer"
    tokens: list = field(default_factory=list)
    gid: bytes = field(default_factory=lambda: uuid.uuid4().bytes)

    def __post_init__(self):
        self.zid = str(self.session.info.zid())
        self.declare(f"@ros2_lv/{self.domain}/{self.zid}/0/0/NN/%/%/{self.name}")

    def declare(self, token):
        self.tokens.append(self.session.liveliness().declare_token(token))

    def declare_endpoint(self, side, topic, kind, qos="::,10:,:,:,,"):
        mangled = topic.replace("/", "%")
        self.declare(
            f"@ros2_lv/{self.domain}/{self.zid}/0/{len(self.tokens)}/{side}/%/%/{self.name}/{mangled}"
            f"/{wire_type(kind[0])}/{kind[1]}/{qos}"
        )

    def publisher(self, topic, kind, latched=0, reliable=True):
        key = data_key(self.domain, topic, kind)
        options = {
            "congestion_control": zenoh.CongestionControl.DROP,
            "reliability": zenoh.Reliability.RELIABLE if reliable else zenoh.Reliability.BEST_EFFORT,
        }
        if latched:
            options["publisher_detection"] = True
            options["cache"] = zenoh.ext.CacheConfig(latched)
            miss = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5)
            options["sample_miss_detection"] = miss
            publisher = zenoh.ext.declare_advanced_publisher(self.session, key, **options)
        else:
            publisher = self.session.declare_publisher(key, **options)
        qos = f":1:,{latched}:,:,:,," if latched else "::,10:,:,:,,"
        self.declare_endpoint("MP", topic, kind, qos if reliable else "2::,5:,:,:,,")
        return publisher

    def subscriber(self, topic, kind, handler, latched=0):
        key = data_key(self.domain, topic, kind)
        if latched:
            history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=latched)
            recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
            subscriber = zenoh.ext.declare_advanced_subscriber(
                self.session, key, handler, history=history, recovery=recovery, subscriber_detection=True
            )
        else:
            subscriber = self.session.declare_subscriber(key, handler)
        self.declare_endpoint("MS", topic, kind, f":1:,{latched}:,:,:,," if latched else "::,10:,:,:,,")
        return subscriber

    def wait_for_subscribers(self, topic, kind, number=1, seconds=30):
        """Until so many subscribers of the topic have tokens in the graph."""
        side = f"/MS/%/*/*/{topic.replace('/', '%')}/{wire_type(kind[0])}/{kind[1]}/**"
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            found = self.session.liveliness().get(f"@ros2_lv/{self.domain}/*/*/*{side}", timeout=1.0)
            if sum(1 for reply in found if reply.ok is not None) >= number:
                return
            time.sleep(0.02)
        raise SystemExit(f"no subscriber of {topic} within {seconds} s")

    def wait_for_route(self, publisher, seconds=30):
        """Until what is published goes to somebody: a token may come before the route to its owner."""
        deadline = time.monotonic() + seconds
        while not publisher.matching_status.matching:
            if time.monotonic() > deadline:
                raise SystemExit(f"no route to a subscriber of {publisher.key_expr} within {seconds} s")
            time.sleep(0.01)


def image(number, width, height, stamp_ns, encoding="mono8", frame_id="camera", is_stripe=False):
    """sensor_msgs/Image in CDR; byte i of image n is (i + n) % 251, or the image is a laser stripe in the dark."""
    start = number % 251
    pixels = stripe(width, height) if is_stripe else pattern(width * height)[start : start + width * height]
    out = bytearray(struct.pack("<iI", stamp_ns // 10**9, stamp_ns % 10**9))
    put_text(out, frame_id)
    align(out, 4)
    out += struct.pack("<II", height, width)
    put_text(out, encoding)
    out.append(0)
    align(out, 4)
    out += struct.pack("<II", width, len(pixels))
    return b"\x00\x01\x00\x00" + bytes(out) + pixels


STRIPES = {}


def stripe(width, height):
    """A stripe along the middle row, 9 pixels wide, on a ground of 5."""
    if (width, height) not in STRIPES:
        level = {0: 200, 1: 180, 2: 130, 3: 70, 4: 30}
        rows = [bytes([level.get(abs(row - height // 2), 5)]) * width for row in range(height)]
        STRIPES[width, height] = b"".join(rows)
    return STRIPES[width, height]


PATTERNS = {}


def pattern(length):
    if length not in PATTERNS:
        PATTERNS[length] = bytes(range(251)) * (length // 251 + 2)
    return PATTERNS[length]


def put_text(out, text):
    align(out, 4)
    out += struct.pack("<I", len(text) + 1) + text.encode() + b"\0"


def align(out, step):
    out += b"\0" * (-len(out) % step)


def stamp_ns(message):
    """Of any message that begins with a Header."""
    seconds, nanoseconds = struct.unpack("<iI", message[4:12])
    return seconds * 10**9 + nanoseconds
