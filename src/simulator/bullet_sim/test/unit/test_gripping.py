# SPDX-License-Identifier: BSD-3-Clause
"""The physics of a gripper: coupled joints, contact forces, firm friction, rays that return the hit link."""

import numpy as np
import pytest

from bullet_sim import Pose, World
from bullet_sim.quiet_pybullet import pybullet
from urdf_model import parse_urdf

FINGER = """<link name="%(n)s"><inertial><mass value="0.02"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5"/></inertial>
  <collision><origin xyz="0 %(y)g 0"/><geometry><box size="0.04 0.01 0.04"/></geometry></collision></link>
  <joint name="%(n)s" type="prismatic"><parent link="world"/><child link="%(n)s"/><axis xyz="0 1 0"/>
    <limit lower="%(lower)g" upper="%(upper)g" effort="20" velocity="1"/></joint>
  <gazebo reference="%(n)s"><kp>1e5</kp><kd>1</kd></gazebo>"""
VICE = "<robot name='vice'><link name='world'/>%s%s</robot>" % (
    FINGER % {"n": "l", "y": 0.02, "lower": 0.0, "upper": 0.05},
    FINGER % {"n": "r", "y": -0.02, "lower": -0.05, "upper": 0.0})
BOX = """<robot name="box"><link name="box"><inertial><mass value="0.2"/>
  <inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>
  <collision><geometry><box size="0.04 0.04 0.04"/></geometry></collision></link></robot>"""
OPEN = np.array([0.04, -0.04])


@pytest.fixture
def vice(world):
    vice = world.spawn(parse_urdf(VICE), "vice", Pose((0, 0, 1)))
    vice.set_joint_positions(np.arange(2), OPEN)
    vice.drive_position(np.arange(2), OPEN, np.full(2, 20.0))
    return vice


def squeeze(world, vice, effort, seconds=0.5):
    vice.drive_position(np.arange(2), np.zeros(2), np.full(2, effort))
    for _ in range(round(seconds / world.time_step_s)):
        world.step()


def test_coupled_joints_share_what_drives_one_of_them(world, vice):
    vice.couple(0, 1, -1.0)
    vice.release(np.array([1]))
    vice.drive_position(np.array([0]), np.array([0.01]), np.array([20.0]))
    for _ in range(250):
        world.step()
    np.testing.assert_allclose(vice.read_joints()[0], [0.01, -0.01], atol=1e-4)


def test_ratio_of_a_coupling(world, vice):
    vice.set_joint_positions(np.arange(2), np.array([0.02, -0.01]))
    vice.couple(0, 1, -0.5)
    vice.release(np.array([1]))
    vice.drive_position(np.array([0]), np.array([0.04]), np.array([20.0]))
    for _ in range(250):
        world.step()
    np.testing.assert_allclose(vice.read_joints()[0], [0.04, -0.02], atol=1e-4)


def test_a_coupled_model_can_be_deleted(world, vice):
    vice.couple(0, 1, -1.0)
    world.delete("vice")
    world.step()
    again = world.spawn(parse_urdf(VICE), "vice", Pose((0, 0, 1)))
    again.couple(0, 1, -1.0)
    world.step()


def test_what_is_held_presses_back_and_does_not_creep(world, vice):
    box = world.spawn(parse_urdf(BOX), "box", Pose((0, 0, 1)))
    vice.couple(0, 1, -1.0)
    for link in ("l", "r"):
        vice.grip_firmly(link)
    squeeze(world, vice, 6.0)
    np.testing.assert_allclose(vice.contact_force("l"), [0, 6, 0], atol=0.3)
    np.testing.assert_allclose(vice.contact_force("r"), [0, -6, 0], atol=0.3)
    before = box.base_pose().position[2]
    squeeze(world, vice, 6.0, seconds=5.0)
    assert box.base_pose().position[2] == pytest.approx(before, abs=2e-5)


def test_too_weak_a_grip_lets_go(world, vice):
    box = world.spawn(parse_urdf(BOX), "box", Pose((0, 0, 1)))
    vice.couple(0, 1, -1.0)
    for link in ("l", "r"):
        vice.grip_firmly(link)
    squeeze(world, vice, 0.5)  # 2 x 0.5 N of friction for a weight of 2 N
    assert box.base_pose().position[2] < 0.9


def test_renewed_contacts_are_found_again_and_hold_as_before(world, vice):
    box = world.spawn(parse_urdf(BOX), "box", Pose((0, 0, 1)))
    vice.couple(0, 1, -1.0)
    squeeze(world, vice, 6.0)
    assert world.contacts(vice, box)
    for link in ("l", "r"):
        vice.renew_contacts(link)
    assert not world.contacts(vice, box)
    squeeze(world, vice, 6.0)
    np.testing.assert_allclose(vice.contact_force("l"), [0, 6, 0], atol=0.3)
    assert box.base_pose().position[2] == pytest.approx(1.0, abs=5e-3)


def test_renewed_contacts_leave_self_collision_as_it_was(world):
    """Of two fingers that were driven into each other."""
    for pairs in ((), (("l", "r"),)):
        vice = world.spawn(parse_urdf(VICE), "vice%d" % len(pairs), Pose((3.0 * len(pairs), 0, 1)), static=True,
                           self_collision_pairs=pairs)
        for link in ("l", "r"):
            vice.renew_contacts(link)
        vice.set_joint_positions(np.arange(2), np.array([-0.018, 0.018]))
        world.step()
        assert bool(world.contacts(vice, vice)) == bool(pairs)


def test_rays_say_whom_they_meet(world):
    world.spawn(parse_urdf(BOX), "box", Pose((0, 0, 1)), static=True)
    hits = world.first_hits([(0, 0, 2), (1, 0, 2), (0, 0, 1.0)], [(0, 0, 1), (1, 0, 1), (0, 0, 2)])
    assert hits == [("box", "box"), None, None]


PRESS = """<robot name="press"><link name="world"/><link name="slide"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
  <link name="finger"><inertial><mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial>
  <collision><geometry><box size="0.01 0.02 0.06"/></geometry></collision></link>
  <joint name="along" type="prismatic"><parent link="world"/><child link="slide"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="500" velocity="1"/></joint>
  <joint name="down" type="prismatic"><parent link="slide"/><child link="finger"/><axis xyz="0 0 -1"/>
    <limit lower="-1" upper="1" effort="500" velocity="1"/></joint></robot>"""
FLOOR = """<robot name="floor"><link name="world"><collision><origin xyz="0 0 -0.05"/>
  <geometry><box size="1 1 0.1"/></geometry></collision></link></robot>"""


def pressed(order, change=lambda world, press: None):
    """The place of a box after a finger has pressed on its edge and gone on, and the pairs that touch, in the order in
    which Bullet has them; with what was spawned in that order, and changed before."""
    world = World()
    try:
        texts = {"floor": (FLOOR, 0.0), "press": (PRESS, 0.1), "box": (BOX, 0.02)}
        models = {name: world.spawn(parse_urdf(texts[name][0]), name, Pose((0, 0, texts[name][1]))) for name in order}
        press = models["press"]
        press.grip_firmly("finger")
        press.set_joint_positions(np.arange(2), np.array([0.015, 0.02]))
        press.drive_position(np.arange(2), np.array([0.015, 0.02]), np.full(2, 60.0))
        world.step()
        change(world, press)
        for step in range(300):
            goal = np.array([0.015 - 0.0001 * step, 0.02 + 0.0002 * step])
            press.drive_position(np.arange(2), goal, np.full(2, 60.0))
            world.step()
        names = {body: name for name, model in models.items() for body in model.parts.bodies}
        points = pybullet.getContactPoints(physicsClientId=world._client)
        return models["box"].base_pose().matrix(), {(names[point[1]], names[point[2]]) for point in points}
    finally:
        world.close()


def test_forces_do_not_depend_on_what_was_spawned_or_renewed_first():
    """Bullet's do: a finger on the edge of a box that was there before pushed it another way."""
    usual, pairs = pressed(("floor", "press", "box"))
    assert np.abs(usual[:3, 3] - (0, 0, 0.02)).max() > 0.005  # it was moved
    assert pairs == {("floor", "box"), ("press", "box")}
    changes = (lambda world, press: world.renew_contacts(press, ["finger"]),
               lambda world, press: world.renew_contacts(), lambda world, press: world.rebuild([press]))
    for found, same in (*(pressed(order) for order in (("floor", "box", "press"), ("box", "floor", "press"))),
                        *(pressed(("floor", "press", "box"), change) for change in changes)):
        np.testing.assert_allclose(found, usual, atol=1e-9)
        assert same == pairs
