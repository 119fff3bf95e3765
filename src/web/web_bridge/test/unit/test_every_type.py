# SPDX-License-Identifier: BSD-3-Clause
"""Every message and service type of the installed packages, filled at random, through JSON and CBOR and back."""
import json
import random
import string

import cbor2
import genpy
import roslib.message
import rosmsg
import rospkg
from fake_graph import now

from web_bridge.codec import deserialized, serialized
from web_bridge.values import RANGES, CborForm, JsonForm, Reader, Writer, from_tag, parts_of

_ROUNDS, _LONGEST = 3, 3


def classes():
    """Classes of all messages, requests and responses that Python has here; Debian has some packages for C++ alone."""
    found, packs = set(), rospkg.RosPack()
    for mode, class_of in ((rosmsg.MODE_MSG, message_class), (rosmsg.MODE_SRV, roslib.message.get_service_class)):
        for package, _ in rosmsg.iterate_packages(packs, mode):
            found |= {class_of(name) for name in rosmsg.list_types(package, mode, packs)} - {None}
    services = {cls for cls in found if hasattr(cls, "_request_class")}
    halves = {half for cls in services for half in (cls._request_class, cls._response_class)}
    return sorted(found - services | halves, key=lambda cls: cls._type)


def message_class(name):
    return roslib.message.get_message_class(name)


def filled(cls, draw):
    message = cls()
    for name, slot_type in zip(cls.__slots__, cls._slot_types, strict=True):
        base, length = parts_of(slot_type)
        if length is None:
            value = one(base, draw)
        else:
            value = [one(base, draw) for _ in range(length or draw.randrange(_LONGEST + 1))]
            if base in ("uint8", "char"):
                value = bytes(value)
        setattr(message, name, value)
    return message


def one(base, draw):
    if base in RANGES:
        return draw.choice([*RANGES[base], draw.randint(*RANGES[base])])
    if base == "bool":
        return draw.choice([False, True])
    if base == "float32":
        return draw.choice([0.0, -1.5, draw.randrange(-4096, 4096) / 64.0, 2.0 ** 100])
    if base == "float64":
        return draw.choice([0.0, draw.uniform(-10.0, 10.0), 1e300])
    if base == "string":
        return "".join(draw.choices(string.printable + "é你\N{ROBOT FACE}", k=draw.randrange(8)))
    if base == "time":
        return genpy.Time(draw.randrange(1 << 32), draw.randrange(10 ** 9))
    if base == "duration":
        return genpy.Duration(draw.randrange(-(1 << 31), 1 << 31), draw.randrange(10 ** 9))
    return filled(message_class(base), draw)


def test_every_type_survives_both_ways():
    draw, reader = random.Random(1), Reader(message_class, now)
    to_json, to_cbor = Writer(message_class, JsonForm()), Writer(message_class, CborForm())
    found = classes()
    for cls in found:
        for _ in range(_ROUNDS):
            data = serialized(filled(cls, draw))
            message = deserialized(cls(), data)
            text = json.dumps(to_json.values(message), allow_nan=False)
            assert serialized(reader.fill(cls(), json.loads(text))) == data, "%s through JSON" % cls._type
            packed = cbor2.dumps(to_cbor.values(message))
            values = cbor2.loads(packed, tag_hook=lambda tag, _immutable: from_tag(tag))
            assert serialized(reader.fill(cls(), values)) == data, "%s through CBOR" % cls._type
    assert len(found) > 500 and {"baxter_core_msgs/JointCommand", "moveit_msgs/PlanningScene"} <= {
        cls._type for cls in found}, "%d types" % len(found)
