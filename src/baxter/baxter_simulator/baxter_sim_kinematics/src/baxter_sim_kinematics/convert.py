# SPDX-License-Identifier: BSD-3-Clause
"""Where ROS messages meet this package's own types. Nothing else in the package knows messages."""
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState

from baxter_sim_kinematics.ik import pose_from_quaternion


def pose_matrix(pose):
    """Return the (4, 4) matrix of a geometry_msgs/Pose. Raises InvalidTarget when it is no pose."""
    point, turn = pose.position, pose.orientation
    return pose_from_quaternion((point.x, point.y, point.z), (turn.x, turn.y, turn.z, turn.w))


def transform_matrix(transform):
    """Return the (4, 4) matrix of a geometry_msgs/Transform. Raises InvalidTarget when it is no transform."""
    return pose_matrix(Pose(position=transform.translation, orientation=transform.rotation))


def posture(chain, joint_state):
    """Return the posture (n,) of ``chain`` that a sensor_msgs/JointState holds. Raises InvalidPosture."""
    return chain.posture_by_name(list(joint_state.name), list(joint_state.position))


def joint_state(chain, q, order, stamp):
    """Return a sensor_msgs/JointState of the posture ``q`` (n,), its joints in the given order of names."""
    by_name = dict(zip(chain.joint_names, q.tolist(), strict=True))
    message = JointState(name=list(order), position=[by_name[name] for name in order])
    message.header.stamp = stamp
    return message
