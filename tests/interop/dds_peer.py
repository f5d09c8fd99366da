"""A peer on DDS with types of its own: the cyclonedds package, which has nothing to do with ours.

    dds_peer.py publish   DOMAIN TOPIC COUNT   images of 64 x 48, ten a second, once a subscriber and a line on stdin are there
    dds_peer.py subscribe DOMAIN TOPIC COUNT   images; latched ones too
    dds_peer.py graph     DOMAIN NODE          endpoints that NODE says are its own, by topic

Each line on stdout is one JSON object.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, annotations, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

PATIENCE_S = 20


@dataclass
@annotations.final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: types.int32
    nanosec: types.uint32


@dataclass
@annotations.final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
@annotations.final
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    header: Header
    height: types.uint32
    width: types.uint32
    encoding: str
    is_bigendian: types.uint8
    step: types.uint32
    data: types.sequence[types.uint8]


@dataclass
@annotations.final
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: types.array[types.uint8, 16]


@dataclass
@annotations.final
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: str
    node_name: str
    reader_gid_seq: types.sequence[Gid]
    writer_gid_seq: types.sequence[Gid]


@dataclass
@annotations.final
class ParticipantEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: types.sequence[NodeEntitiesInfo]


def qos(depth, *more):
    representation = Policy.DataRepresentation(use_cdrv0_representation=True)
    reliability = Policy.Reliability.Reliable(duration(seconds=1))
    return Qos(representation, reliability, Policy.History.KeepLast(depth), *more)


LATCHED = Policy.Durability.TransientLocal


def say(**what):
    print(json.dumps(what), flush=True)


def until(found):
    """What `found` returns once it is something."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        result = found()
        if result:
            return result
        time.sleep(0.01)
    sys.exit(f"nothing came in {PATIENCE_S} s")


def publish(participant, topic, count):
    writer = DataWriter(participant, Topic(participant, topic, Image), qos=qos(10))
    until(lambda: writer.get_matched_subscriptions())
    say(event="matched")
    sys.stdin.readline()
    for number in range(count):
        data = bytes(range(256)) * 12
        header = Header(Time(number, 500), "camera")
        writer.write(Image(header, 48, 64, "mono8", 0, 64, list(data)))
        time.sleep(0.1)
    say(event="sent", count=count)
    time.sleep(1)


def subscribe(participant, topic, count):
    reader = DataReader(participant, Topic(participant, topic, Image), qos=qos(count, LATCHED))
    say(event="ready")
    for _ in range(count):
        image = until(lambda: reader.take(1))[0]
        stamp = image.header.stamp
        source_ns = image.sample_info.source_timestamp
        say(
            event="image",
            stamp=[stamp.sec, stamp.nanosec],
            frame_id=image.header.frame_id,
            size=[image.width, image.height],
            encoding=image.encoding,
            sum=sum(image.data),
            source_ns=source_ns,
        )


def graph(participant, node):
    topic = Topic(participant, "ros_discovery_info", ParticipantEntitiesInfo)
    reader = DataReader(participant, topic, qos=qos(10, LATCHED))
    writers = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    readers = BuiltinDataReader(participant, BuiltinTopicDcpsSubscription)
    topics, own, said = {}, None, None
    while True:
        for endpoint in list(writers.take(100)) + list(readers.take(100)):
            topics[endpoint.key.bytes] = f"{endpoint.topic_name} {endpoint.type_name}"
        for info in reader.take(100):
            for entry in info.node_entities_info_seq:
                if f"{entry.node_namespace}/{entry.node_name}" == node:
                    own = entry
        # The node's message and the discovery of its endpoints come in any order.
        named = lambda gids: sorted(topics.get(bytes(gid.data), "unknown") for gid in gids)
        event = own and dict(readers=named(own.reader_gid_seq), writers=named(own.writer_gid_seq))
        if event != said:
            say(event="node", **event)
            said = event
        time.sleep(0.05)


def main():
    verb, domain, *rest = sys.argv[1:]
    participant = DomainParticipant(int(domain))
    if verb == "publish":
        publish(participant, rest[0], int(rest[1]))
    elif verb == "subscribe":
        subscribe(participant, rest[0], int(rest[1]))
    elif verb == "graph":
        graph(participant, rest[0])
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
