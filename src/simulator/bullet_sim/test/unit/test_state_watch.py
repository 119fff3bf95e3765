# SPDX-License-Identifier: BSD-3-Clause
"""Numbers that Bullet cannot compute with are refused; an impossible state is restored before it is read."""

import math

import numpy as np
import pybullet
import pytest

from bullet_sim import BulletSimError, Pose, World
from urdf_model import Box, Inertial, Link, Robot, Shape, parse_urdf

BOX = """<robot name="box"><link name="box"><inertial><mass value="1"/>
  <inertia ixx="0.0017" iyy="0.0017" izz="0.0017"/></inertial>
  <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"""
ARM = """<robot name="arm">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="upper"><inertial><origin xyz="0 0 0.3"/><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.01"/>
    </inertial><collision><origin xyz="0 0 0.3"/><geometry><box size="0.05 0.05 0.5"/></geometry></collision></link>
  <link name="lower"><inertial><origin xyz="0 0 0.2"/><mass value="1"/><inertia ixx="0.05" iyy="0.05" izz="0.01"/>
    </inertial><collision><origin xyz="0 0 0.3"/><geometry><box size="0.05 0.05 0.56"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <dynamics damping="0.5"/><limit lower="-2" upper="2" effort="50" velocity="2"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.6"/>
    <axis xyz="0 1 0"/></joint></robot>"""
BOTH = np.array([0, 1])
STRONG = np.array([100.0, 100.0])


@pytest.fixture
def told():
    return []


@pytest.fixture
def world(told):
    world = World(error=told.append)
    world.add_ground_plane()
    yield world
    world.close()


@pytest.fixture
def boxes(world):
    """Two boxes, one upon the other, and a third beside."""
    found = [world.spawn(parse_urdf(BOX), name, Pose(position))
             for name, position in (("low", (0, 0, 0.05)), ("high", (0, 0, 0.15)), ("beside", (1, 0, 0.05)))]
    step(world, 50)
    return found


def step(world, ticks):
    for _ in range(ticks):
        world.step()


def height(model):
    return model.base_pose().position[2]


def break_world(model):
    """Bypass all checks: this push turns every touched body's state into NaN."""
    for force, place in (([1e308] * 3, [0, 0, 0]), ([-1e308] * 3, [0, 0, 1]), ([1e308] * 3, [0, 1, 0])):
        pybullet.applyExternalForce(model.body, -1, force, place, pybullet.WORLD_FRAME, physicsClientId=model._client)
    model.wake()


def test_pybullet_itself_breaks(world, boxes, monkeypatch):
    """Otherwise the tests below would test nothing."""
    monkeypatch.setattr(world._watch, "look", lambda: None)
    break_world(boxes[0])
    step(world, 2)
    assert math.isnan(pybullet.getBasePositionAndOrientation(boxes[0].body, physicsClientId=world._client)[0][0])


def test_a_state_that_cannot_be_is_put_back_before_it_is_published(world, boxes, told):
    before = [box.base_pose().position for box in boxes]
    break_world(boxes[0])
    for _ in range(5):
        world.step()
        for box, position in zip(boxes, before, strict=True):
            np.testing.assert_allclose(box.base_pose().position, position, atol=1e-3)
            assert np.isfinite(box.base_twist()).all()
    assert len(told) in (1, 2) and "model 'low': the position of link 'box' is (nan" in told[0], told
    assert "put back" in told[0]


def test_everything_still_collides_afterwards(world, boxes):
    break_world(boxes[0])
    step(world, 500)
    assert [round(height(box), 2) for box in boxes] == [0.05, 0.15, 0.05]
    new = world.spawn(parse_urdf(BOX), "new", Pose((2, 0, 0.3)))
    step(world, 500)
    assert height(new) == pytest.approx(0.05, abs=2e-3)


def test_an_arm_goes_on_from_where_it_was(world, told):
    arm = world.spawn(parse_urdf(ARM), "arm", Pose((0, 0, 0.3)), static=True)
    arm.set_limits(1, -1.0, 1.0)
    target = np.array([0.4, -0.3])
    for _ in range(500):
        arm.drive_position(BOTH, target, STRONG)
        world.step()
    pybullet.setJointMotorControlArray(arm.body, [0, 1], pybullet.TORQUE_CONTROL, forces=[1e308, -1e308],
                                       physicsClientId=world._client)
    world.step()
    position, velocity, effort = arm.read_joints()
    np.testing.assert_allclose(position, target, atol=1e-3)
    assert np.isfinite([velocity, effort]).all()
    assert len(told) == 1 and "of joint 'shoulder' is nan" in told[0]
    for _ in range(500):
        arm.drive_position(BOTH, np.array([-0.2, 0.5]), STRONG)
        world.step()
    np.testing.assert_allclose(arm.read_joints()[0], [-0.2, 0.5], atol=1e-3)
    for _ in range(500):
        arm.drive_position(BOTH, np.array([0.0, 2.0]), STRONG)
        world.step()
    assert arm.read_joints()[0][1] == pytest.approx(1.0, abs=0.1)  # the limit that was set before


def test_what_is_absurd_but_finite_is_put_back_too(world, boxes, told):
    pybullet.resetBasePositionAndOrientation(boxes[2].body, [0, 0, 1e9], [0, 0, 0, 1], physicsClientId=world._client)
    world.step()
    assert height(boxes[2]) == pytest.approx(0.05, abs=1e-3)
    assert "the position of link 'box' is (0, 0, 1e+09) m; expected -1e+07 to 1e+07 m" in told[0]


def test_of_one_body_one_line_is_enough(world, boxes, told):
    for _ in range(20):
        break_world(boxes[2])
        world.step()
    assert len([line for line in told if "'beside'" in line]) == 1


def test_links_that_collide_still_do_in_a_rebuilt_body(world):
    arm = world.spawn(parse_urdf(ARM), "arm", Pose((3, 0, 1)), static=True)
    arm.set_joint_positions(BOTH, np.array([0.0, math.pi]))
    world.step()
    assert world.contacts(arm) == []
    arm.set_self_collision_pairs([("base", "lower")])
    arm.set_joint_positions(BOTH, np.array([0.0, math.pi]))
    world.step()
    assert {frozenset((c.link_a, c.link_b)) for c in world.contacts(arm)} == {frozenset(("base", "lower"))}


@pytest.mark.parametrize("act, message", [
    (lambda world, box: box.apply_wrench("box", (0, 0, 1e308)), r"force on link 'low::box' .*-1e.07 to 1e.07 N"),
    (lambda world, box: box.apply_wrench("box", (0, 0, 0), (math.nan, 0, 0)), r"torque on link .low::box. is .nan"),
    (lambda world, box: box.set_base_twist((1e308, 0, 0), (0, 0, 0)), r"linear velocity .*-10000 to 10000 m/s"),
    (lambda world, box: box.set_base_twist((0, 0, 0), (1e12, 0, 0)), r"angular velocity .*10000 rad/s"),
    (lambda world, box: box.set_base_pose(Pose((0, 0, 1e30))), r"the position is .0, 0, 1e.30. m; expected -1e.07"),
    (lambda world, box: box.set_base_pose(Pose((0, 0, 1), (0, 0, 0, 1e200))), "norm of .*; expected 1"),
    (lambda world, box: box.set_inertial("box", 1e308, np.eye(3)), r"mass of link 'box' is 1e.308 kg; expected 0 to"),
    (lambda world, box: box.set_inertial("box", 1.0, 1e300 * np.eye(3)), "inertia of link 'box'"),
    (lambda world, box: box.set_inertial("box", 1e-300, np.eye(3)), "at least 1e-09 kg"),
    (lambda world, box: world.set_gravity((0, 0, 1e12)), r"gravity is .0, 0, 1e.12. m/s.2; expected -1000 to 1000"),
    (lambda world, box: world.spawn(Robot("r", {"l": Link("l", Inertial(1.0, np.zeros(3), np.eye(3)), [], [
        Shape(Box((1e30, 1, 1)), np.eye(4))])}, {}, "l"), "huge"), r"model 'huge': the size of the box .*10000 m"),
])
def test_what_bullet_cannot_compute_with_is_refused_with_its_bound(world, boxes, act, message):
    with pytest.raises(BulletSimError, match=message):
        act(world, boxes[0])
    step(world, 5)
    assert height(boxes[0]) == pytest.approx(0.05, abs=1e-3)


@pytest.mark.parametrize("act, message", [
    (lambda arm: arm.add_effort(BOTH, np.array([0.0, 1e308])), r"effort on a joint of 'arm' is .0, 1e.308."),
    (lambda arm: arm.drive_effort(BOTH, np.array([0.0, math.nan])), "the effort for elbow of 'arm' is nan"),
    (lambda arm: arm.drive_position(BOTH, np.array([math.nan, 0.0]), STRONG), "the position for shoulder of 'arm'"),
    (lambda arm: arm.drive_velocity(BOTH, np.array([math.nan, 0.0]), STRONG), "the velocity for shoulder of 'arm'"),
    (lambda arm: arm.set_joint_positions(BOTH, np.array([0.0, 1e308])), r"the position of joint 'elbow' is 1e.308"),
    (lambda arm: arm.set_damping(0, 1e308), "the damping of joint 'shoulder'"),
    (lambda arm: arm.set_limits(1, -1e308, 1.0), "the lower limit of joint 'elbow'"),
])
def test_no_joint_gets_what_is_no_number_or_beyond_its_bound(world, act, message):
    arm = world.spawn(parse_urdf(ARM), "arm", Pose((0, 0, 0.3)), static=True)
    with pytest.raises(BulletSimError, match=message):
        act(arm)


def test_a_drive_gives_no_more_than_there_is(world, told):
    arm = world.spawn(parse_urdf(ARM), "arm", Pose((0, 0, 0.3)), static=True)
    for _ in range(10):
        arm.drive_effort(BOTH, np.array([0.0, 1e308]))
        world.step()
        assert np.isfinite(arm.read_joints()).all()
    assert told == []


@pytest.mark.parametrize("push", [
    lambda arm, effort: arm.add_effort(BOTH[:1], np.array([effort])),
    lambda arm, effort: arm.add_effort(BOTH[1:], np.array([effort])),
    lambda arm, effort: arm.apply_wrench("lower", (effort, 0.0, 0.0), (0.0, effort, 0.0))],
    ids=["shoulder", "elbow", "wrench"])
@pytest.mark.parametrize("effort", [1e3, 1e5, 1e7, -1e7])
def test_no_force_pushes_a_joint_through_its_limit(world, told, push, effort):
    arm = world.spawn(parse_urdf(ARM), "arm", Pose((0.0, 0.0, 2.0)), static=True)
    turned = 0.0
    for tick in range(200):
        if tick < 20:
            push(arm, effort)
        world.step()
        position = arm.read_joints()[0]
        assert abs(position[0]) < 2.0 + 0.01, tick
        turned = max(turned, abs(position[1]))
    assert turned > 1.0  # the elbow has no limits, and was moved
    assert not told


def test_what_turns_quickly_without_limits_is_left_alone(world):
    arm = world.spawn(parse_urdf(ARM), "arm", Pose((0.0, 0.0, 2.0)), static=True)
    world.set_gravity((0.0, 0.0, 0.0))
    for _ in range(500):
        arm.drive_position(BOTH[:1], np.zeros(1), STRONG[:1])
        arm.drive_velocity(BOTH[1:], np.array([30.0]), STRONG[1:])
        world.step()
    position, velocity, _ = arm.read_joints()
    assert velocity[1] == pytest.approx(30.0, abs=0.1) and position[1] > 25.0
