# SPDX-License-Identifier: BSD-3-Clause
"""The arms that the kinematics benches run on, ours and as KDL has them, and their collision checkers."""
from dataclasses import dataclass
from pathlib import Path

import PyKDL
import rospkg

import xacro
from arm_kinematics import Chain
from arm_kinematics.bullet_checker import BulletChecker
from baxter_model.self_collision import MESH_CUTS, self_collision_pairs
from model_files.resources import ResourceFinder
from urdf_model import Robot, parse_urdf


@dataclass(frozen=True)
class Arm:
    name: str
    chain: Chain
    robot: Robot
    urdf: str


def arms():
    """Return Baxter's two arms and the PROBOT Anno's."""
    baxter = expanded("baxter_description", "baxter.urdf.xacro")
    probot = expanded("probot_description", "probot_anno.xacro")
    found = []
    for name, text, base, tip in (("left arm", baxter, "base", "left_gripper"),
                                  ("right arm", baxter, "base", "right_gripper"),
                                  ("PROBOT", probot, "base_link", "tool0")):
        robot = parse_urdf(text, source=name)
        found.append(Arm(name, Chain.from_robot(robot, base, tip), robot, text))
    return found


def checker_of(arm):
    """Return a BulletChecker of an Arm's robot: for Baxter with its own list of self-collision pairs. The caller closes
    it."""
    pairs = self_collision_pairs(arm.robot.links)
    if not pairs:
        return BulletChecker.of_robot(arm.robot, find_mesh=ResourceFinder())
    return BulletChecker.of_robot(arm.robot, pairs, find_mesh=ResourceFinder(), mesh_cuts=MESH_CUTS)


def expanded(package, file):
    """Return the URDF text of a xacro file."""
    return xacro.process_file(str(Path(rospkg.RosPack().get_path(package)) / "urdf" / file)).toxml()


def kdl_chain(arm):
    """Return the PyKDL.Chain of an Arm."""
    chain = PyKDL.Chain()
    for joint in arm.robot.chain(arm.chain.base, arm.chain.tip):
        rotation, p = joint.origin[:3, :3], joint.origin[:3, 3]
        offset = PyKDL.Frame(PyKDL.Rotation(*rotation.ravel().tolist()), PyKDL.Vector(*p.tolist()))
        if joint.type == "fixed":
            chain.addSegment(PyKDL.Segment(PyKDL.Joint(), offset))
            continue
        # KDL turns about an axis given in the parent, before the offset's rotation.
        axis = PyKDL.Vector(*(rotation @ joint.axis).tolist())
        kdl_joint = PyKDL.Joint(joint.name, PyKDL.Vector(*p.tolist()), axis, PyKDL.Joint.RotAxis)
        chain.addSegment(PyKDL.Segment(kdl_joint, offset))
    return chain


def fill(array, values):
    """Copy numbers into a PyKDL.JntArray."""
    for i, value in enumerate(values):
        array[i] = value
