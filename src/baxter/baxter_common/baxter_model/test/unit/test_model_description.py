# SPDX-License-Identifier: BSD-3-Clause
"""The facts of this package against the robot's description and messages."""
import itertools
import subprocess
import sys

import numpy as np
import pytest
from baxter_core_msgs.msg import EndEffectorProperties

import baxter_model
from baxter_model import JOINTS, MIRROR_SIGNS, SIDES, description
from baxter_model.self_collision import BODY, HEAD, HEAD_GUARDS, MESH_CUTS, self_collision_pairs, spawn_options
from urdf_model import parse_urdf


def tip_pose(robot, side, angles):
    """(4, 4) pose of an arm's tip in the base frame, joint by joint."""
    pose = np.eye(4)
    for joint in robot.chain(baxter_model.BASE_FRAME, baxter_model.tip_of(side)):
        pose = pose @ joint.origin
        if joint.movable:
            angle = angles[joint.name]
            assert np.allclose(joint.axis, (0.0, 0.0, 1.0))
            cosine, sine = np.cos(angle), np.sin(angle)
            turn = np.eye(4)
            turn[:2, :2] = (cosine, -sine), (sine, cosine)
            pose = pose @ turn
        pose = pose @ joint.child_offset
    return pose


def test_the_description_moves_these_joints_in_this_order(robot):
    for side in SIDES:
        chain = robot.chain(baxter_model.BASE_FRAME, baxter_model.tip_of(side))
        assert tuple(joint.name for joint in chain if joint.movable) == baxter_model.joint_names(side)
    assert [limb.side for limb in description.limbs_of(robot)] == list(SIDES)
    assert baxter_model.HEAD_JOINT in {joint.name for joint in robot.movable_joints()}


def test_mirrored_arms_have_mirrored_tips(robot):
    dice = np.random.default_rng(3)
    mirror = np.diag((1.0, -1.0, 1.0))
    for _ in range(10):
        posture = dict(zip(JOINTS, dice.uniform(-1.5, 1.5, len(JOINTS)), strict=True))
        left, right = (tip_pose(robot, side, baxter_model.arm_angles(side, posture)) for side in SIDES)
        # The vendor's mounts mirror each other to a tenth of a millimetre.
        assert np.allclose(mirror @ left[:3, 3], right[:3, 3], atol=5e-4)
        assert np.allclose(mirror @ left[:3, 2], right[:3, 2], atol=1e-3)
    assert set(MIRROR_SIGNS.values()) == {-1, 1}


def test_poses_are_within_the_limits_but_for_a_hair(robot):
    limits = {joint.name: (joint.limit.lower, joint.limit.upper) for joint in robot.movable_joints()}
    for side in SIDES:
        postures = {**baxter_model.null_space_postures(side),
                    **{name: baxter_model.poses().angles(name, side) for name in baxter_model.poses().names}}
        for name, angles in postures.items():
            for joint, angle in angles.items():
                lower, upper = limits[joint]
                assert lower - 0.05 <= angle <= upper + 0.05, (name, joint)


def test_every_pair_is_of_links_that_the_robot_has(robot):
    for pair in self_collision_pairs(robot.links):
        assert all(link in robot.links for link in pair)
    bare = [link for link in robot.links if "finger" not in link]
    assert 0 < len(self_collision_pairs(bare)) < len(self_collision_pairs(robot.links))
    assert set(MESH_CUTS) <= set(robot.links)
    assert self_collision_pairs(["base_link", "arm"]) == []
    assert spawn_options(["base_link", "arm"])["solids"] == {}
    options = spawn_options(robot.links)
    assert set(options["solids"]) <= set(robot.links) and robot.links[HEAD].visuals
    assert {pair[1] for pair in options["self_collision_pairs"] if pair[0] == HEAD} == {
        pair[1] for pair in options["self_collision_pairs"] if pair[0] == BODY}


def test_guards_stand_around_the_head(robot):
    guards = description.head_guards(robot)
    assert [name for name, _, _ in guards] == list(HEAD_GUARDS)
    for (_, centre, radius), y in zip(guards, (-0.04, 0.04), strict=True):
        assert centre.tolist() == pytest.approx([0.04, y, 0.75]) and radius == 0.22
    assert description.arm_radius(robot) == 0.06
    other = parse_urdf('<robot name="desk"><link name="base"/></robot>')
    assert description.head_guards(other) == [] and description.arm_radius(other) == 0.0


def test_pairs_are_the_same_on_both_sides(robot):
    def mirrored(link):
        for a, b in itertools.permutations(SIDES):
            if link.startswith(a + "_"):
                return b + link[len(a):]
            if link.startswith(baxter_model.finger_prefix(a)):
                return baxter_model.finger_prefix(b) + link[len(baxter_model.finger_prefix(a)):]
        return link

    pairs = {frozenset(pair) for pair in self_collision_pairs(robot.links)}
    assert {frozenset(map(mirrored, pair)) for pair in pairs} == pairs


def test_links_and_fingers_belong_to_their_arm(robot):
    for side in SIDES:
        other = baxter_model.other_side(side)
        openings = description.openings_of(robot, side)
        links = [baxter_model.tip_of(side), *(robot.joints[name].child for name in openings)]
        assert len(links) == 3
        assert all(baxter_model.is_part_of_arm(link, side) for link in links)
        assert not any(baxter_model.is_part_of_arm(link, other) for link in (*links, "torso", baxter_model.BASE_FRAME))


def test_another_robot_is_no_baxter():
    robot = parse_urdf('<robot name="desk"><link name="base"/></robot>')
    with pytest.raises(baxter_model.ModelMismatch, match="robot 'desk' has no left_s0, .*left_gripper; a Baxter has"):
        description.limbs_of(robot)


def test_grippers_are_those_of_the_messages():
    kinds = (baxter_model.SUCTION, baxter_model.ELECTRIC, baxter_model.CUSTOM)
    assert [kind.ui_type for kind in kinds] == [
        EndEffectorProperties.SUCTION_CUP_GRIPPER, EndEffectorProperties.ELECTRIC_GRIPPER,
        EndEffectorProperties.PASSIVE_GRIPPER]
    # The ids of the robot's interface: what commands to a suction, electric, custom gripper carry.
    assert [kind.id for kind in kinds] == [65537, 65538, 131073]


def test_loads_without_ros():
    """Also on a machine without ROS, and without packages that only some users need."""
    absent = ("rospy", "rospkg", "roslib", "genpy", "baxter_core_msgs", "urdf_model", "numpy", "pybullet")
    program = ("import sys; sys.modules.update(dict.fromkeys(%r)); import baxter_model, baxter_model.self_collision; "
               "baxter_model.null_space_postures('left')" % (absent,))
    subprocess.run([sys.executable, "-c", program], check=True)
