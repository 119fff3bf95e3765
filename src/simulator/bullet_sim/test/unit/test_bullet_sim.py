# SPDX-License-Identifier: BSD-3-Clause
"""The world against mechanics computed by hand, on a small arm."""

import hashlib
import math
import re
import subprocess
import sys

import numpy as np
import pytest

from bullet_sim import BulletSimError, Pose, World
from bullet_sim.mass_matrix import mass_matrix_of
from bullet_sim.quiet_pybullet import pybullet
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation, pose_matrix, rigid

ARM = """
<robot name="arm">
  <link name="base">
    <inertial><origin xyz="0.1 0.2 0.3" rpy="0.4 0 0"/><mass value="5"/><inertia ixx="1" iyy="2" izz="2.5"/></inertial>
    <collision><origin xyz="0 0 1"/><geometry><sphere radius="0.25"/></geometry></collision>
  </link>
  <link name="upper">
    <inertial><origin xyz="0.3 0.02 0" rpy="0 0.3 0"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.05" izz="0.05"/></inertial>
    <collision><origin xyz="0.3 0 0"/><geometry><box size="0.6 0.1 0.1"/></geometry></collision>
  </link>
  <link name="lower">
    <inertial><origin xyz="0.2 0 0.01"/><mass value="1"/><inertia ixx="0.01" iyy="0.03" izz="0.03"/></inertial>
    <collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.08 0.08"/></geometry></collision>
  </link>
  <link name="tool">
    <inertial><origin xyz="0 0 0.05"/><mass value="0.5"/><inertia ixx="0.001" iyy="0.001" izz="0.001"/></inertial>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 1"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="100" velocity="3"/><dynamics damping="0.5"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.6 0 0" rpy="0.2 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="50" velocity="3"/></joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/>
    <origin xyz="0.4 0 0" rpy="0 1 0"/></joint>
</robot>
"""
BOX = """<robot name="box"><link name="box"><inertial><mass value="1"/>
  <inertia ixx="0.0017" iyy="0.0017" izz="0.0017"/></inertial>
  <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"""
BOTH = np.arange(2)


@pytest.fixture
def arm(world):
    return world.spawn(parse_urdf(ARM), "arm", static=True)


def link_matrices(robot, base, positions):
    """Forward kinematics over all links, by hand."""
    found, links = {robot.root: base}, [robot.root]
    while links:
        parent = links.pop()
        for joint in robot.children(parent):
            turn = rigid(axis_rotation(joint.axis, positions.get(joint.name, 0.0)), (0, 0, 0))
            found[joint.child] = found[parent] @ joint.origin @ turn
            links.append(joint.child)
    return found


def potential_energy(robot, base, positions, gravity):
    frames = link_matrices(robot, base, positions)
    energy = 0.0
    for name, link in robot.links.items():
        if link.inertial is not None:
            centre = frames[name] @ np.append(link.inertial.centre, 1.0)
            energy -= link.inertial.mass * centre[:3] @ gravity
    return energy


@pytest.mark.parametrize("pose", [Pose(), Pose.from_matrix(pose_matrix((1, 2, 3), (0.5, -0.4, 2.0)))])
def test_gravity_efforts_are_the_slope_of_the_potential_energy(world, pose):
    robot = parse_urdf(ARM)
    model = world.spawn(robot, "arm", pose, static=True)
    step = 1e-5
    for q in np.random.default_rng(1).uniform(-2, 2, (5, 2)):
        expected = []
        for joint in range(2):
            energy = []
            for sign in (1, -1):
                moved = q.copy()
                moved[joint] += sign * step
                named = dict(zip(model.joint_names, moved, strict=True))
                energy.append(potential_energy(robot, pose.matrix(), named, np.array(world.gravity)))
            expected.append((energy[0] - energy[1]) / (2 * step))
        np.testing.assert_allclose(model.gravity_efforts(q), expected, atol=1e-7)


def test_links_stand_where_forward_kinematics_says(world):
    robot = parse_urdf(ARM)
    pose = Pose.from_matrix(pose_matrix((0.5, 0, 1), (0.1, 0.2, 0.3)))
    for static in (True, False):
        model = world.spawn(robot, "arm %s" % static, pose, static=static)
        model.set_joint_positions(BOTH, np.array([0.4, -1.1]))
        expected = link_matrices(robot, pose.matrix(), {"shoulder": 0.4, "elbow": -1.1})
        for link in model.link_names:
            np.testing.assert_allclose(model.link_pose(link).matrix(), expected[link], atol=1e-6, err_msg=link)
        np.testing.assert_allclose(model.base_pose().matrix(), pose.matrix(), atol=1e-6)


def test_mass_matrix_carries_the_merged_inertia(arm):
    """Kinetic energy of the elbow alone: I about its axis, from the two links that it turns."""
    lower, tool = arm.robot.links["lower"].inertial, arm.robot.links["tool"].inertial
    flange = arm.robot.joints["flange"].origin
    tool_inertia = flange[:3, :3] @ tool.inertia @ flange[:3, :3].T
    tool_centre = (flange @ np.append(tool.centre, 1))[:3]
    expected = lower.inertia[1, 1] + lower.mass * (lower.centre[0] ** 2 + lower.centre[2] ** 2)
    expected += tool_inertia[1, 1] + tool.mass * (tool_centre[0] ** 2 + tool_centre[2] ** 2)
    assert arm.mass_matrix(np.zeros(2))[1, 1] == pytest.approx(expected, rel=1e-6)


def test_the_mass_matrix_from_the_links_is_bullets(arm):
    arm.set_joint_positions(BOTH, np.array([0.4, -1.1]))
    np.testing.assert_allclose(mass_matrix_of(arm), arm.mass_matrix(np.array([0.4, -1.1])), rtol=1e-6)


def test_a_damped_arm_may_have_an_inertia_that_no_body_has(world):
    """A moment larger than the sum of the others: published descriptions have such, and Gazebo takes them."""
    lower = ARM.index('<link name="lower">')
    other = '<inertia ixx="0.3" iyy="0.1" izz="10"/>'
    impossible = ARM[:lower] + re.sub("<inertia [^>]*>", other, ARM[lower:], count=1)
    arm = world.spawn(parse_urdf(impossible), "arm", static=True)
    assert arm.damping[0] == 0.5
    arm.drive_velocity(BOTH, np.array([0.2, 0.2]), np.array([100.0, 100.0]))
    for _ in range(100):
        world.step()
    assert arm.read_joints()[1] == pytest.approx([0.2, 0.2], abs=0.01)


@pytest.mark.parametrize("together", [True, False])
def test_a_drive_that_is_told_the_same_again_moves_the_same(monkeypatch, together):
    """Bit for bit, though Bullet is told once; whatever else happens to the joints or the step in between."""
    motions, calls = [], []
    for always_tells in (True, False):
        world = World()
        model = world.spawn(parse_urdf(ARM), "arm", static=True)
        command = model.parts.command
        if not always_tells:
            monkeypatch.setattr(model.parts, "command", lambda *a, tell=command, **c: calls.append(a) or tell(*a, **c))
        target, rows = np.array([-0.4, 0.8]), []
        between = {40: lambda m: m.drive_velocity(BOTH, np.ones(2), m.max_effort), 60: lambda m: m.release(BOTH),
                   80: lambda m: m.drive_effort(BOTH, np.ones(2)), 100: lambda m: m.carry(BOTH[:1], np.zeros(1)),
                   120: lambda m: m.set_joint_positions(BOTH, np.zeros(2)),
                   130: lambda m: m.drive_position(BOTH, np.zeros(2), m.max_effort),
                   135: lambda m: m.drive_position(BOTH[:1], np.ones(1), m.max_effort[:1]),
                   140: lambda m: m._world.set_time_step(0.001), 160: lambda m: m._world.rebuild([m])}
        for tick in range(180):
            if tick in between:
                between[tick](model)
                if tick % 40 == 0:
                    world.step()
            for joints in [BOTH] if together else [BOTH[:1], BOTH[1:]]:
                if always_tells:
                    model._told.clear()
                model.drive_position(joints, target[joints], 0.5 * model.max_effort[joints])
            world.step()
            rows.append([values.tobytes() for values in model.read_joints()])
        motions.append(rows)
        world.close()
    assert motions[0] == motions[1]
    assert len(calls) < 40


def test_position_drive_holds_and_reports_the_gravity_torque(world, arm):
    target = np.array([0.3, -0.7])
    arm.set_joint_positions(BOTH, target)
    arm.drive_position(BOTH, target, arm.max_effort)
    for _ in range(1000):
        world.step()
    position, velocity, effort = arm.read_joints()
    np.testing.assert_allclose(position, target, atol=1e-4)
    np.testing.assert_allclose(velocity, 0, atol=1e-6)
    np.testing.assert_allclose(effort, arm.gravity_efforts(position), atol=1e-3)


def test_moving_set_point_is_followed_without_lag(world, arm):
    speed = np.array([0.5, -0.8])
    target = np.zeros(2)
    arm.drive_position(BOTH, target, arm.max_effort)
    for _ in range(500):
        target = target + speed * world.time_step_s
        arm.drive_position(BOTH, target, arm.max_effort, velocity=speed)
        world.step()
    np.testing.assert_allclose(arm.read_joints()[0], target, atol=2e-4)


def test_velocity_drive_keeps_the_velocity(world, arm):
    arm.drive_velocity(BOTH, np.array([0.3, -0.2]), arm.max_effort)
    for _ in range(500):
        world.step()
    np.testing.assert_allclose(arm.read_joints()[1], (0.3, -0.2), atol=1e-3)


def test_effort_with_gravity_compensation_floats_and_reports_the_command(world, arm):
    arm.set_joint_positions(BOTH, np.array([0.5, 0.5]))
    for _ in range(1000):
        gravity = arm.gravity_efforts()
        arm.drive_effort(BOTH, gravity)
        world.step()
    position, _, effort = arm.read_joints()
    np.testing.assert_allclose(position, 0.5, atol=1e-5)
    np.testing.assert_allclose(effort, gravity)


def test_a_reading_is_of_now_whatever_was_read_before(world, arm):
    arm.set_joint_positions(BOTH, np.full(2, 0.2))
    assert arm.read_joints()[0] == pytest.approx(0.2)
    arm.set_joint_positions(BOTH, np.full(2, 0.1))
    assert arm.read_joints()[0] == pytest.approx(0.1)
    arm.drive_velocity(BOTH, np.full(2, 0.5), arm.max_effort)
    for tick in range(3):
        before = arm.read_joints()[0]
        world.reset_time()
        world.step()
        assert np.all(arm.read_joints()[0] > before), "step %d" % tick
    arm.drive_effort(BOTH, np.full(2, 0.3))
    assert arm.read_joints()[2] == pytest.approx(0.3)
    arm.drive_effort(BOTH, np.full(2, 0.4))
    assert arm.read_joints()[2] == pytest.approx(0.4)
    arm.release(BOTH)
    assert np.all(arm.read_joints()[2] != 0.4)
    for values in arm.read_joints():
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


def test_effort_accelerates_by_the_mass_matrix(world, arm):
    torque = np.array([1.0, 0.5])
    acceleration = np.linalg.solve(arm.mass_matrix(np.zeros(2)), torque)
    for _ in range(5):
        arm.drive_effort(BOTH, arm.gravity_efforts() + torque)
        world.step()
    np.testing.assert_allclose(arm.read_joints()[1], acceleration * 5 * world.time_step_s, rtol=0.02)


def test_release_lets_the_arm_fall_and_limits_stop_it(world, arm):
    arm.set_joint_positions(BOTH, np.array([0.2, 0.0]))
    for _ in range(3000):
        world.step()
        position = arm.read_joints()[0]
        assert (position > arm.lower - 0.02).all() and (position < arm.upper + 0.02).all()
    assert position[0] > 1.0


def test_damping_beyond_what_is_stable_is_bounded(world):
    robot = parse_urdf(ARM.replace('damping="0.5"', 'damping="1e6"'))
    model = world.spawn(robot, "arm", static=True)
    for _ in range(500):
        world.step()
    assert np.isfinite(model.read_joints()[0]).all() and abs(model.read_joints()[1]).max() < 10


def test_a_shorter_tick_lets_more_damping_act(world):
    arm = world.spawn(parse_urdf(ARM.replace('damping="0.5"', 'damping="1e6"')), "arm", static=True)
    before = arm.damping[0]
    world.set_time_step(world.time_step_s / 2.0)
    assert arm.damping[0] == pytest.approx(2.0 * before)


def test_wrench_deflects_the_motor_torque_by_the_jacobian(world, arm):
    target = np.zeros(2)
    arm.drive_position(BOTH, target, arm.max_effort)
    tip = np.array(arm.link_pose("tool").position)
    for _ in range(500):
        arm.apply_wrench("tool", (0, 0, -10.0), position=arm.link_pose("tool").position)
        world.step()
    position, _, effort = arm.read_joints()
    # About +y a downward force at x ahead of the joint turns positive; the motor holds against it.
    # The elbow's axis is rolled by 0.2 rad.
    expected = [-10.0 * tip[0], -10.0 * (tip[0] - 0.6) * math.cos(0.2)]
    np.testing.assert_allclose(effort - arm.gravity_efforts(position), expected, rtol=1e-2)


def test_free_box_falls_rests_and_is_reset(world):
    world.add_ground_plane()
    box = world.spawn(parse_urdf(BOX), "box", Pose((0, 0, 0.5)))
    for _ in range(1000):
        world.step()
    assert box.base_pose().position[2] == pytest.approx(0.05, abs=1e-3)
    contact = world.contacts(box)[0]
    assert {contact.model_a, contact.model_b} == {"box", "ground_plane"}
    assert sum(c.force for c in world.contacts(box)) == pytest.approx(9.81, rel=0.05)
    assert box.pushes() == []
    for _ in range(100):
        box.apply_wrench("box", (2.0, 1.0, 0.0))
        world.step()
    assert box.pushes() == [("box", (2.0, 1.0, 0.0), (0.0, 0.0, 0.0), None)]
    on_box = [np.array(c.friction) * (1 if c.model_a == "box" else -1) for c in world.contacts(box)]
    np.testing.assert_allclose(sum(on_box), (-2.0, -1.0, 0.0), atol=0.02)
    box.set_base_pose(Pose((0, 0, 0.5)))
    world.detect_contacts()
    assert world.contacts(box) == []
    box.set_base_pose(Pose((0, 0, 0.04)))
    world.detect_contacts()
    assert min(c.distance for c in world.contacts(box)) == pytest.approx(-0.01, abs=1e-3)
    world.reset_models()
    assert box.base_pose().position == pytest.approx((0, 0, 0.5))
    np.testing.assert_allclose(box.base_twist()[0], 0, atol=1e-12)


def test_twist_of_a_free_body_is_that_of_its_frame(world):
    world.set_gravity((0, 0, 0))
    model = world.spawn(parse_urdf(ARM), "arm", Pose.from_matrix(pose_matrix((0, 0, 0), (0.3, 0.2, 0.1))))
    model.set_base_twist((1, 2, 3), (0.1, -0.2, 0.3))
    linear, angular = model.base_twist()
    np.testing.assert_allclose(linear, (1, 2, 3), atol=1e-9)
    np.testing.assert_allclose(angular, (0.1, -0.2, 0.3), atol=1e-9)
    arm = np.subtract(model.link_pose("upper").position, model.base_pose().position)
    np.testing.assert_allclose(model.link_twist("upper")[0], np.array((1, 2, 3)) + np.cross(angular, arm), atol=1e-6)


def test_only_wanted_pairs_collide(world):
    folded = parse_urdf(ARM.replace('lower="-2.5" upper="2.5"', 'lower="-4" upper="4"'))
    arm = world.spawn(folded, "arm", static=True)
    arm.set_joint_positions(BOTH, np.array([0.0, math.pi]))
    world.step()
    assert world.contacts(arm) == []
    arm.set_joint_positions(BOTH, np.array([0.0, math.pi]))
    arm.set_self_collision_pairs([("base", "tool")])
    world.step()
    assert {(c.link_a, c.link_b) for c in world.contacts(arm)} == {("base", "lower")}


def test_rays_find_shapes_and_the_floor(world, arm):
    world.add_ground_plane()
    fractions = world.ray_test_batch([(0.3, 0, 2), (5, 5, 2), (5, 5, 2)], [(0.3, 0, 0), (5, 5, -2), (5, 5, 1)])
    np.testing.assert_allclose(fractions, (0.95 / 2, 0.5, 1.0), atol=1e-3)


def run_and_hash():
    with_arm = World(seed=3)
    with_arm.add_ground_plane()
    model = with_arm.spawn(parse_urdf(ARM), "arm", static=True)
    with_arm.spawn(parse_urdf(BOX), "box", Pose((0.5, 0, 0.8)))
    digest = hashlib.sha256()
    for tick in range(600):
        target = np.array([math.sin(tick * 0.01), math.cos(tick * 0.013)])
        model.drive_position(BOTH, target, model.max_effort)
        with_arm.step()
        for array in model.read_joints():
            digest.update(array.tobytes())
        digest.update(repr(with_arm.models["box"].base_pose()).encode())
    with_arm.close()
    return digest.hexdigest()


def test_two_fresh_worlds_agree_bit_for_bit():
    assert run_and_hash() == run_and_hash()


def test_mesh_is_converted_once_and_a_missing_one_gets_a_stand_in(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    stl = tmp_path / "wedge.stl"
    stl.write_text(
        "solid w\n"
        + "".join(
            "facet normal 0 0 0\nouter loop\n%s\nendloop\nendfacet\n"
            % "\n".join("vertex %g %g %g" % v for v in triangle)
            for triangle in (
                [(0, 0, 0), (0, 1, 0), (1, 0, 0)],
                [(0, 0, 0), (1, 0, 0), (0, 0, 1)],
                [(0, 0, 0), (0, 0, 1), (0, 1, 0)],
                [(1, 0, 0), (0, 1, 0), (0, 0, 1)],
            )
        )
        + "endsolid w\n"
    )
    mesh = BOX.replace('<box size="0.1 0.1 0.1"/>', '<mesh filename="%s" scale="0.2 0.2 0.2"/>')
    told = []
    world = World(warn=told.append)
    world.spawn(parse_urdf(mesh % stl), "wedge", static=True)
    world.step()
    np.testing.assert_allclose(world.ray_test_batch([(0.05, 0.05, 1)], [(0.05, 0.05, 0)]), 0.9, atol=0.01)
    assert told == [] and len(list((tmp_path / "cache/bullet_sim/meshes").glob("*.obj"))) == 1
    world.spawn(parse_urdf(mesh % "package://nowhere/box.stl"), "lost", Pose((5, 0, 0)), static=True)
    assert len(told) == 1 and "package://nowhere/box.stl cannot be found; a box replaces it" in told[0]
    world.step()
    assert world.ray_test_batch([(5, 0, 1)], [(5, 0, 0)])[0] < 1.0
    world.close()


@pytest.mark.parametrize(
    "act, message",
    [
        (lambda world: world.spawn(parse_urdf(BOX), "arm"), "'arm' exists already"),
        (lambda world: world.spawn(parse_urdf(BOX), ""), "needs a name"),
        (lambda world: world.spawn(parse_urdf(BOX), "b", Pose((math.nan, 0, 0))), "not finite"),
        (lambda world: world.delete("leg"), "there is no model 'leg'; models: arm"),
        (lambda world: world.models["arm"].index(["wrist"]), "no joint 'wrist'; its joints are shoulder, elbow"),
        (lambda world: world.models["arm"].link_pose("hand"), "no link 'hand'; its links are base, upper"),
        (lambda world: world.set_gravity((0, math.inf, 0)), r"gravity is \(0, inf, 0\) m/s.2; expected -1000 to 1000"),
        (lambda world: World(time_step_s=1.0), "the time step is 1 s; expected 1e-05 to 0.05 s"),
        (lambda world: world.spawn(parse_urdf(ARM), "free").gravity_efforts(), "need a fixed base"),
    ],
)
def test_what_is_wrong_is_said(world, arm, act, message):
    with pytest.raises(BulletSimError, match=message):
        act(world)


def test_a_closed_world_is_not_connected():
    world = World()
    world.close()
    world.close()
    with pytest.raises(pybullet.error, match="Not connected"):
        world.step()


def test_core_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(('rospy', 'roslib', 'geometry_msgs'))); "
    subprocess.run([sys.executable, "-c", block + "import bullet_sim"], check=True)
