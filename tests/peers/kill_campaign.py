"""Kills the recording node again and again while the machine is busy, and looks for what is missing in its bags.

    python tests/peers/kill_campaign.py target/debug/laser_profiler --rounds 30

Every image that was sent more than a second before the kill, from the first recorded one on, must have its centreline in
the bag, or be counted: the next centreline says how many frames are missing before it (in transport, `frames_missing`;
in the node, the step of `frame_number`), and the last `stream_status` in the bag counts all of them. Prints one JSON object
per round and one at the end; exits with 1 if an image is missing that nothing counts.

Needs: pip install -r tests/interop/requirements.txt
"""

import argparse
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap_ros2.decoder import DecoderFactory

HERE = Path(__file__).parent
SECOND_NS = 1_000_000_000
COUNTERS = (
    "lost_transport", "dropped_overload", "rejected_malformed", "rejected_duplicate", "rejected_out_of_order", "recorder_dropped",
)


def records(path):
    """Every record of a file, up to where it is cut off."""
    with path.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=True, record_size_limit=None).records
        try:
            for record in reader:
                yield from breakup_chunk(record) if isinstance(record, Chunk) else [record]
        except (McapError, EOFError, ValueError) as error:
            # A kill cuts the last record off; anything else would be a fault of the recorder.
            print(f"{path.name}: ends with {type(error).__name__}", file=sys.stderr)


def messages(directory, topic, decode=True):
    """(sequence in the bag, message) of a topic."""
    factory, schemas, channels, decoders = DecoderFactory(), {}, {}, {}
    for path in sorted(directory.glob("*.mcap"), key=lambda path: (len(path.name), path.name)):
        for record in records(path):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and channels[record.channel_id].topic == topic:
                channel = channels[record.channel_id]
                if not decode:
                    yield record.sequence, None
                    continue
                if channel.id not in decoders:
                    decoders[channel.id] = factory.decoder_for(channel.message_encoding, schemas[channel.schema_id])
                yield record.sequence, decoders[channel.id](record.data)


def nanoseconds(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def examine(directory, sent, killed_ns):
    """What is missing in the bag, and what of it is not counted."""
    numbers = {time_ns: number for number, time_ns in sent.items()}
    lines = [
        (numbers[nanoseconds(line.header.stamp)], sequence, line.trace)
        for sequence, line in messages(directory, "/laser_profiler/centerline")
    ]
    statuses = [status for _, status in messages(directory, "/laser_profiler/stream_status")]
    recorder_dropped = max((status.recorder_dropped for status in statuses), default=0)
    if not lines or not statuses:
        raise SystemExit(f"{directory}: no centreline or no status was recorded")
    # The recording begins with the node, and so do its counters.
    counted = sum(getattr(statuses[-1], name) for name in COUNTERS)
    missing = in_transport = in_node = in_recorder = uncounted = old = 0
    for (before, sequence_before, trace_before), (number, sequence, trace) in zip(lines, lines[1:]):
        gap = number - before - 1
        stepped = trace.frame_number - trace_before.frame_number - 1
        not_recorded = sequence - sequence_before - 1
        missing += gap
        old += gap if sent[number] < killed_ns - SECOND_NS else 0
        in_transport += trace.frames_missing if trace.frames_missing_valid else 0
        in_node += max(0, stepped - trace.frames_missing - not_recorded)
        in_recorder += not_recorded
        uncounted += max(0, gap - stepped)
    uncounted += max(0, in_recorder - recorder_dropped)
    last = lines[-1][0] if lines else 0
    first = lines[0][0] if lines else 1
    late = [number for number, time_ns in sent.items() if number > last and time_ns < killed_ns - SECOND_NS]
    return {
        "sent": len(sent), "first": first, "recorded": len(lines), "missing": missing, "in_transport": in_transport,
        "in_node": in_node, "in_recorder": in_recorder, "uncounted": uncounted,
        "unreported": max(0, old - counted), "lost_at_the_end": len(late),
        "last_age_s": round((killed_ns - sent[last]) / 1e9, 3) if lines else None,
        "status": {
            name: getattr(statuses[-1], name)
            for name in ("frames_received", "frames_processed", "lost_transport", "dropped_overload", "recorder_dropped")
        } if statuses else None,
    }


def examine_images(directory, sent, killed_ns, results):
    """The images that are missing in their own bag: those that the node dropped are counted with the results, the others
    were dropped by the recorder."""
    numbers = [sequence for sequence, _ in messages(directory, "/image_raw", decode=False)]
    gaps = list(zip(numbers, numbers[1:]))
    missing = sum(number - before - 1 for before, number in gaps)
    old = sum(number - before - 1 for before, number in gaps if sent[number] < killed_ns - SECOND_NS)
    counted = sum(results["status"].values()) - results["status"]["frames_received"] - results["status"]["frames_processed"]
    last = numbers[-1]
    late = [number for number, time_ns in sent.items() if number > last and time_ns < killed_ns - SECOND_NS]
    return {
        "images": len(numbers), "images_missing": missing, "unreported": results["unreported"] + max(0, old - counted),
        "lost_at_the_end": results["lost_at_the_end"] + len(late), "last_image_age_s": round((killed_ns - sent[last]) / 1e9, 3),
    }


def burn():
    while True:
        pass


def play_round(arguments, number, place):
    """One node, one camera, one kill."""
    port, log = 18000 + (os.getpid() + number) % 2000, place / "sent"
    at, domain = f"tcp/127.0.0.1:{port}", str(number % 90 + 1)
    environment = {**os.environ, "ROS_DOMAIN_ID": domain, "ZENOH_CONFIG_OVERRIDE": f'listen/endpoints=["{at}"]'}
    node = subprocess.Popen(
        [arguments.node, "run", "--transport", "zenoh", "--router", "--ros-args", "-p", "recording.enabled:=true",
         "-p", f"recording.directory:={place / 'bags'}", "-p", "recording.min_free_bytes:=0",
         "-p", f"recording.images:={'true' if arguments.images else 'false'}"],
        env=environment, stderr=(place / "log").open("w"), stdout=subprocess.DEVNULL,
    )
    size = ["--width", str(arguments.width), "--height", str(arguments.height), "--fps", str(arguments.fps)]
    camera = subprocess.Popen(
        [sys.executable, HERE / "zenoh_images.py", "send", "--connect", at, "--domain", domain, "--stripe", *size,
         "--seconds", "600", "--log", log],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
    )
    try:
        deadline = time.monotonic() + 60
        while not log.exists() or log.stat().st_size == 0:
            assert time.monotonic() < deadline, (place / "log").read_text()
            time.sleep(0.05)
        time.sleep(arguments.seconds + random.random())
        node.send_signal(signal.SIGKILL)
        killed_ns = time.time_ns()
        node.wait()
    finally:
        camera.kill()
        camera.wait()
        node.kill()
        node.wait()
    lines = [line.split() for line in log.read_text().splitlines()]
    sent = {int(line[0]): int(line[1]) for line in lines if len(line) == 2 and int(line[1]) < killed_ns}
    bags = sorted((place / "bags").iterdir(), key=lambda bag: bag.name.endswith("_images"))
    found = examine(bags[0], sent, killed_ns)
    if arguments.images:
        found.update(examine_images(bags[1], sent, killed_ns, found))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("node", type=Path)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--seconds", type=float, default=4.0, help="from the first image to the kill, and up to 1 more")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--fps", type=float, default=100.0)
    parser.add_argument("--images", action="store_true", help="record the images, too, and look for them")
    parser.add_argument("--burners", type=int, default=os.cpu_count(), help="processes that do nothing but compute")
    arguments = parser.parse_args()
    arguments.node = arguments.node.resolve()
    burners = [multiprocessing.Process(target=burn, daemon=True) for _ in range(arguments.burners)]
    for burner in burners:
        burner.start()
    rounds = []
    for number in range(arguments.rounds):
        with tempfile.TemporaryDirectory() as place:
            rounds.append(play_round(arguments, number, Path(place)))
        print(json.dumps({"round": number + 1, **rounds[-1]}), flush=True)
    total = {name: sum(found[name] for found in rounds)
             for name in ("sent", "recorded", "missing", "in_transport", "in_node", "uncounted", "unreported", "lost_at_the_end")}
    total["rounds_unreported"] = sum(found["unreported"] > 0 for found in rounds)
    print(json.dumps({"rounds": len(rounds), "worst_age_s": max(found["last_age_s"] for found in rounds), **total}))
    return 1 if total["uncounted"] or total["unreported"] or total["lost_at_the_end"] else 0


if __name__ == "__main__":
    sys.exit(main())
