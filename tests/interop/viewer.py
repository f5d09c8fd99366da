"""A viewer that is not Foxglove's: speaks `foxglove.sdk.v1` by its description and decodes by the schemas it is given."""

import json
import struct
import time

from mcap_ros2._dynamic import generate_dynamic
from websockets.sync.client import connect

PLAYING, PAUSED, BUFFERING, ENDED = range(4)


class Viewer:
    """One connection. `messages` has what came, by topic: (log time, decoded message)."""

    def __init__(self, url, protocol="foxglove.sdk.v1"):
        self.socket = connect(url, subprotocols=[protocol], max_size=None)
        self.info, self.channels, self.services = None, {}, {}
        self.parameters, self.errors, self.states, self.times = {}, [], [], []
        self.messages, self.answers, self.graph = {}, {}, {}
        self.decoders, self.topics = {}, {}
        self.num_asked = 0
        self.wait(lambda: self.info is not None)

    def read(self, timeout):
        """Takes one message; whether one came."""
        try:
            message = self.socket.recv(timeout=timeout)
        except TimeoutError:
            return False
        if isinstance(message, str):
            self.take_text(json.loads(message))
        else:
            self.take_binary(message)
        return True

    def wait(self, is_done, seconds=20.0):
        """Reads until it is done; fails when that takes too long."""
        end = time.monotonic() + seconds
        while not is_done():
            left = end - time.monotonic()
            assert left > 0, f"still waiting after {seconds} s; errors: {self.errors}"
            self.read(left)

    def drain(self, seconds=0.3):
        """Reads until nothing has come for a while."""
        while self.read(seconds):
            pass

    def take_text(self, message):
        kind = message["op"]
        if kind == "serverInfo":
            self.info = message
        elif kind == "advertise":
            for channel in message["channels"]:
                self.channels[channel["topic"]] = channel
        elif kind == "unadvertise":
            gone = set(message["channelIds"])
            self.channels = {t: c for t, c in self.channels.items() if c["id"] not in gone}
        elif kind == "advertiseServices":
            for service in message["services"]:
                self.services[service["name"]] = service
        elif kind == "parameterValues":
            for parameter in message["parameters"]:
                self.parameters[parameter["name"]] = parameter["value"]
        elif kind == "status":
            self.errors.append(message["message"])
        elif kind == "connectionGraphUpdate":
            self.graph = message
        elif kind == "serviceCallFailure":
            self.answers[message["callId"]] = message["message"]

    def take_binary(self, message):
        kind = message[0]
        if kind == 1:
            subscription, log_time = struct.unpack_from("<IQ", message, 1)
            topic = self.topics[subscription]
            decoded = self.decoders[topic](bytes(message[13:]))
            self.messages.setdefault(topic, []).append((log_time, decoded))
        elif kind == 2:
            self.times.append(struct.unpack_from("<Q", message, 1)[0])
        elif kind == 3:
            _, call, length = struct.unpack_from("<III", message, 1)
            self.answers[call] = bytes(message[13 + length :])
        elif kind == 5:
            status, now, speed, did_seek, length = struct.unpack_from("<BQfBI", message, 1)
            request = bytes(message[19 : 19 + length]).decode()
            self.states.append((status, now, speed, bool(did_seek), request))

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def subscribe(self, *topics):
        self.wait(lambda: all(topic in self.channels for topic in topics))
        subscriptions = []
        for topic in topics:
            channel = self.channels[topic]
            assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg"), channel
            decoders = generate_dynamic(channel["schemaName"], channel["schema"])
            self.decoders[topic] = decoders[channel["schemaName"]]
            self.topics[len(self.topics) + 1] = topic
            subscriptions.append({"id": len(self.topics), "channelId": channel["id"]})
        self.send(op="subscribe", subscriptions=subscriptions)

    def forget(self):
        self.messages, self.states, self.times, self.errors = {}, [], [], []

    def last(self, topic):
        return self.messages[topic][-1][1]

    def set(self, name, value):
        """Sets a parameter and waits for what is in force then."""
        self.parameters.pop(name, None)
        self.num_asked += 1
        parameters = [{"name": name, "value": value}]
        self.send(op="setParameters", parameters=parameters, id=f"set {self.num_asked}")
        self.wait(lambda: name in self.parameters)
        return self.parameters[name]

    def control(self, command, speed=1.0, seek=None):
        """Plays (0) or pauses (1); the state that the server answers with."""
        self.num_asked += 1
        request = f"control {self.num_asked}".encode()
        head = struct.pack("<BBfBQI", 3, command, speed, seek is not None, seek or 0, len(request))
        self.socket.send(head + request)
        self.wait(lambda: any(state[4] == request.decode() for state in self.states))
        return next(state for state in self.states if state[4] == request.decode())

    def call(self, name, payload):
        """Calls a service with CDR bytes; the bytes of its answer, or a text of what went wrong."""
        self.wait(lambda: name in self.services)
        self.num_asked += 1
        call, encoding = self.num_asked, b"cdr"
        head = struct.pack("<BIII", 2, self.services[name]["id"], call, len(encoding))
        self.socket.send(head + encoding + payload)
        self.wait(lambda: call in self.answers)
        return self.answers[call]


def stamp_ns(message):
    stamp = message.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec
