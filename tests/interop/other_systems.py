"""Writes the images of a bag as other systems record them: ros1.mcap (with rosbags) and foxglove.mcap (with Protobuf).

usage: other_systems.py BAG DIRECTORY
"""

import pathlib
import struct
import sys

import numpy
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore


def images(bag):
    with AnyReader([pathlib.Path(bag)], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, time, data in reader.messages():
            yield time, reader.deserialize(data, connection.msgtype)


def ros1(found, path):
    """Everything in the encoding of ROS 1, by rosbags."""
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start("ros1")
        channels = {}
        for topic, name in [
            ("/image_raw", "sensor_msgs/msg/Image"),
            ("/camera_info", "sensor_msgs/msg/CameraInfo"),
            ("/joint_states", "sensor_msgs/msg/JointState"),
        ]:
            definition = store.generate_msgdef(name, ros_version=1)[0]
            schema = writer.register_schema(name.replace("/msg/", "/"), "ros1msg", definition.encode())
            channels[name] = writer.register_channel(topic, "ros1", schema)

        def put(name, message, time):
            data = bytes(store.serialize_ros1(message, name))
            writer.add_message(channels[name], time, data, time)

        stamp_of, header_of = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
        for number, (time, image) in enumerate(found):
            stamp = stamp_of(sec=image.header.stamp.sec, nanosec=image.header.stamp.nanosec)
            header = header_of(seq=number, stamp=stamp, frame_id=image.header.frame_id)
            kind = types["sensor_msgs/msg/Image"]
            fields = ["height", "width", "encoding", "is_bigendian", "step", "data"]
            values = {field: getattr(image, field) for field in fields}
            put(kind.__msgtype__, kind(header=header, **values), time)
            kind = types["sensor_msgs/msg/JointState"]
            one = numpy.array([float(number)])
            none = numpy.array([])
            put(kind.__msgtype__, kind(header=header, name=["axis"], position=one, velocity=none, effort=none), time)
        writer.finish()


def varint(number):
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    out.append(number)
    return bytes(out)


def foxglove(found, path):
    """foxglove.RawImage: timestamp 1, width 2, height 3, encoding 4, step 5, data 6, frame_id 7."""

    def sized(number, data):
        return varint(number << 3 | 2) + varint(len(data)) + data

    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start("")
        schema = writer.register_schema("foxglove.RawImage", "protobuf", b"")
        channel = writer.register_channel("/image_raw", "protobuf", schema)
        for time, image in found:
            stamp = image.header.stamp
            data = b"".join(
                [
                    sized(1, b"\x08" + varint(stamp.sec) + b"\x10" + varint(stamp.nanosec)),
                    struct.pack("<BI", 2 << 3 | 5, image.width),
                    struct.pack("<BI", 3 << 3 | 5, image.height),
                    sized(4, image.encoding.encode()),
                    struct.pack("<BI", 5 << 3 | 5, image.step),
                    sized(6, image.data.tobytes()),
                    sized(7, image.header.frame_id.encode()),
                ]
            )
            writer.add_message(channel, time, data, time)
        writer.finish()


bag, directory = sys.argv[1:]
found = list(images(bag))
ros1(found, pathlib.Path(directory) / "ros1.mcap")
foxglove(found, pathlib.Path(directory) / "foxglove.mcap")
