"""A client of the action ~/scan, as rcl's action clients are on rmw_zenoh: three services and two topics.

Sends a goal, says whether it is accepted, then waits for its result; a line "cancel" on standard input cancels it.
Message layouts are written here from their .msg files, not by this project's own code.
"""

import argparse
import itertools
import struct
import sys
import threading
import time
import uuid

import zenoh

from rmw_zenoh import Node, align, attachment, data_key, open_session, put_text, read_attachment, say

ENCAPSULATION = b"\x00\x01\x00\x00"


class Reader:
    """The fields of a message, one after another."""

    def __init__(self, message):
        assert message[:4] == ENCAPSULATION, message[:4]
        self.bytes, self.at = message[4:], 0

    def number(self, kind):
        size = struct.calcsize(kind)
        self.at += -self.at % size
        (value,) = struct.unpack_from("<" + kind, self.bytes, self.at)
        self.at += size
        return value

    def raw(self, size):
        self.at += size
        return self.bytes[self.at - size : self.at]

    def text(self):
        length = self.number("I")
        return self.raw(length)[:-1].decode()


def send_goal(goal_id, arguments):
    """Scan_SendGoal_Request: identity, part, length, frames, time, position of the first row, recording."""
    out = bytearray(goal_id)
    put_text(out, arguments.part)
    align(out, 8)
    out += struct.pack("<dQiId?", arguments.length, arguments.frames, 0, 0, float("nan"), arguments.record)
    return ENCAPSULATION + bytes(out)


def result(message):
    """Scan_GetResult_Response."""
    fields = Reader(message)
    status, outcome, text = fields.number("b"), fields.number("B"), fields.text()
    scan_id = fields.raw(16).hex()
    names = ("expected", "accepted", "missing", "rejected", "points")
    numbers = {name: fields.number("Q") for name in names}
    length = fields.number("d")
    lists = [[fields.text() for _ in range(fields.number("I"))] for _ in range(2)]
    assert fields.at == len(fields.bytes), (fields.at, len(fields.bytes))
    # JSON has no NaN.
    length = None if length != length else length
    return {"status": status, "outcome": outcome, "message": text, "scan_id": scan_id, **numbers,
            "length": length, "recordings": lists[0], "hashes": lists[1]}


class Client:
    """The endpoints of an action client."""

    def __init__(self, node, arguments):
        self.node, self.numbers, self.feedback, self.statuses = node, itertools.count(1), [], []
        self.action, self.kinds = arguments.topic, dict(kind.split("=", 1) for kind in arguments.kind)
        self.queriers = {}
        for part in ("send_goal", "cancel_goal", "get_result"):
            kind = self.kind(part)
            node.declare_endpoint("SC", self.name(part), kind)
            key = data_key(node.domain, self.name(part), kind)
            self.queriers[part] = node.session.declare_querier(key, target=zenoh.QueryTarget.ALL, timeout=60.0)
        self.subscribers = [
            node.subscriber(self.name("feedback"), self.kind("feedback"), self.take_feedback),
            node.subscriber(self.name("status"), self.kind("status"), self.take_status, latched=1),
        ]
        deadline = time.monotonic() + 30
        while not all(querier.matching_status.matching for querier in self.queriers.values()):
            assert time.monotonic() < deadline, "no action within 30 s"
            time.sleep(0.02)

    def name(self, part):
        return f"{self.action}/_action/{part}"

    def kind(self, part):
        name, type_hash = self.kinds[part].split("=")
        return name, type_hash

    def take_feedback(self, sample):
        fields = Reader(sample.payload.to_bytes())
        goal_id = fields.raw(16)
        accepted, missing = fields.number("Q"), fields.number("Q")
        position, progress = fields.number("d"), fields.number("f")
        self.feedback.append((goal_id, accepted, missing, position, progress))

    def take_status(self, sample):
        fields = Reader(sample.payload.to_bytes())
        goals = []
        for _ in range(fields.number("I")):
            goal_id = fields.raw(16)
            fields.number("i"), fields.number("I")
            goals.append((goal_id, fields.number("b")))
        self.statuses.append(goals)

    def call(self, part, request):
        # A goal is cancelled while its result is awaited.
        number = next(self.numbers)
        beside = attachment(number, self.node.gid)
        for reply in self.queriers[part].get(payload=request, attachment=beside):
            assert reply.ok is not None, reply.err.payload.to_string()
            echo, _, gid = read_attachment(reply.ok.attachment.to_bytes())
            assert (echo, gid) == (number, self.node.gid)
            return reply.ok.payload.to_bytes()
        raise SystemExit(f"{part}: no response")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("command", choices=["action"])
    parser.add_argument("--connect", required=True)
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--topic", required=True, help="name of the action")
    parser.add_argument("--kind", action="append", required=True, help="part=type=hash")
    parser.add_argument("--part", default="part 7")
    parser.add_argument("--length", type=float, default=0.0)
    parser.add_argument("--frames", type=int, default=0)
    parser.add_argument("--record", action="store_true")
    arguments = parser.parse_args()
    client = Client(Node(open_session([arguments.connect]), arguments.domain), arguments)
    goal_id = uuid.uuid4().bytes
    response = Reader(client.call("send_goal", send_goal(goal_id, arguments)))
    say(event="goal", accepted=response.number("?"))

    def wait_to_cancel():
        if sys.stdin.readline().strip() == "cancel":
            # GoalInfo: identity and no time.
            answer = Reader(client.call("cancel_goal", ENCAPSULATION + goal_id + bytes(8)))
            say(event="canceling", code=answer.number("b"), goals=answer.number("I"))

    threading.Thread(target=wait_to_cancel, daemon=True).start()
    found = result(client.call("get_result", ENCAPSULATION + goal_id))
    # The last state is published before the result; it comes on another way.
    # A goal that is unknown has none.
    deadline = time.monotonic() + 30
    while found["status"] and not any((goal_id, found["status"]) in goals for goals in client.statuses):
        assert time.monotonic() < deadline, client.statuses
        time.sleep(0.02)
    states = [status for goals in client.statuses for goal, status in goals if goal == goal_id]
    own = [entry for entry in client.feedback if entry[0] == goal_id]
    say(event="result", **found, states=states, feedback=[entry[1] for entry in own], progress=[entry[4] for entry in own])
    sys.stdin.read()


main()
