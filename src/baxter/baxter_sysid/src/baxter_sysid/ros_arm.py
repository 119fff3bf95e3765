# SPDX-License-Identifier: BSD-3-Clause
"""An arm of the robot on a ROS master, for `live`; how it is moved once somebody has agreed."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import rosgraph
import rospy
from baxter_core_msgs.msg import AssemblyState, CollisionAvoidanceState, CollisionDetectionState, JointCommand
from sensor_msgs.msg import JointState

from baxter_model import SIDES, joint_names
from baxter_model.readiness import STATES_KEPT, UNFOLD, why_not_ready
from urdf_model import Robot, UrdfError, parse_urdf

from .arm_body import Array
from .errors import SysidError
from .excitation import PERIOD_S, motion
from .live import ArmReading, Space, record, straight
from .recording import ArmRecording

#: Within this [s, wall] joint states must come; at first, within the longer one.
_SILENT_S, _START_S = 2.0, 20.0
#: A robot has two publishers of joint states; what one tells again, so much [s] later than the other, is not news.
_LATE_S = 0.5
_COMMANDS = "robot/limb/%s/joint_command"


class IdentifiedRosArm:
    """One arm, as `live.RobotArm`. Make it after rospy.init_node. Raises SysidError if the robot does not report."""

    def __init__(self, side: str) -> None:
        self.side, self._names = side, {each: joint_names(each) for each in SIDES}
        self._changed, self._count, self._told = threading.Condition(), 0, 0
        self._stamp_s = 0.0
        self._joints: dict[str, float] = {}
        # Why the robot does not move, from the first state that says so on; None before the first one.
        self._idle: str | None = None
        self._collides, self._near = False, ""
        self._publisher = rospy.Publisher(_COMMANDS % side, JointCommand, queue_size=1, tcp_nodelay=True)
        # Where arms and grippers have messages of their own, the last one in the queue is the grippers'.
        rospy.Subscriber("robot/joint_states", JointState, self._on_joints, queue_size=STATES_KEPT, tcp_nodelay=True)
        rospy.Subscriber("robot/state", AssemblyState, self._on_state, queue_size=STATES_KEPT)
        limb = "robot/limb/%s/" % side
        rospy.Subscriber(limb + "collision_detection_state", CollisionDetectionState, self._on_collision, queue_size=1)
        rospy.Subscriber(limb + "collision_avoidance_state", CollisionAvoidanceState, self._on_near, queue_size=1)
        self._wait(lambda: self._idle is not None and self._count > 0 and all(
            name in self._joints for names in self._names.values() for name in names), _START_S,
            "robot/state and the joints of both arms on robot/joint_states")
        self._wait(lambda: self._publisher.get_num_connections() > 0, _START_S, "the robot to subscribe to "
                   + str(self._publisher.resolved_name))

    def posture(self, side: str) -> Array:
        """(7,) [rad] where an arm is."""
        with self._changed:
            return np.array([self._joints[name] for name in self._names[side]])

    def next(self) -> ArmReading:
        """As `live.RobotArm` says."""
        self._wait(lambda: self._count > self._told, _SILENT_S, "robot/joint_states")
        with self._changed:
            self._told = self._count
            position = np.array([self._joints[name] for name in self._names[self.side]])
            return ArmReading(self._stamp_s, position, self._trouble())

    def command(self, position: Array, raw: bool) -> None:
        """As `live.RobotArm` says."""
        mode = JointCommand.RAW_POSITION_MODE if raw else JointCommand.POSITION_MODE
        self._publisher.publish(JointCommand(mode, position.tolist(), list(self._names[self.side])))

    def others(self) -> list[str]:
        """Names of the other nodes that publish commands of this arm."""
        try:
            publishers = _publishers(rosgraph.Master(rospy.get_name()))
        except (OSError, rosgraph.MasterException) as error:
            raise SysidError("the ROS master at %s does not answer: %s" % (rosgraph.get_master_uri(), error)) from error
        return sorted(node for topic, nodes in publishers if topic == self._publisher.resolved_name
                      for node in nodes if node != rospy.get_name())

    def _trouble(self) -> str:
        if self._idle:
            return self._idle
        for name in (each for names in self._names.values() for each in names):
            if not np.isfinite(self._joints[name]):
                return "joint states say that %s is at %s rad; it must be a finite number" % (name, self._joints[name])
        if self._collides:
            return "the %s arm reports a collision" % self.side
        if self._near:
            return "collision avoidance reports that the %s arm is too near to %s; move the arms apart and away from " \
                   "the body: %s" % (self.side, self._near, UNFOLD)
        return ""

    def _wait(self, condition: Callable[[], bool], within_s: float, what: str) -> None:
        with self._changed:
            if not self._changed.wait_for(lambda: condition() or rospy.is_shutdown(), within_s):
                raise SysidError("no answer of the robot within %g s: waited for %s" % (within_s, what))
        if rospy.is_shutdown():
            raise SysidError("ROS was shut down")

    def _on_joints(self, message: JointState) -> None:
        with self._changed:
            if self._names[self.side][0] in message.name:
                stamp_s = message.header.stamp.to_sec()
                if 0.0 <= self._stamp_s - stamp_s < _LATE_S:
                    return
                self._stamp_s, self._count = stamp_s, self._count + 1
            self._joints.update(zip(message.name, message.position, strict=False))
            self._changed.notify_all()

    def _on_state(self, message: AssemblyState) -> None:
        with self._changed:
            self._idle = self._idle or why_not_ready(message)
            self._changed.notify_all()

    def _on_collision(self, message: CollisionDetectionState) -> None:
        self._collides = message.collision_state

    def _on_near(self, message: CollisionAvoidanceState) -> None:
        self._near = ", ".join(message.collision_object)


def _publishers(master: Any) -> list[tuple[str, list[str]]]:
    """(topic, its nodes) by the master; rosgraph has no types."""
    return master.getSystemState()[0]


def record_live(side: str, seconds: float, agreed: Callable[[str], bool]) -> tuple[Robot, ArmRecording]:
    """Move one arm of the robot on the ROS master, after `agreed(what will happen)`. This process becomes a node.

    Returns the robot's description, and the recording. Raises SysidError.
    """
    uri = rosgraph.get_master_uri()
    if not rosgraph.is_master_online():
        raise SysidError("no ROS master at %s: start the simulator, or name the robot: ./baxter.sh HOST rosrun "
                         "baxter_sysid sysid --arm %s" % (uri, side))
    rospy.init_node("baxter_sysid", anonymous=True, disable_signals=True)
    try:
        robot = parse_urdf(str(rospy.get_param("robot_description")), source="robot_description")
    except (KeyError, OSError, rospy.ROSException, UrdfError) as error:
        raise SysidError("robot_description on %s cannot be used: %s" % (uri, error)) from error
    space, arm = Space(robot), IdentifiedRosArm(side)
    if trouble := arm.next().trouble:
        raise SysidError(trouble)
    other, = set(SIDES) - {side}
    points = motion(side, seconds)
    way = straight(arm.posture(side), points[0])
    for part in (way, points):
        space.require_free(side, part, arm.posture(other))
    others = arm.others()
    hand = np.array([space.chains[side].fk(posture)[:3, 3] for posture in points[::10]])
    text = ("The %s arm of the robot at %s moves slowly to the pose 'neutral', then for %.0f s around it: its hand "
            "within %.2f x %.2f x %.2f m, no joint faster than %.1f rad/s.\nNobody may be within its reach, and a "
            "person holds the emergency stop. The robot's collision avoidance does not govern raw set-points, so the "
            "motion ends when it reports anything, at a collision, when the robot is disabled, and at Ctrl-C." % (
                side, uri, len(points) * PERIOD_S, *np.ptp(hand, axis=0),
                np.abs(np.diff(points, axis=0)).max() / PERIOD_S))
    if others:
        text += "\nMay also command this arm, and must not: %s" % ", ".join(others)
    if not agreed(text):
        raise SysidError("nobody agreed; the robot was not moved")
    return robot, record(arm, straight(arm.posture(side), points[0]), points, side)
