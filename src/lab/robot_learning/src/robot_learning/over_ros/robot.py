# SPDX-License-Identifier: BSD-3-Clause
"""A Baxter on a ROS master with the members of `baxter_lab`'s robot that environments and actions use."""
from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import rospy
from baxter_core_msgs.msg import AssemblyState, EndEffectorCommand, EndEffectorState, JointCommand
from sensor_msgs.msg import JointState

from arm_kinematics import Chain
from baxter_model import JOINTS, SIDES
from urdf_model import parse_urdf

_SENDER = "policy"
_BASE = "base"


class RosGripper:
    """One hand: how far it is open [%], whether it holds something, its commands."""

    def __init__(self, side: str):
        name = "/robot/end_effector/%s_gripper/" % side
        self._id, self._sequence = 0, 0
        self.seen: float | None = None
        self.position, self.holds = 0.0, False
        self._commands = rospy.Publisher(name + "command", EndEffectorCommand, queue_size=10)
        self._kept = rospy.Subscriber(name + "state", EndEffectorState, self._on_state, queue_size=1, tcp_nodelay=True)

    def _on_state(self, message: EndEffectorState) -> None:
        self._id, self.position = message.id, float(message.position)
        self.holds = message.gripping == EndEffectorState.STATE_TRUE
        self.seen = rospy.get_time()

    def command(self, command: str, **arguments: float) -> None:
        """One command by its name on the wire, with its arguments."""
        self._sequence += 1
        self._commands.publish(EndEffectorCommand(
            id=self._id, command=command, args=json.dumps(arguments) if arguments else "", sender=_SENDER,
            sequence=self._sequence))


class RosArm:
    """One arm: angles (7,) [rad] and velocities (7,) [rad/s] from s0 to w2, the hand's pose (4, 4) in `base` [m]."""

    def __init__(self, side: str, chain: Chain):
        self.side, self.chain, self.gripper = side, chain, RosGripper(side)
        self.joint_names = ["%s_%s" % (side, joint) for joint in JOINTS]
        self.angles, self.velocities = np.zeros(len(JOINTS)), np.zeros(len(JOINTS))
        self._commands = rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1,
                                         tcp_nodelay=True)

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) of the gripper's frame."""
        return self.chain.fk(self.angles)

    def command(self, mode: int, values: Sequence[float] | np.ndarray) -> None:
        """One message of joint_command for all joints."""
        self._commands.publish(JointCommand(mode=int(mode), command=[float(value) for value in values],
                                            names=self.joint_names))

    @property
    def listeners(self) -> int:
        """How many subscribe to the commands."""
        return self._commands.get_num_connections()


class RosRobot:
    """Both arms. Raises KeyError where there is no /robot_description. Attributes: `arms`, `left`, `right`, `enabled`,
    `stopped`; `seen`: when the last joint states with both arms came [s], or None; `stamp`: theirs, by the robot's
    clock [s]."""

    def __init__(self) -> None:
        description = parse_urdf(rospy.get_param("/robot_description"), source="/robot_description")
        self.arms = {side: RosArm(side, Chain.from_robot(description, base=_BASE, tip="%s_gripper" % side))
                     for side in SIDES}
        self.left, self.right = (self.arms[side] for side in SIDES)
        self.enabled = self.stopped = False
        self.seen: float | None = None
        self.stamp = 0.0
        self._kept = [
            rospy.Subscriber("/robot/state", AssemblyState, self._on_state, queue_size=1),
            rospy.Subscriber("/robot/joint_states", JointState, self._on_joints, queue_size=1, tcp_nodelay=True)]

    def _on_state(self, message: AssemblyState) -> None:
        self.enabled, self.stopped = message.enabled, message.stopped or message.error

    def _on_joints(self, message: JointState) -> None:
        at = {name: index for index, name in enumerate(message.name)}
        if not all(name in at for arm in self.arms.values() for name in arm.joint_names):
            return  # of other joints alone, as drivers of grippers send them
        for arm in self.arms.values():
            index = [at[name] for name in arm.joint_names]
            arm.angles = np.array([message.position[n] for n in index])
            if message.velocity:
                arm.velocities = np.array([message.velocity[n] for n in index])
        # A physical robot's clock is another one.
        self.seen, self.stamp = rospy.get_time(), message.header.stamp.to_sec()

    @property
    def age_s(self) -> float:
        """Age of the oldest of what is observed [s], infinite before the first."""
        seen = [self.seen, *(arm.gripper.seen for arm in self.arms.values())]
        known = [time_s for time_s in seen if time_s is not None]
        return float("inf") if len(known) < len(seen) else rospy.get_time() - min(known)
