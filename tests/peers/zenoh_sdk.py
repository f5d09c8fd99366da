"""Images with zenoh-ros2-sdk: publish|subscribe PORT DOMAIN TOPIC HASH."""

import sys

import numpy
from rmw_zenoh import say
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession

TIME = ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n")
HEADER = ("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id\n")
IMAGE = (
    "sensor_msgs/msg/Image",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
    "uint32 step\nuint8[] data\n",
)


def main():
    command, port, domain, topic, type_hash = sys.argv[1:]
    session = ZenohSession.get_instance("127.0.0.1", int(port))
    # Otherwise it fetches the definitions from the net.
    for name, definition in [TIME, HEADER]:
        session.register_message_type(definition, name)
    common = {
        "topic": topic,
        "msg_type": IMAGE[0],
        "msg_definition": IMAGE[1],
        "domain_id": int(domain),
        "router_port": int(port),
        "type_hash": type_hash,
    }
    if command == "publish":
        publisher = ROS2Publisher(**common)
        say(event="ready")
        sys.stdin.readline()
        types = session.store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 2), "sdk")
        pixels = numpy.arange(8, dtype=numpy.uint8)
        for _ in range(3):
            publisher.publish(
                header=header, height=2, width=4, encoding="mono8", is_bigendian=0, step=4, data=pixels
            )
    else:
        ROS2Subscriber(callback=show, **common)
        say(event="ready")
    sys.stdin.read()
    session.close()


def show(image):
    data = bytes(image.data).hex()
    say(event="message", width=image.width, encoding=image.encoding, data=data)


main()
