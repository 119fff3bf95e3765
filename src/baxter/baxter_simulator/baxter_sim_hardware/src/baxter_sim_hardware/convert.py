# SPDX-License-Identifier: BSD-3-Clause
"""The one place where ROS messages meet the core's types."""
import genpy
from baxter_core_msgs.msg import AssemblyState, EndpointState, SEAJointState
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from urdf_model.transforms import quaternion_from_matrix


def stamp(time_s):
    """Simulation time [s] as a ROS time, to the nanosecond."""
    seconds, nanoseconds = divmod(round(time_s * 1e9), 1000000000)
    return genpy.Time(seconds, nanoseconds)


def joint_state(time_s, names, position, velocity, effort):
    """JointState of n joints from arrays (n,) in the order of `names`."""
    return JointState(Header(stamp=stamp(time_s)), names, position.tolist(), velocity.tolist(), effort.tolist())


def assembly_state(assembly):
    """AssemblyState from `robot_state.Assembly`."""
    return AssemblyState(assembly.ready, assembly.enabled, assembly.stopped, assembly.error,
                         int(assembly.estop_button), int(assembly.estop_source))


def endpoint_state(time_s, frame, pose, twist, wrench):
    """EndpointState in `frame` from a (4, 4) pose and (6,) twist and wrench, linear parts first."""
    pose_msg = Pose(Point(*pose[:3, 3].tolist()), Quaternion(*map(float, quaternion_from_matrix(pose[:3, :3]))))
    linear, angular = twist[:3].tolist(), twist[3:].tolist()
    force, torque = wrench[:3].tolist(), wrench[3:].tolist()
    return EndpointState(Header(stamp=stamp(time_s), frame_id=frame), pose_msg,
                         Twist(Vector3(*linear), Vector3(*angular)), Wrench(Vector3(*force), Vector3(*torque)))


def sea_joint_state(time_s, frame, names, commanded, measured, gravity):
    """SEAJointState of k joints.

    commanded: (position, velocity, effort), measured: (position, velocity, effort), gravity: all (k,). Accelerations
    are not commanded, and the joints have neither hysteresis nor crosstalk: zeros.
    """
    nothing = [0.0] * len(names)
    commanded_position, commanded_velocity, commanded_effort = (values.tolist() for values in commanded)
    position, velocity, effort = (values.tolist() for values in measured)
    gravity = gravity.tolist()
    return SEAJointState(Header(stamp=stamp(time_s), frame_id=frame), names,
                         commanded_position, commanded_velocity, nothing, commanded_effort,
                         position, velocity, effort, gravity, gravity, nothing, nothing, 0.0)
