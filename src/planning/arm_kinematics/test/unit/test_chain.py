# SPDX-License-Identifier: BSD-3-Clause
"""The chain computes what the URDF says, for Baxter and for joints that Baxter does not have."""
import math
import subprocess
import sys

import numpy as np
import pytest

from arm_kinematics import Chain, ChainError, InvalidPosture, wrench_from_torques
from lab_testing.kdl import kdl_arm
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation, rigid

ROS = ("rospy", "actionlib", "tf2_ros", "sensor_msgs", "geometry_msgs", "baxter_core_msgs")

# Odd axes, a slider, a joint without limits, an axis along -z, fixed joints before, between and after.
ODD = """<robot name="odd">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/><link name="tip"/>
  <joint name="foot" type="fixed"><parent link="base"/><child link="a"/><origin xyz="0.1 0 0.2" rpy="0.3 0 0"/></joint>
  <joint name="turn" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0.1 0" rpy="0 0.4 0"/>
    <axis xyz="1 2 -0.5"/></joint>
  <joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.2 0 0" rpy="0 0 1"/>
    <axis xyz="0 1 1"/><limit lower="-0.1" upper="0.3" velocity="1" effort="1"/></joint>
  <joint name="bracket" type="fixed"><parent link="c"/><child link="d"/><origin xyz="0 0 0.3" rpy="1 0 0"/></joint>
  <joint name="down" type="revolute"><parent link="d"/><child link="e"/><origin xyz="0 0.2 0"/>
    <axis xyz="0 0 -1"/><limit lower="-1" upper="2" velocity="1" effort="1"/></joint>
  <joint name="tool" type="fixed"><parent link="e"/><child link="tip"/><origin xyz="0.1 0 0.1" rpy="0 1 0"/></joint>
</robot>"""


def link_poses(robot, base, tip, positions):
    """Plain forward kinematics, link by link, as a second opinion."""
    pose, poses = np.eye(4), {base: np.eye(4)}
    for joint in robot.chain(base, tip):
        pose = pose @ joint.origin
        if joint.type in ("revolute", "continuous"):
            pose = pose @ rigid(axis_rotation(joint.axis, positions[joint.name]), (0, 0, 0))
        elif joint.type == "prismatic":
            pose = pose @ rigid(np.eye(3), joint.axis * positions[joint.name])
        poses[joint.child] = pose
    return poses


def differentiated(chain, q, step=1e-6):
    """The Jacobian by central differences of forward kinematics."""
    columns = []
    for i in range(len(q)):
        ahead, behind = q.copy(), q.copy()
        ahead[i] += step
        behind[i] -= step
        a, b = chain.fk(ahead), chain.fk(behind)
        spin = (a[:3, :3] - b[:3, :3]) @ chain.fk(q)[:3, :3].T / (2 * step)
        columns.append([*(a[:3, 3] - b[:3, 3]) / (2 * step), spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.array(columns).T


@pytest.fixture(scope="module")
def odd():
    return Chain.from_robot(parse_urdf(ODD, source="odd"), "base", "tip")


def test_core_loads_without_ros():
    """The core must import on a machine that has no ROS at all."""
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (ROS,)
    subprocess.run([sys.executable, "-c", block + "import arm_kinematics"], check=True)


def test_joints_are_those_of_the_limb_in_order(chain, side):
    assert chain.joint_names == tuple("%s_%s" % (side, joint) for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2"))
    assert (chain.lower < chain.upper).all() and np.isfinite(chain.lower).all()
    with pytest.raises(ValueError):
        chain.lower[0] = 0.0


def test_every_link_is_where_plain_multiplication_puts_it(robot, chain, side):
    rng = np.random.default_rng(1)
    for q in rng.uniform(chain.lower, chain.upper, (200, 7)):
        expected = link_poses(robot, "base", side + "_gripper", dict(zip(chain.joint_names, q, strict=True)))
        np.testing.assert_allclose(chain.fk(q), expected[side + "_gripper"], atol=1e-12)
        frames = chain.link_frames(q)
        assert list(frames) == list(expected)
        for link, frame in frames.items():
            np.testing.assert_allclose(frame, expected[link], atol=1e-12)


def test_tip_is_where_kdl_puts_it(robot, chain, side):
    kdl, arm = kdl_arm(robot, "base", side + "_gripper")
    solver, values, frame = kdl.ChainFkSolverPos_recursive(arm), kdl.JntArray(7), kdl.Frame()
    jacobian_solver, jacobian = kdl.ChainJntToJacSolver(arm), kdl.Jacobian(7)
    for q in np.random.default_rng(2).uniform(chain.lower, chain.upper, (200, 7)):
        for i, value in enumerate(q.tolist()):
            values[i] = value
        solver.JntToCart(values, frame)
        jacobian_solver.JntToJac(values, jacobian)
        expected = np.array([[frame[row, column] for column in range(4)] for row in range(3)])
        np.testing.assert_allclose(chain.fk(q)[:3], expected, atol=1e-12)
        expected = np.array([[jacobian[row, column] for column in range(7)] for row in range(6)])
        np.testing.assert_allclose(chain.jacobian(q), expected, atol=1e-12)


def test_jacobian_is_the_derivative_of_the_pose(chain):
    for q in np.random.default_rng(3).uniform(chain.lower, chain.upper, (50, 7)):
        np.testing.assert_allclose(chain.jacobian(q), differentiated(chain, q), atol=1e-8)


def test_odd_joints(odd):
    robot = parse_urdf(ODD, source="odd")
    assert odd.joint_names == ("turn", "slide", "down")
    assert odd.lower.tolist() == [-math.inf, -0.1, -1.0]
    for q in np.random.default_rng(4).uniform(-1, 1, (50, 3)):
        expected = link_poses(robot, "base", "tip", dict(zip(odd.joint_names, q, strict=True)))
        np.testing.assert_allclose(odd.fk(q), expected["tip"], atol=1e-12)
        frames = odd.link_frames(q)
        for link, pose in expected.items():
            np.testing.assert_allclose(frames[link], pose, atol=1e-12)
        np.testing.assert_allclose(odd.jacobian(q), differentiated(odd, q), atol=1e-8)


@pytest.mark.parametrize(
    "values, text",
    [([0.0] * 6, "expected 7 joint values"), ([0.0] * 6 + [math.nan], "left_w2 = nan"),
     ([math.inf, -math.inf] + [0.0] * 5, "left_s0 = inf, left_s1 = -inf"), (["a"] * 7, "7 numbers"),
     (np.zeros((7, 7)), "shape")])
def test_values_that_are_no_posture_are_refused(left, values, text):
    with pytest.raises(InvalidPosture, match=text):
        left.fk(values)


def test_posture_by_name_takes_its_own_joints_in_any_order(left):
    names = ["head_pan", *reversed(left.joint_names)]
    np.testing.assert_array_equal(left.posture_by_name(names, [9, 6, 5, 4, 3, 2, 1, 0]), np.arange(7.0))
    with pytest.raises(InvalidPosture, match="no value for left_s0"):
        left.posture_by_name(list(left.joint_names[1:]), [0.0] * 6)
    with pytest.raises(InvalidPosture, match="7 joint names but 6 positions"):
        left.posture_by_name(list(left.joint_names), [0.0] * 6)
    with pytest.raises(InvalidPosture, match="more than one value for left_s0"):
        left.posture_by_name([*left.joint_names, "left_s0"], [0.0] * 8)


def test_chains_that_cannot_be_are_refused():
    def steps(kind="revolute", axis=(0, 0, 1), lower=-1.0, upper=1.0):
        return [("j", kind, "tip", np.eye(4), axis, lower, upper)]

    for bad, text in ((steps(kind="floating"), "is floating"), (steps(kind="fixed"), "no joint moves"),
                      (steps(axis=(0, 0, 0)), "not a direction"), (steps(lower=2.0), "above its upper limit")):
        with pytest.raises(ChainError, match=text):
            Chain("base", "tip", bad)


def test_wrench_is_what_the_torques_exert(chain):
    wrench = np.array([10.0, -5.0, 3.0, 0.4, -0.2, 0.1])
    jacobian = chain.jacobian([0.1, -0.55, 0.2, 0.75, -0.3, 1.26, 0.4])
    np.testing.assert_allclose(wrench_from_torques(jacobian, jacobian.T @ wrench, damping=1e-6), wrench, atol=1e-6)
    # Damped, a straight arm gives no huge force.
    stretched = chain.jacobian(np.zeros(7))
    assert np.abs(wrench_from_torques(stretched, np.ones(7))).max() < 100.0
