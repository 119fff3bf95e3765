# SPDX-License-Identifier: BSD-3-Clause
"""Messages that no correct program sends, and some that one could. No ROS needed; the same seed gives the same
messages.

A message is one of: plausible, plausible except for one field, made of boundary values only, or damaged on the wire.
"""
import json
import math
import random
import struct

from message_spec import FLOATS, FORMATS, TIMES, VARIABLE, MessageSpec, encode, leaves, replaced

FLOAT64 = (0.0, -0.0, 1.0, -1.0, 1e-320, 1e9, -1e9, 1e12, 1e30, 1e308, -1e308, math.nan, math.inf, -math.inf)
FLOAT32 = (0.0, -0.0, 1.0, -1.0, 1e-44, 1e9, 3.4e38, -3.4e38, math.nan, math.inf, -math.inf)
LONG_TEXT = 100_000
# Lengths of arrays without a fixed length; the longest is rare.
LENGTHS = (0, 1, 1, 2, 7, 7, 8, 100)
# Python 3.13 reads JSON of 8,000 levels.
DEEP = 20_000
DIGITS = 400
STYLES = ("plausible", "one bad", "one bad", "boundary", "damaged")
XML = (
    "<robot name='a'/>", "<robot", "\0", "<sdf version='1.6'><model name='m'/></sdf>", "<robot>" * 200,
    "<robot name='n'><link name='l'><inertial><mass value='nan'/></inertial></link></robot>",
    "<robot name='n'><link name='l'><inertial><mass value='1e308'/><inertia ixx='1e308' ixy='0' ixz='0' iyy='1e308'"
    " iyz='0' izz='1e308'/></inertial><collision><geometry><box size='1e30 1 1'/></geometry></collision></link>"
    "</robot>",
    "<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;'><!ENTITY c '&b;&b;&b;&b;&b;&b;'>"
    "<!ENTITY d '&c;&c;&c;&c;&c;&c;&c;&c;'>]><robot name='&d;'><link name='l'/></robot>",
    "<robot name='n'><link name='l'><visual><geometry><mesh filename='file:///dev/zero'/></geometry></visual></link>"
    "</robot>",
    "<robot name='n'><link name='l'/><link name='m'/><joint name='j' type='fixed'><parent link='l'/><child link='l'/>"
    "</joint></robot>",
)
PLAIN_JSON = ("{}", '{"position": 50.0}', '{"velocity": 50.0, "moving_force": 40}', '{"grip_attempt_seconds": 1}')


def hostile_json(choose):
    """A text for fields that are read as JSON. choose: a random.Random."""
    number = choose.choice(("1" * DIGITS, "-" + "9" * DIGITS, "1e400", "NaN", "-Infinity", "1e308", '"50"', "null",
                            "[]"))
    key = choose.choice(("position", "velocity", "moving_force", "holding_force", "dead_zone", "grip_attempt_seconds",
                         "blow_off_seconds", "vacuum_sensor_threshold", "", "\0", "a"))
    return choose.choice((
        '{"a":' * DEEP + "1" + "}" * DEEP, '{"%s":' % key * DEEP, "[" * DEEP + "]" * DEEP, "[" * DEEP,
        '{%s: %s}' % (json.dumps(key), number), '{%s: %s}' % (json.dumps(key), number),
        '{"position": 1, "position": %s}' % number, "{", "[1]", "null", "NaN", number, '"\\ud800"', "{\"a\": 1}" * 1000,
        '{"position": {"position": {}}}', "\ufeff{}", "{}\0",
    ))


def hostile_text(choose):
    """A string, or bytes that are not UTF-8."""
    return choose.choice((
        "", "\0", "a\0b", "\n", " ", "../../../../etc/passwd", "/", "~", "%s%n%d{}{0}", "nan", "-1", "\ud800",
        "ß" * 50, "𝕬\u202e\u0301", b"\xff\xfe\x80", b"\xc0\x80", "a" * choose.choice((256, 4096, LONG_TEXT)),
        "right_s0 ", "world", "<a/>", hostile_json(choose),
    ))


def boundary(kind, choose):
    """A value of a primitive that programs often handle wrongly."""
    if kind == "string":
        return hostile_text(choose)
    if kind in FLOATS:
        return choose.choice(FLOAT64 if kind == "float64" else FLOAT32)
    if kind == "time":
        return choose.choice(((0, 0), (2**32 - 1, 2**32 - 1), (2**31, 10**9), (1, 2**31)))
    if kind == "duration":
        return choose.choice(((0, 0), (2**31 - 1, 2**31 - 1), (-(2**31), -(2**31)), (-1, 10**9)))
    if kind == "bool":
        return choose.choice((0, 1, 2, 255))
    bits = 8 * struct.calcsize("<" + FORMATS[kind])
    if FORMATS[kind].isupper():
        return choose.choice((0, 1, 2**bits - 1, 2 ** (bits - 1)))
    return choose.choice((0, 1, -1, 2 ** (bits - 1) - 1, -(2 ** (bits - 1))))


class Generator:
    """Messages of any type.

    words: {field name: plausible values} ("*" for all other strings); for an array field the name may be the plural.
    """

    def __init__(self, words):
        self._words = words

    def draw(self, spec, seed):
        """Return (style, value, bytes) of one message; style is one of STYLES. The same spec and seed give the same
        message."""
        choose = random.Random(seed)
        style = choose.choice(STYLES)
        value = self.value(spec, choose, style == "boundary")
        if style == "one bad":
            value = self._spoiled(spec, value, choose)
        data = encode(spec, value)
        if style == "damaged":
            data = damaged(data, choose)
        return style, value, data

    def value(self, spec, choose, extreme=False):
        """A message's value, of boundary values only if ``extreme``. Usually all its arrays have the same length."""
        length = choose.choice(LENGTHS)
        return {field.name: self._field(field, choose, extreme, length) for field in spec.fields}

    def _field(self, field, choose, extreme, length):
        if field.length is None:
            return self._one(field, choose, extreme)
        count = field.length if field.length != VARIABLE else choose.choice(LENGTHS) if extreme else length
        words = () if extreme else self._fitting(field)
        if words and count:
            start = choose.randrange(0, len(words), 7)
            return [words[(start + k) % len(words)] for k in range(count)]
        return [self._one(field, choose, extreme) for _ in range(count)]

    def _one(self, field, choose, extreme):
        if isinstance(field.kind, MessageSpec):
            return self.value(field.kind, choose, extreme)
        if extreme:
            return boundary(field.kind, choose)
        if words := self._fitting(field):
            return choose.choice(words)
        if field.kind == "string":
            return choose.choice(self._words.get("*", ("",)))
        if field.kind in FLOATS:
            return round(choose.uniform(-1.0, 1.0), 3)
        if field.kind in TIMES:
            return choose.choice(((0, 0), (1, 0)))
        return choose.choice((0, 1, 1, 2, 3, 4)) if field.kind != "bool" else choose.choice((0, 1))

    def _fitting(self, field):
        """The words for a field, if they have its type: a `command` is an array of numbers in one message and a text in
        another."""
        words = self._words.get(field.name, ())
        return words if words and isinstance(words[0], str) == (field.kind == "string") else ()

    def _spoiled(self, spec, value, choose):
        found = list(leaves(spec, value))
        if not found:
            return value
        path, kind, _ = choose.choice(found)
        wrong = boundary(kind, choose)
        if path[-1] == "args":
            wrong = hostile_json(choose)
        elif isinstance(path[-1], str) and path[-1].endswith("xml"):
            wrong = choose.choice(XML)
        return replaced(value, path, wrong)


def damaged(data, choose):
    """Bytes of a message: cut off, too long, with flipped bits, or with a false length of an array or string."""
    way = choose.randrange(4)
    if way == 0:
        return data[:choose.randrange(len(data) + 1)]
    if way == 1:
        return data + bytes(choose.randrange(256) for _ in range(choose.choice((1, 4, 1000))))
    changed = bytearray(data or b"\0")
    if way == 2:
        for _ in range(choose.randrange(1, 9)):
            changed[choose.randrange(len(changed))] ^= 1 << choose.randrange(8)
    elif len(changed) >= 4:
        at = choose.randrange(len(changed) - 3)
        changed[at:at + 4] = struct.pack("<I", choose.choice((2**31 - 1, 2**32 - 1, 10**9, len(changed))))
    return bytes(changed)
