"""A camera on an axis: samples of the axis every 10 ms, and an image half way between two of them, in step with the clock.

Message layouts are written here from their .msg files, not by this project's own code.
"""

import argparse
import struct
import sys
import time

from rmw_zenoh import IMAGE, Node, align, attachment, image, open_session, put_text, say

PERIOD_NS = 10_000_000
ENCAPSULATION = b"\x00\x01\x00\x00"


def header(stamp_ns, frame_id):
    out = bytearray(struct.pack("<iI", stamp_ns // 10**9, stamp_ns % 10**9))
    put_text(out, frame_id)
    return out


def encoder(number, stamp_ns):
    """laser_profiler_msgs/EncoderStamped: 7 counts of 10 µm a sample, from 1000."""
    out = header(stamp_ns, "axis")
    align(out, 8)
    out += struct.pack("<qdq?", 1000 + 7 * number, 1e-5, 0, False)
    align(out, 4)
    out += struct.pack("<fI", float("nan"), 0)
    return ENCAPSULATION + bytes(out)


def tf(number, stamp_ns):
    """tf2_msgs/TFMessage: the camera in the base, 1 mm along x a sample."""
    out = bytearray(struct.pack("<I", 1)) + header(stamp_ns, "base")
    put_text(out, "camera")
    align(out, 8)
    out += struct.pack("<7d", 1e-3 * number, 0.5, 0.25, 0.0, 0.0, 0.0, 1.0)
    return ENCAPSULATION + bytes(out)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("command", choices=["encoder", "tf"])
    parser.add_argument("--connect", required=True)
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--topic", required=True, help="of the images")
    parser.add_argument("--axis-topic", required=True)
    parser.add_argument("--type", required=True)
    parser.add_argument("--hash", required=True)
    parser.add_argument("--count", type=int, default=100)
    arguments = parser.parse_args()
    session = open_session(connect=[arguments.connect])
    node = Node(session, arguments.domain)
    kind = (arguments.type, arguments.hash)
    axis, images = node.publisher(arguments.axis_topic, kind), node.publisher(arguments.topic, IMAGE)
    node.wait_for_subscribers(arguments.axis_topic, kind)
    node.wait_for_subscribers(arguments.topic, IMAGE)
    sample = {"encoder": encoder, "tf": tf}[arguments.command]
    start_ns = time.time_ns()

    def at(stamp_ns):
        time.sleep(max(0, stamp_ns - time.time_ns()) / 1e9)
        return stamp_ns

    for number in range(arguments.count + 1):
        stamp_ns = at(start_ns + number * PERIOD_NS)
        axis.put(sample(number, stamp_ns), attachment=attachment(number + 1, node.gid, stamp_ns))
        if number < arguments.count:
            stamp_ns = at(stamp_ns + PERIOD_NS // 2)
            picture = image(number, 64, 48, stamp_ns, is_stripe=True)
            images.put(picture, attachment=attachment(number + 1, node.gid, stamp_ns))
    say(event="sent", start_ns=start_ns)
    sys.stdin.read()
    session.close()


main()
