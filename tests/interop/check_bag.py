#!/usr/bin/env python3
"""Opens a bag with independent readers, decodes every message and compares what each reader sees.

usage: check_bag.py BAG [--expect TOPIC=COUNT]...        BAG: a rosbag2 directory or an .mcap file
exit : 0 all readers agree and every expectation holds, 1 otherwise
needs: pip install -r requirements.txt
"""

import argparse
import subprocess
import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader


def require(condition, complaint):
    if not condition:
        raise ValueError(complaint)


def files_of(bag):
    return sorted(bag.glob("*.mcap")) if bag.is_dir() else [bag]


def with_mcap(bag):
    """Foxglove's reader, checksums on; also what rosbag2 needs of the file: statistics, schemas, times in order."""
    seen = Counter()
    for path in files_of(bag):
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            require(reader.get_header().profile == "ros2", f"{path}: profile is not ros2")
            summary = reader.get_summary()
            require(summary and summary.statistics, f"{path}: no statistics")
            for channel in summary.channels.values():
                require(channel.message_encoding == "cdr", f"{channel.topic}: {channel.message_encoding}")
                schema = summary.schemas.get(channel.schema_id)
                require(schema and schema.encoding == "ros2msg", f"{channel.topic}: no ros2msg schema")
                for key in ("offered_qos_profiles", "topic_type_hash"):
                    require(channel.metadata.get(key), f"{channel.topic}: no {key}")
            of_file, last_ns = Counter(), {}
            for _, channel, message, _ in reader.iter_decoded_messages(log_time_order=False):
                of_file[channel.topic] += 1
                require(message.log_time >= last_ns.get(channel.topic, 0), f"{channel.topic}: log_time goes back")
                last_ns[channel.topic] = message.log_time
            counts = summary.statistics.channel_message_counts.items()
            stated = Counter()
            for channel_id, count in counts:
                stated[summary.channels[channel_id].topic] += count
            require(+stated == +of_file, f"{path}: statistics {dict(stated)}, messages {dict(of_file)}")
            seen += of_file
    return seen


def with_rosbags(paths):
    """rosbags: another parser of the container, and CDR decoded by the schemas in the file."""
    seen = Counter()
    with AnyReader(paths) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            seen[connection.topic] += 1
    return seen


def with_metadata(bag):
    """What metadata.yaml says, as `ros2 bag info` shows it."""
    with Reader(bag) as reader:
        seen = Counter({connection.topic: connection.msgcount for connection in reader.connections})
        require(reader.message_count == seen.total(), f"metadata.yaml: {reader.message_count} is not the sum")
    return seen


def with_rerun(path):
    """Rerun reads the whole file in its own program; it prints no counts."""
    done = subprocess.run([sys.executable, "-m", "rerun", "mcap", "check", path], capture_output=True, text=True)
    require(done.returncode == 0, (done.stderr or done.stdout).strip())


def readers_of(bag):
    files = files_of(bag)
    require(files, f"{bag}: no .mcap file")
    yield "mcap, mcap-ros2-support", lambda: with_mcap(bag)
    yield "rosbags, files", lambda: with_rosbags(files)
    if bag.is_dir():
        yield "rosbags, directory", lambda: with_rosbags([bag])
        yield "rosbags, metadata.yaml", lambda: with_metadata(bag)
    yield "rerun mcap check", lambda: [with_rerun(path) for path in files] and None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", type=Path)
    parser.add_argument("--expect", action="append", default=[], metavar="TOPIC=COUNT")
    args = parser.parse_args()

    failures, counts = [], {}
    for name, read in readers_of(args.bag):
        try:
            seen = read()
        except Exception as error:  # whatever makes a reader refuse the bag is the finding
            failures.append(f"{name}: {type(error).__name__}: {error}")
            continue
        print(f"{name:24} " + (f"{seen.total()} messages" if seen is not None else "accepts it"))
        if seen is not None:
            counts[name] = +seen
    for name, seen in counts.items():
        for other, seen_by_other in counts.items():
            if name < other and seen != seen_by_other:
                failures.append(f"{name} sees {dict(seen)}, {other} sees {dict(seen_by_other)}")
        for expectation in args.expect:
            topic, _, count = expectation.rpartition("=")
            if seen[topic] != int(count):
                failures.append(f"{name}: {topic} has {seen[topic]} messages, expected {count}")
    print("\n".join(failures) if failures else f"{args.bag.name}: all readers agree")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
