"""Peers of the Zenoh tests, one command each: every event is one JSON object on a line.

All end when their standard input is closed.
"""

import argparse
import random
import sys
import threading
import time

import xxhash
import zenoh

from rmw_zenoh import Node, attachment, data_key, old_attachment, open_session, read_attachment, say


def wait_for(condition, what, seconds=30):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise SystemExit(f"no {what} within {seconds} s")
        time.sleep(0.02)


def wait_for_end():
    sys.stdin.read()


def router(arguments):
    session = open_session(listen=[arguments.listen], mode="router")
    say(event="ready")
    wait_for_end()
    session.close()


def attach(format, sequence, gid):
    if format == "none":
        return None
    if format == "old":
        return old_attachment(sequence, gid)
    return attachment(sequence, gid)[: 20 if format == "short" else None]


def talk(arguments, node):
    """Publishes --count messages of --bytes bytes, all 7, with the attachment asked for."""
    kind = (arguments.type, arguments.hash)
    publisher = node.publisher(arguments.topic, kind, latched=arguments.latched)
    if not arguments.latched:
        node.wait_for_subscribers(arguments.topic, kind)
    key = data_key(node.domain, arguments.topic, kind) + arguments.suffix
    for sequence in range(1, arguments.count + 1):
        payload, beside = bytes([7]) * arguments.bytes, attach(arguments.attachment, sequence, node.gid)
        if arguments.suffix:
            node.session.put(key, payload, attachment=beside)
        else:
            publisher.put(payload, attachment=beside)
    say(event="sent", sent=arguments.count)
    wait_for_end()


def listen(arguments, node):
    def take(sample):
        beside = sample.attachment and sample.attachment.to_bytes()
        sequence, source_time_ns, gid = read_attachment(beside)
        payload = list(sample.payload.to_bytes())
        say(event="message", payload=payload, sequence=sequence, source_time_ns=source_time_ns, gid=gid.hex())

    subscriber = node.subscriber(arguments.topic, (arguments.type, arguments.hash), take, arguments.latched)
    say(event="ready")
    wait_for_end()
    subscriber.undeclare()


def relay(arguments, node):
    """Hands messages on with their own attachments, and drops some; never the first. Says what it did after --count.

    A loss is seen at the next message: those behind the last that was handed on are not injected.
    """
    kind = (arguments.type, arguments.hash)
    publisher = node.publisher(arguments.to, kind)
    node.wait_for_subscribers(arguments.to, kind)
    chance, is_over = random.Random(arguments.seed), threading.Event()
    forwarded, injected, waiting = 0, 0, 0

    def take(sample):
        nonlocal forwarded, injected, waiting
        if forwarded and chance.random() * 100 < arguments.loss:
            waiting += 1
        else:
            publisher.put(sample.payload, attachment=sample.attachment)
            forwarded, injected, waiting = forwarded + 1, injected + waiting, 0
        if forwarded + injected + waiting == arguments.count:
            is_over.set()

    subscriber = node.subscriber(arguments.topic, kind, take)
    say(event="ready")
    is_over.wait()
    say(event="relayed", forwarded=forwarded, injected=injected)
    wait_for_end()
    subscriber.undeclare()


def call(arguments, node):
    """Calls a service --count times; says each answer, and whether it carries the request's own number."""
    kind = (arguments.type, arguments.hash)
    node.declare_endpoint("SC", arguments.topic, kind)
    key = data_key(node.domain, arguments.topic, kind)
    querier = node.session.declare_querier(key, target=zenoh.QueryTarget.ALL, timeout=20.0)
    wait_for(lambda: querier.matching_status.matching, f"service {arguments.topic}")
    say(event="ready")
    for line in sys.stdin:
        for sequence in range(1, int(line) + 1):
            beside = attach(arguments.attachment, sequence, node.gid)
            replies = querier.get(payload=bytes.fromhex(arguments.payload), attachment=beside)
            for reply in replies:
                if reply.ok is None:
                    say(event="refused", reason=reply.err.payload.to_string())
                    continue
                echo, _, gid = read_attachment(reply.ok.attachment and reply.ok.attachment.to_bytes())
                is_echo = echo == sequence and gid == node.gid and str(reply.ok.key_expr) == key
                say(event="answer", payload=reply.ok.payload.to_bytes().hex(), is_echo=is_echo)
        say(event="done")


def graph(arguments, node):
    """Waits until --node has as many tokens as each line says, and says which, with the identity that belongs to each."""

    def tokens():
        replies = node.session.liveliness().get(f"@ros2_lv/{node.domain}/**", timeout=2.0)
        found = sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)
        return [token for token in found if arguments.node in token.split("/")]

    for line in sys.stdin:
        found = []

        def is_complete():
            found[:] = tokens()
            return len(found) == int(line)

        wait_for(is_complete, f"{int(line)} tokens of {arguments.node}")
        say(event="tokens", tokens={token: gid(token) for token in found})


def gid(token):
    """The low half of the hash first, each half little-endian."""
    return xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little").hex()


def token(arguments, node):
    """Declares any token."""
    node.declare(arguments.to.replace("ZID", node.zid))
    say(event="ready")
    wait_for_end()


def main():
    commands = {"talk": talk, "listen": listen, "relay": relay, "call": call, "graph": graph, "token": token}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("command", choices=["router", *commands])
    parser.add_argument("--listen", help="endpoint of a router")
    parser.add_argument("--connect", help="endpoint of the router")
    parser.add_argument("--mode", default="peer")
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--topic")
    parser.add_argument("--to", help="topic of what is handed on, or a token")
    parser.add_argument("--type", default="std_msgs/msg/String")
    parser.add_argument("--hash", default="RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18")
    parser.add_argument("--node", help="whose tokens are looked at")
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--bytes", type=int, default=4)
    parser.add_argument("--suffix", default="", help="behind the topic's key")
    parser.add_argument("--latched", type=int, default=0, help="depth of transient local")
    parser.add_argument("--attachment", default="new", choices=["new", "old", "none", "short"])
    parser.add_argument("--payload", default="", help="of a request, hexadecimal")
    parser.add_argument("--loss", type=float, default=0.0, help="percent")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.command == "router":
        return router(arguments)
    session = open_session([arguments.connect], mode=arguments.mode)
    commands[arguments.command](arguments, Node(session, arguments.domain))
    session.close()


main()
