# SPDX-License-Identifier: BSD-3-Clause
"""Messages of any content on all topics that the robot subscribes to: none stops it, and it accepts commands
afterwards."""
import io
import random

import genmsg.msgs
import genpy
import numpy as np
import pytest
import roslib.message
from std_msgs.msg import Bool, Empty, Float64

from baxter_sim_hardware.topics import interface

SIDES = ("left", "right")
INPUTS = [(name, roslib.message.get_message_class(row.type))
          for row in interface.TOPICS if not row.is_published for _, name in row.names()]
BATCHES, BATCH = 150, 20  # of messages between two ticks
WORDS = ("", " ", "\0", "\0" * 50, "x" * 100000, "é", "%s%d%n", "left", "left_s0", "right_w2", "head_pan", "base",
         "left_gripper", "left_hand", "estop", "torso_fan", "left_suck", "left_itb_light_inner", "rgb8", "8UC3",
         "configure", "set", "go", "grip", "calibrate", "reboot", "release", "no_op",
         '{"position": 50}', '{"velocity": 1e999}', '{"velocity": %s}' % ("9" * 400), '{"dead_zone": NaN}',
         '{"grip_attempt_seconds": Infinity}', '{"a":' * 1000, "[" * 9000, '{"\\ud800": 1}', "[]", "5", '"',
         "<robot><link name='x'/></robot>", "<robot>", "<" * 5000,
         "<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;'>]><robot><link name='&b;'/></robot>")
NUMBERS = (0.0, -0.0, 0.5, 1.0, -1.0, 3.0, 1e3, 5e-324, 1e308, -1e308, float("nan"), float("inf"), -float("inf"))
BITS = {"byte": 8, "char": 8, "int8": 8, "uint8": 8, "int16": 16, "uint16": 16, "int32": 32, "uint32": 32, "int64": 64,
        "uint64": 64}


def any_value(rng, kind):
    """A value of a field's type: valid, at a bound, or invalid."""
    base, is_array, length = genmsg.msgs.parse_type(kind)
    if is_array:
        count = rng.choice((0, 1, 2, 7, 7, 8, 100)) if length is None else length
        values = [any_value(rng, base) for _ in range(count)]
        return bytes(value % 256 for value in values) if BITS.get(base) == 8 else values
    if base in ("float32", "float64"):
        number = rng.choice(NUMBERS)
        return number if base == "float64" or not 3e38 < abs(number) < np.inf else 3e38
    if base in BITS:
        signed = base.startswith("int") or base == "byte"
        top = 2 ** (BITS[base] - signed)
        return rng.choice((0, 1, 2, 3, 4, 99 % top, top - 1, -top if signed else top // 2))
    if base == "string":
        return rng.choice(WORDS)
    if base == "bool":
        return rng.random() < 0.5
    if base in ("time", "duration"):
        return {"time": genpy.Time, "duration": genpy.Duration}[base](rng.choice((0, 1, 2**31 - 1)), 999999999)
    return any_message(rng, roslib.message.get_message_class("std_msgs/Header" if base == "Header" else base))


def any_message(rng, message_class):
    message = message_class()
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        setattr(message, name, any_value(rng, kind))
    return message


def received(message):
    """A message after serialization and back."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


@pytest.mark.parametrize("seed", [1, 2])
def test_any_message_is_taken_or_refused_and_the_robot_obeys_after(lab, seed):
    rng = random.Random(seed)
    largest = lab.model.max_velocity[lab.arm] * 0.002 * 1.5
    for _ in range(BATCHES):
        for _ in range(BATCH):
            topic, message_class = rng.choice(INPUTS)
            lab.send(topic, received(any_message(rng, message_class)))
        before = lab.position
        lab.run(0.002)
        assert lab.faults == [], "seed %d" % seed
        assert (np.abs(lab.position - before) <= largest).all(), "a jump, seed %d" % seed
        assert np.isfinite(lab.model.read_joints()).all()
        if rng.random() < 0.1:
            lab.send("set_super_reset", Empty())
            lab.send("set_super_enable", Bool(True))
    for _, publisher in lab.publishers.items():
        for message in publisher.messages[-1:]:
            buffer = io.BytesIO()
            message.serialize(buffer)
            assert len(buffer.getvalue()) < 2 * 10**6
    lab.send("set_super_reset", Empty())
    lab.run(0.01)
    for side in SIDES:
        lab.send("limb/%s/set_speed_ratio" % side, Float64(1.0))
        lab.send("limb/%s/command_velocity_tozero" % side, Bool(True))
    lab.enable()
    lab.run(2.5)  # suppressions of collision avoidance and the like are over
    middle = (lab.model.lower + lab.model.upper)[lab.arm] / 2.0
    target = lab.position + np.where(lab.position < middle, 0.05, -0.05)
    lab.command(1, target)
    lab.run(1.0)
    assert np.abs(lab.position - target).max() < 3e-3, "seed %d" % seed
