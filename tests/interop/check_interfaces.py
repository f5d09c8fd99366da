#!/usr/bin/env python3
"""Holds the types that a live node speaks to rosbags: each hash must be that of the text beside it, as rosbags computes
it (REP-2016), and every standard message must be the one of the ROS 2 distribution.

usage: check_interfaces.py INTERFACES.json
exit : 0 all types are right, 1 otherwise
needs: pip install -r requirements.txt
"""

import json
import sys
from pathlib import Path

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STANDARD = get_typestore(Stores.ROS2_JAZZY)
EVENT_INFO = "service_msgs/msg/ServiceEventInfo"


def check_message(message):
    """Complaints about one message."""
    name = message["name"]
    types = get_types_from_msg(message["text"], name)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    computed = store.hash_rihs01(name)
    complaints = [] if message["hash"] == computed else [f"{name}: {message['hash']}, rosbags computes {computed}"]
    for part in (part for part in types if part in STANDARD.types):
        # Constants are no part of the hash.
        if sorted(types[part][0]) != sorted(STANDARD.fielddefs[part][0]) or types[part][1] != STANDARD.fielddefs[part][1]:
            complaints.append(f"{name}: {part} is not that of ROS 2 Jazzy")
    return complaints


def renamed(part, names):
    """A field's type with other names in it."""
    if isinstance(part, (tuple, list)):
        return type(part)(renamed(element, names) for element in part)
    return names.get(part, part)


def register_part(store, name, text, action=None):
    """Adds a part of a service or an action. rosbags knows neither: the part is read as a message, and the parts of an
    action that it contains are named as such afterwards."""
    message = name.replace("/srv/", "/msg/").replace("/action/", "/msg/")
    constants, fields = get_types_from_msg(text, message)[message] if text else ([], [])
    names = {}
    if action:
        parts = (f"{action}_{part}" for part in ("Goal", "Result", "Feedback"))
        names = {part.replace("/action/", "/msg/"): part for part in parts}
    store.fielddefs[name] = (constants, renamed(fields, names))


def register_action(store, action):
    for part, text in zip(("Goal", "Result", "Feedback"), action["text"].split("---\n"), strict=True):
        register_part(store, f"{action['name']}_{part}", text)


def check_action(action):
    """Complaints about the parts of an action that are messages."""
    store = get_typestore(Stores.ROS2_JAZZY)
    register_action(store, action)
    for part in action["messages"]:
        if part["name"].endswith("_FeedbackMessage"):
            register_part(store, part["name"], part["text"].split("=" * 80)[0], action["name"])
    return [
        f"{part['name']}: {part['hash']}, rosbags computes {computed}"
        for part in action["messages"]
        if (computed := store.hash_rihs01(part["name"])) != part["hash"]
    ]


def check_service(service, actions):
    """Complaints about one service: rosidl makes a message of request, response and event of it."""
    name, store = service["name"], get_typestore(Stores.ROS2_JAZZY)
    action = next((action for action in actions if name.startswith(f"{action['name']}_")), None)
    if action:
        register_action(store, action)
    constants, fields = store.fielddefs[EVENT_INFO]
    # In IDL, which is what is hashed, `char` is `uint8`.
    gid = ("client_gid", (Nodetype.ARRAY, ((Nodetype.BASE, ("uint8", 0)), 16)))
    store.fielddefs[EVENT_INFO] = (constants, [gid if field[0] == gid[0] else field for field in fields])
    for part, text in zip(("Request", "Response"), service["text"].split("---\n"), strict=True):
        register_part(store, f"{name}_{part}", text, action and action["name"])
    nested = [(Nodetype.NAME, f"{name}_{part}") for part in ("Request", "Response", "Event")]
    event = [("info", (Nodetype.NAME, EVENT_INFO))]
    event += [(part, (Nodetype.SEQUENCE, (kind, 1))) for part, kind in zip(("request", "response"), nested)]
    parts = ("request_message", "response_message", "event_message")
    store.fielddefs[f"{name}_Event"] = ([], event)
    store.fielddefs[name] = ([], list(zip(parts, nested)))
    computed = store.hash_rihs01(name)
    return [] if service["hash"] == computed else [f"{name}: {service['hash']}, rosbags computes {computed}"]


def main():
    interfaces = json.loads(Path(sys.argv[1]).read_text())
    messages, services, actions = interfaces["messages"], interfaces["services"], interfaces["actions"]
    complaints = [line for message in messages for line in check_message(message)]
    complaints += [line for service in services for line in check_service(service, actions)]
    complaints += [line for action in actions for line in check_action(action)]
    print("\n".join(complaints) or f"{len(messages)} messages and {len(services)} services hash as rosbags says")
    return 1 if complaints or not messages or not services or not actions else 0


if __name__ == "__main__":
    sys.exit(main())
