#!/usr/bin/env python3
"""Holds the types in bags to rosbags: the hash on every channel must be that of the schema beside it, as rosbags
computes it (REP-2016), and every standard type in a schema must be the one of the ROS 2 distribution.

usage: check_types.py BAG...
exit : 0 all types are right, 1 otherwise
needs: pip install -r requirements.txt
"""

import sys
from pathlib import Path

from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STANDARD = get_typestore(Stores.ROS2_JAZZY)


def check(channel, schema):
    """Complaints about one channel, and the names of the standard types that were compared."""
    types = get_types_from_msg(schema.data.decode(), schema.name)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    stated, computed = channel.metadata.get("topic_type_hash"), store.hash_rihs01(schema.name)
    complaints = [] if stated == computed else [f"{channel.topic}: {stated}, rosbags computes {computed}"]
    standard = [name for name in types if name in STANDARD.types]
    for name in standard:
        if store.hash_rihs01(name) != STANDARD.hash_rihs01(name):
            complaints.append(f"{channel.topic}: {name} is not that of ROS 2 Jazzy")
        # Constants are no part of the hash.
        if sorted(types[name][0]) != sorted(STANDARD.fielddefs[name][0]):
            complaints.append(f"{channel.topic}: constants of {name} are not those of ROS 2 Jazzy")
    return complaints, set(standard)


def main():
    complaints, types, standard = [], set(), set()
    for bag in map(Path, sys.argv[1:]):
        for path in sorted(bag.glob("*.mcap")):
            with path.open("rb") as stream:
                summary = make_reader(stream).get_summary()
            for channel in summary.channels.values():
                schema = summary.schemas[channel.schema_id]
                wrong, found = check(channel, schema)
                complaints += wrong
                types.add(schema.name)
                standard |= found
    print("\n".join(complaints) or f"{len(types)} types hash as rosbags says; {len(standard)} standard ones are ROS 2's")
    return 1 if complaints or not types else 0


if __name__ == "__main__":
    sys.exit(main())
