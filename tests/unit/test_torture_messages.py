# SPDX-License-Identifier: BSD-3-Clause
"""Torture's messages: genpy reads their bytes, the same seed gives the same messages, and all boundary values occur."""
import collections
import io
import json
import math
import random
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import roslib.message
from baxter_core_msgs.msg import EndEffectorCommand, JointCommand
from trajectory_msgs.msg import JointTrajectory

TORTURE = Path(__file__).resolve().parents[1] / "torture"


@pytest.fixture(scope="module", autouse=True)
def modules():
    sys.path.insert(0, str(TORTURE))
    import commands
    import hostile
    import message_spec
    import tcpros

    yield SimpleNamespace(commands=commands, hostile=hostile, spec=message_spec, tcpros=tcpros)
    sys.path.remove(str(TORTURE))


def spec_of(modules, message_class):
    return modules.spec.spec_of(message_class, roslib.message.get_message_class)


def draws(modules, message_class, count, seed="s"):
    generator, spec = modules.hostile.Generator(modules.commands.WORDS), spec_of(modules, message_class)
    return [generator.draw(spec, "%s/%d" % (seed, k)) for k in range(count)]


@pytest.mark.parametrize("message_class", [JointCommand, EndEffectorCommand, JointTrajectory])
def test_undamaged_bytes_are_what_genpy_reads_and_writes(modules, message_class):
    spec, read = spec_of(modules, message_class), 0
    for style, value, data in draws(modules, message_class, 200):
        if style == "damaged" or not all(map(is_clean, modules.spec.leaves(spec, value))):
            continue  # genpy replaces what is not UTF-8
        message, buffer = message_class(), io.BytesIO()
        message.deserialize(data)
        message.serialize(buffer)
        assert buffer.getvalue() == data
        read += 1
    assert read > 50


def is_clean(leaf):
    _, kind, value = leaf
    return kind != "string" or (isinstance(value, str) and not any("\ud800" <= letter <= "\udfff" for letter in value))


def test_values_arrive_in_their_fields(modules):
    value = {"mode": 4, "command": [0.5, -1.5], "names": ["left_s0", b"left_s1"]}
    message = JointCommand()
    message.deserialize(modules.spec.encode(spec_of(modules, JointCommand), value))
    assert (message.mode, list(message.command), message.names) == (4, [0.5, -1.5], ["left_s0", "left_s1"])


def test_the_same_seed_gives_the_same_messages(modules):
    first, again = (draws(modules, JointCommand, 50) for _ in range(2))
    assert [data for _, _, data in first] == [data for _, _, data in again]
    assert [data for _, _, data in first] != [data for _, _, data in draws(modules, JointCommand, 50, "t")]


def test_every_style_and_boundary_turns_up(modules):
    drawn = draws(modules, JointCommand, 3000)
    styles = collections.Counter(style for style, _, _ in drawn)
    assert set(styles) == set(modules.hostile.STYLES)
    numbers = [number for _, value, _ in drawn for number in value["command"]]
    assert any(map(math.isnan, numbers)) and math.inf in numbers and 1e308 in numbers
    lengths = {(len(value["command"]), len(value["names"])) for _, value, _ in drawn}
    assert (0, 0) in lengths and (7, 7) in lengths and any(a != b for a, b in lengths)
    names = [name for _, value, _ in drawn for name in value["names"]]
    assert "a\0b" in names and b"\xff\xfe\x80" in names
    assert any(len(name) >= modules.hostile.LONG_TEXT for name in names)


def test_json_arguments_are_deep_and_huge(modules):
    texts = [value["args"] for _, value, _ in draws(modules, EndEffectorCommand, 3000)]
    assert any(text.count(b"{" if isinstance(text, bytes) else "{") >= modules.hostile.DEEP for text in texts)
    assert any("1" * modules.hostile.DIGITS in text for text in texts if isinstance(text, str))


def test_plausible_commands_pass_for_valid_ones(modules):
    """Messages that always fail a handler's first check would test only that check."""
    valid = [value for style, value, _ in draws(modules, JointCommand, 500)
             if style == "plausible" and not modules.commands.is_refused("left", value)]
    assert len(valid) > 20


def test_damage_is_damage(modules):
    data = bytes(range(40))
    assert sum(modules.hostile.damaged(data, random.Random(k)) != data for k in range(100)) > 90


@pytest.mark.parametrize("spoil", [
    {"mode": 5}, {"mode": 0}, {"command": [math.nan, 0.0]}, {"command": [math.inf, 0.0]}, {"command": [0.0]},
    {"names": ["left_s0", "left_s0"]}, {"names": ["left_s0", "right_s1"]}, {"names": ["left_s0", "left_s9"]},
    {"names": [], "command": []},
])
def test_what_must_be_refused(modules, spoil):
    fine = {"mode": 1, "command": [0.0, 0.1], "names": ["left_s0", "left_s1"]}
    topic = "/robot/limb/left/joint_command"
    assert modules.commands.may_move(topic, fine, "plausible")
    assert not modules.commands.may_move(topic, {**fine, **spoil}, "one bad")
    assert modules.commands.may_move(topic, {**fine, **spoil}, "damaged")


@pytest.mark.parametrize(("name", "moves"), [
    ("/gazebo/reset_world", True), ("/robot/set_super_stop", True), ("/robot/sim/press", True),
    ("/robot/limb/left/set_speed_ratio", False), ("/cameras/open", False),
    ("/robot/end_effector/left_gripper/command", False),
    ("/robot/limb/left/follow_joint_trajectory/goal", True), ("/trajActionServer/goal", True),
])
def test_what_else_may_move_an_arm(modules, name, moves):
    assert modules.commands.may_move(name, {}, "plausible") is moves


@pytest.mark.parametrize(("name", "value", "moves"), [
    ("/robot/left_joint_position_controller/joints/left_s0_controller/command", {"data": 0.1}, True),
    ("/robot/right_joint_effort_controller/joints/right_w2_controller/command", {"data": math.nan}, False),
    ("/robot/head_position_controller/joints/head_controller/command", {"data": 0.1}, False),
    ("/robustcontroller/left/Tare/enable", {"isEnabled": True}, True),
    ("/robustcontroller/left/CalibrateArm/enable", {"isEnabled": False}, False),
])
def test_single_joints_and_procedures_may_move_an_arm(modules, name, value, moves):
    assert modules.commands.may_move(name, value, "plausible") is moves
    assert modules.commands.may_move(name, value, "damaged") is (moves or "head" not in name)


def test_headers_are_read_as_written(modules):
    fields = {"callerid": "/a", "md5sum": "*"}
    assert modules.tcpros.parsed(modules.tcpros.header(fields)[4:]) == fields
    with pytest.raises(modules.tcpros.ConnectionLost):
        modules.tcpros.parsed(b"\x08\0\0\0abc")


@pytest.mark.parametrize("is_xmlrpc", [False, True])
def test_garbage_is_bytes_of_many_kinds(modules, is_xmlrpc):
    kinds = {modules.tcpros.garbage(random.Random(k), is_xmlrpc) for k in range(200)}
    assert len(kinds) > 50 and all(isinstance(one, bytes) for one in kinds)


def test_deep_json_is_too_deep_for_pythons_own_reader(modules):
    """The generator's depth is large enough to break careless code."""
    with pytest.raises(RecursionError):
        json.loads('{"a":' * modules.hostile.DEEP + "1" + "}" * modules.hostile.DEEP)
