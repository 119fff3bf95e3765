# SPDX-License-Identifier: BSD-3-Clause
"""Joints through Bullet's C interface: the same bits as through PyBullet, and PyBullet where that is not to be had."""

import shutil
import struct
import subprocess
import sys

import numpy as np
import pybullet
import pytest

from bullet_sim import BulletSimError, World, direct
from urdf_model import parse_urdf

LINK = """<link name="%s"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
  <inertia ixx="0.01" iyy="0.05" izz="0.05"/></inertial></link>"""
JOINT = """<joint name="%s" type="revolute"><parent link="%s"/><child link="%s"/><origin xyz="0.4 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="60" velocity="3"/></joint>"""
NAMES = ("shoulder", "elbow", "wrist")
ARM = "<robot name='arm'>%s</robot>" % "".join(
    [LINK % name for name in "abcd"] + [JOINT % (name, *"ab bc cd".split()[i]) for i, name in enumerate(NAMES)]
)
STEPS = 300


@pytest.fixture
def worlds():
    worlds = World(), World()
    yield worlds
    for world in worlds:
        world.close()


def spawn(world):
    return world.spawn(parse_urdf(ARM), "arm", static=True)


def table_of(symbols, texts):
    """An ELF file of nothing but a table of (name, info, section) and its texts; the last symbol is at 0x1234."""
    entries = b"".join(
        struct.pack("<IBBHQQ", name, info, 0, section, 0x1234 * (number == len(symbols) - 1), 0)
        for number, (name, info, section) in enumerate(symbols)
    )
    head, size = 64, 64
    sections = [
        struct.pack("<IIQQQQIIQQ", 0, kind, 0, 0, begin, length, link, 0, 0, 0)
        for kind, begin, length, link in (
            (0, 0, 0, 0),
            (2, head + 3 * size, len(entries), 2),
            (3, head + 3 * size + len(entries), len(texts), 0),
        )
    ]
    header = b"\x7fELF\x02\x01".ljust(0x28, b"\0") + struct.pack("<Q", head)
    header = (header.ljust(0x3A, b"\0") + struct.pack("<HH", size, 3)).ljust(head, b"\0")
    return header + b"".join(sections) + entries + texts


def move(world, arm, number):
    """One tick of everything that drives a joint."""
    index = arm.index(NAMES)
    target = np.array([0.3, -0.5, 0.7]) * np.sin(0.02 * number)
    if number % 100 < 60:
        arm.drive_position(index, target, arm.max_effort, velocity=np.full(3, 0.1) if number % 2 else None)
    elif number % 100 < 80:
        arm.drive_position(index[1:], target[1:], arm.max_effort[1:])
        arm.drive_effort(index[:1], np.array([1.5]))
    else:
        arm.drive_velocity(index, target, arm.max_effort)
    world.step()


def test_the_same_bits_as_through_pybullet(worlds):
    plain, quick = map(spawn, worlds)
    assert quick.call_directly(), "this build of PyBullet cannot be called directly: labs will be slower"
    for number in range(STEPS):
        for world, arm in zip(worlds, (plain, quick), strict=True):
            move(world, arm, number)
        for ours, theirs in zip(quick.read_joints(), plain.read_joints(), strict=True):
            assert ours.tobytes() == theirs.tobytes()
    assert np.abs(plain.read_joints()[0]).max() > 0.01


def test_what_is_read_stays_as_it_was(worlds):
    arm = spawn(worlds[0])
    arm.call_directly()
    move(worlds[0], arm, 0)
    before = [values.copy() for values in arm.read_joints()]
    held = arm.read_joints()
    move(worlds[0], arm, 50)
    assert not np.array_equal(arm.read_joints()[0], before[0])
    assert all(np.array_equal(now, then) for now, then in zip(held, before, strict=True))
    with pytest.raises(ValueError, match="read-only"):
        held[0][0] = 1.0


def test_pybullet_does_it_where_its_client_cannot_be_found(worlds, monkeypatch):
    monkeypatch.setattr(direct, "_symbol_values", lambda path, names: None)
    arm = spawn(worlds[0])
    assert not arm.call_directly()
    arm.set_joint_positions(arm.index(["elbow"]), np.array([0.25]))
    assert arm.read_joints()[0].tolist() == [0.0, 0.25, 0.0]


def test_pybullet_does_it_where_the_reading_differs(worlds, monkeypatch):
    arm = spawn(worlds[0])
    monkeypatch.setattr(direct.DirectJoints, "read", lambda self: np.full((3, 3), 0.5))
    assert not arm.call_directly()


def test_there_is_nothing_to_call_for_what_has_no_joints(worlds):
    box = worlds[0].spawn(parse_urdf("<robot name='box'>%s</robot>" % (LINK % "a")), "box", static=True)
    assert not box.call_directly()
    assert [len(values) for values in box.read_joints()] == [0, 0, 0]


def test_a_body_that_is_gone_is_an_error_and_no_crash(worlds):
    world = worlds[0]
    arm, index = spawn(world), np.arange(3)
    arm.call_directly()
    kept = arm._direct
    neighbour = world.spawn(parse_urdf(ARM), "neighbour", static=True)
    world.delete("arm")
    with pytest.raises(pybullet.error):
        arm.drive_position(index, np.zeros(3), arm.max_effort)
    neighbour.read_joints()  # Bullet's answer lies where the one before lay
    with pytest.raises(BulletSimError, match="has it been removed"):
        kept.read()
    other = spawn(world)
    assert other.call_directly()
    world.close()
    with pytest.raises(pybullet.error):
        other.drive_position(index, np.zeros(3), other.max_effort)


@pytest.mark.parametrize(
    "index, counts",
    [([3], (1, 1, 1)), ([-1], (1, 1, 1)), ([10**10], (1, 1, 1)), ([0, 1, 2], (1, 3, 3)), ([0, 1, 2], (3, 3, 1)),
     ([0, 1, 2], (3, 2, 3)), ([0], (2, 2, 2))],
)
def test_what_fits_no_joint_is_an_error_and_moves_nothing(worlds, index, counts):
    world = worlds[0]
    arm = spawn(world)
    arm.call_directly()
    world.step()
    held = arm._direct
    arm.drive_position(np.arange(3), np.zeros(3), arm.max_effort)
    position, velocity, effort = (np.full(count, value) for count, value in zip(counts, (1.0, 3.0, 60.0), strict=True))
    with pytest.raises(BulletSimError, match="expected joints from 0 to 2"):
        held.drive_position(np.array(index), position, velocity, effort, 0.5)
    world.step()
    assert np.abs(arm.read_joints()[0]).max() < 0.01


def test_numbers_of_other_types_and_layouts_are_taken(worlds):
    plain, quick = map(spawn, worlds)
    quick.call_directly()
    for world, arm in zip(worlds, (plain, quick), strict=True):
        index = np.arange(6, dtype=np.int32)[::2] // 2
        arm.drive_position(index, np.float32([0.1, 0.2, 0.3]), np.repeat(arm.max_effort, 2)[::2])
        world.step()
    assert quick.read_joints()[0].tobytes() == plain.read_joints()[0].tobytes()


def test_without_numba_there_is_pybullet(worlds, monkeypatch):
    monkeypatch.setitem(sys.modules, "bullet_sim.direct", None)
    assert not spawn(worlds[0]).call_directly()


def test_files_that_do_not_say_where_their_functions_are(tmp_path):
    text = tmp_path / "text"
    text.write_text("no library")
    assert direct._symbol_values(text, ["main"]) is None
    assert direct._symbol_values(pybullet.__file__, ["getPhysicsClient", "there_is_no_such_function"]) is None
    cut = tmp_path / "cut"
    with open(pybullet.__file__, "rb") as library:
        cut.write_bytes(library.read(4096))
    assert direct._symbol_values(cut, ["getPhysicsClient"]) is None
    # A table of which only the entry without a name is left, as some linkers leave it.
    lone = tmp_path / "lone"
    lone.write_bytes(table_of([(0, 0, 0), (1, 2, 0)], b"\0printf\0"))
    assert direct._symbol_values(lone, ["getPhysicsClient"]) is None
    assert direct._symbol_values(lone, ["printf"]) is None  # used here, defined elsewhere
    lone.write_bytes(table_of([(0, 0, 0), (1, 2, 7)], b"\0printf\0"))
    assert direct._symbol_values(lone, ["printf"]) == [0x1234]
    if shutil.which("strip"):
        stripped = tmp_path / "stripped"
        subprocess.run(["strip", "-o", str(stripped), sys.executable], check=True)
        assert direct._symbol_values(stripped, ["Py_Main"]) is None
