# SPDX-License-Identifier: BSD-3-Clause
"""One arm: its state, and commands to it."""
from __future__ import annotations

import collections
import copy
import importlib
import math
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, cast

import rospy
from baxter_core_msgs.msg import AssemblyState, EndpointState, JointCommand
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, Ticker, is_unlimited, require_timeout
from baxter_model import BASE_FRAME, poses
from baxter_model.readiness import why_not_ready
from command_line.options import counted

from . import settings, startup
from .hindrance import ArmHindrance, IgnoredCommands, newest
from .joint_checks import (
    beyond_a_turn,
    limb_joint_names,
    require_joint,
    require_joint_values,
    require_number,
    require_side,
)
from .joint_motion import Move, is_far
from .resets import PUT_ELSEWHERE, Resets
from .services import call_service

# Commands per second during a move; the robot's own time-out asks for more than 5.
COMMAND_RATE_HZ = 100.0
# Shortest time between two log lines for the same reason, where a program repeats its commands [s].
REPEAT_S = 5.0
# A commanded speed above this moves an arm [rad/s].
MIN_SPEED_RAD_S = 0.02
IK_REPORT = "/ExternalTools/%s/PositionKinematicsNode/IKReport"


class NoIKSolution(ValueError):
    """No joint angles put the end-point at the requested pose."""


class Limb:
    """One of the two arms, "left" or "right".

    Waits up to 30 s of wall time for a robot that is still starting. Angles are in rad, speeds in rad/s, torques in Nm,
    end-point poses in the frame `base`. The methods return copies.
    Raises UnknownNameError (a ValueError and a KeyError) for another name, OSError with errno ETIMEDOUT if the robot
    does not come up, rospy.ROSInitException before rospy.init_node.
    """

    Point = collections.namedtuple("Point", ["x", "y", "z"])
    Quaternion = collections.namedtuple("Quaternion", ["x", "y", "z", "w"])

    def __init__(self, limb: str) -> None:
        self.name = require_side(limb)
        self._joint_names = limb_joint_names(limb)
        self._lock = threading.Lock()
        self._angles, self._velocities, self._efforts = {}, {}, {}
        self._endpoint = cast("EndpointState", None)  # until the first one has come, for which the constructor waits
        self._robot_state: AssemblyState | None = None
        self._ignored, self._hindrance = IgnoredCommands(), ArmHindrance(limb)
        self._warned_at_s = {}

        prefix = "/robot/limb/%s/" % limb
        # Latched, so that a setting made right after construction still reaches the robot.
        self._speed_publisher = rospy.Publisher(prefix + "set_speed_ratio", Float64, latch=True, queue_size=10)
        self._timeout_publisher = rospy.Publisher(prefix + "joint_command_timeout", Float64, latch=True, queue_size=10)
        # The newest command is the only one that matters.
        self._command_publisher = rospy.Publisher(
            prefix + "joint_command", JointCommand, queue_size=1, tcp_nodelay=True)
        # Subscribe last: from here on callbacks run on another thread.
        self._resets = Resets()
        self._subscribers = [
            rospy.Subscriber("robot/state", AssemblyState, self._on_robot_state, queue_size=1),
            rospy.Subscriber(prefix + "endpoint_state", EndpointState, self._on_endpoint_state, queue_size=1,
                             tcp_nodelay=True),
            rospy.Subscriber("robot/joint_states", JointState, self._on_joint_states, queue_size=1, tcp_nodelay=True),
        ]
        try:
            startup.wait_for_start([
                startup.message_arrives(rospy.resolve_name("robot/joint_states"), self._has_joint_states),
                startup.message_arrives(prefix + "endpoint_state", lambda: self._endpoint is not None),
            ])
        except BaseException:
            self._unregister()
            raise
        startup.wait_for_subscribers(self._command_publisher)

    def joint_names(self) -> list[str]:
        """List the names of the seven joints from shoulder to wrist."""
        return list(self._joint_names)

    def joint_angle(self, joint: str) -> float:
        """Return one joint's angle [rad]. Raises UnknownNameError."""
        return self._reading(self._angles_by_name, joint)

    def joint_angles(self) -> dict[str, float]:
        """Return all joint angles as a dict of name to rad."""
        return self._angles_by_name()

    def joint_velocity(self, joint: str) -> float:
        """Return one joint's speed [rad/s]. Raises UnknownNameError."""
        return self._reading(self.joint_velocities, joint)

    def joint_velocities(self) -> dict[str, float]:
        """Return all joint speeds as a dict of name to rad/s."""
        with self._lock:
            return dict(self._velocities)

    def joint_effort(self, joint: str) -> float:
        """Return one joint's torque [Nm]. Raises UnknownNameError."""
        return self._reading(self.joint_efforts, joint)

    def joint_efforts(self) -> dict[str, float]:
        """Return all joint torques as a dict of name to Nm."""
        with self._lock:
            return dict(self._efforts)

    def endpoint_pose(self) -> dict[str, Any]:
        """Return the end-point's pose in `base`: {'position': Point [m], 'orientation': Quaternion}."""
        pose = self._endpoint_state().pose
        return {"position": self._point(pose.position),
                "orientation": self.Quaternion(*(getattr(pose.orientation, axis) for axis in "xyzw"))}

    def endpoint_velocity(self) -> dict[str, Any]:
        """Return the end-point's twist in `base`: {'linear': Point [m/s], 'angular': Point [rad/s]}."""
        twist = self._endpoint_state().twist
        return {"linear": self._point(twist.linear), "angular": self._point(twist.angular)}

    def endpoint_effort(self) -> dict[str, Any]:
        """Return the wrench at the end-point: {'force': Point [N], 'torque': Point [Nm]}."""
        wrench = self._endpoint_state().wrench
        return {"force": self._point(wrench.force), "torque": self._point(wrench.torque)}

    def set_command_timeout(self, timeout: float) -> None:
        """Set the time without commands after which the robot leaves velocity, torque and raw mode [s] (0.2 at
        start)."""
        self._timeout_publisher.publish(Float64(data=require_number(timeout, "the command time-out [s]")))

    def exit_control_mode(self, timeout: float = 0.2) -> None:
        """Go back to holding the present joint angles in position mode, with the command time-out `timeout` [s]."""
        self.set_command_timeout(timeout)
        self.set_joint_positions(self.joint_angles())

    def set_joint_position_speed(self, speed: float) -> None:
        """Scale the speed of position mode by `speed`, 0.0 to 1.0; the robot clips it and keeps it."""
        self._speed_publisher.publish(Float64(data=require_number(speed, "the speed ratio")))

    def set_joint_positions(self, positions: dict[str, float], raw: bool = False) -> None:
        """Command joint angles once, and return at once.

        Parameters:
            positions: dict of joint name to rad; joints left out keep their set-points.
            raw: bypass the robot's own smoothing and collision avoidance; the commands must be smooth then.
        Raises UnknownNameError, ValueError for a number that is not finite, TypeError for something that is not a dict.
        """
        mode = JointCommand.RAW_POSITION_MODE if raw else JointCommand.POSITION_MODE
        sent = self._command(mode, positions, "rad")
        if why := beyond_a_turn(sent):
            self._warn("limit", "%s. The robot goes to its limit" % why)
        if not raw:
            self._warn_if_hindered(is_far(self._angles_by_name(), sent))

    def set_joint_velocities(self, velocities: dict[str, float]) -> None:
        """Command joint speeds, a dict of name to rad/s; to be repeated within the command time-out. Raises the same
        errors."""
        sent = self._command(JointCommand.VELOCITY_MODE, velocities, "rad/s")
        self._warn_if_hindered(any(abs(speed) > MIN_SPEED_RAD_S for speed in sent.values()))

    def set_joint_torques(self, torques: dict[str, float]) -> None:
        """Command joint torques on top of gravity compensation, a dict of name to Nm; to be repeated. Raises the same
        errors."""
        self._command(JointCommand.TORQUE_MODE, torques, "Nm")

    def halt(self) -> None:
        """Stop the joints at any speed, and hold them there."""
        # A zero velocity command expires into position mode; it needs no known angles.
        self.set_joint_velocities(dict.fromkeys(self._joint_names, 0.0))

    @property
    def resets(self) -> int:
        """Number of resets of the simulation so far; a reset ends all moves."""
        return self._resets.count

    def move_to_neutral(self, timeout: float = 15.0) -> bool:
        """Move to the neutral pose and wait; `timeout` [s] and result as of move_to_joint_positions."""
        return self.move_to_joint_positions(poses().angles("neutral", self.name), timeout)

    def move_to_joint_positions(self, positions: dict[str, float], timeout: float = 15.0,
                                threshold: float = settings.JOINT_ANGLE_TOLERANCE,
                                test: Callable[[], bool] | None = None) -> bool:
        """Move smoothly to joint angles, in position mode, and wait until they are reached.

        Parameters:
            positions: dict of joint name to rad; joints left out keep their set-points.
            timeout: longest time for it [s, ROS time]; negative or infinite means for ever. With less time than a
                gentle move takes, 0 for example, the arm is commanded through the vendor's low-pass filter, and goes to
                the last command; such calls are repeated at about 100 Hz.
            threshold: error of each joint below which it has arrived [rad].
            test: called at every step; when it returns True the arm stops.
        Returns True on arrival: the exact target is commanded last and held. Returns False on time-out, when `test`
        stopped it, when the robot is not enabled, when its collision avoidance holds the arm, when its simulation was
        reset, when no joints were given, and when an angle is beyond a full turn (nothing moves then); one logged line
        has the reason and the joint with the largest error. Raises as set_joint_positions;
        rospy.ROSInterruptException when the node is shut down meanwhile.
        """
        target = require_joint_values(positions, self._joint_names, "rad")
        if not target:
            rospy.logerr("%s arm: no joints given: did IK find a solution? rostopic echo -n 1 %s says why not",
                         self.name, IK_REPORT % self.name)
            return False
        if why := beyond_a_turn(target):
            rospy.logerr("%s arm: %s", self.name, why)
            return False
        threshold, timeout = require_number(threshold, "the threshold [rad]"), require_timeout(timeout)

        resets = self.resets
        clock = RosClock(gives_up=lambda: rospy.is_shutdown() or self.resets != resets)
        watch, ticker = Stopwatch(clock.now()), Ticker(clock, COMMAND_RATE_HZ)
        move = Move(self.joint_angles(), target, None if is_unlimited(timeout) else timeout, threshold)
        if not move.is_hurried:
            self._hindrance.begin()
        while not rospy.is_shutdown():
            angles = self.joint_angles()
            hindrance = self._hindrance.look(clock.now(), is_far(angles, target), angles)
            step = move.step(watch.elapsed_s(clock.now()), angles, self.joint_velocities(),
                             refusal=self._refusal(), aborted=bool(callable(test) and test()),
                             interrupted=PUT_ELSEWHERE if self.resets != resets else "",
                             hindrance=hindrance)
            if step.command is not None:
                self._send(JointCommand.POSITION_MODE, step.command)
            elif step.halt:
                self.halt()
            if step.failure and move.is_hurried:
                self._warn("hindered" if hindrance.text else "hurried", step.failure)
            elif step.failure:
                rospy.logerr("%s arm: %s", self.name, step.failure)
            if step.is_last:
                if not move.is_hurried:
                    self._hindrance.close()
                return step.arrived
            ticker.sleep()
        raise rospy.ROSInterruptException("ROS shut down while the %s arm moved" % self.name)

    def ik(self, pose: Any, seed: Mapping[str, float] | None = None, timeout: float | None = None) -> Any:
        """Ask the robot for joint angles that put the end-point at `pose`; the arm does not move.

        Parameters:
            pose: what endpoint_pose() returns, geometry_msgs Pose or PoseStamped, or (position, orientation) as
                sequences x y z [m] and x y z w; in the frame `base` unless stamped with another.
            seed: dict of joint name to rad as the start of the search, for some or all joints (default: the present
            angles). timeout: longest wait for the service, and again for its answer [s, wall]; by default 10 and 30.
        Returns a dict of joint name to rad, as move_to_joint_positions takes it.
        Raises NoIKSolution (a ValueError); OSError with errno ETIMEDOUT if there is no service; ValueError, KeyError or
        TypeError for an invalid pose or seed.
        """
        target = _pose_stamped(pose)
        request = SolvePositionIKRequest(pose_stamp=[target])
        if seed is not None:
            seed = {**self.joint_angles(), **require_joint_values(seed, self._joint_names, "rad")}
            request.seed_angles = [JointState(name=list(seed), position=list(seed.values()))]
        name = "/ExternalTools/%s/PositionKinematicsNode/IKService" % self.name
        answer = call_service(name, SolvePositionIK, request, timeout_s=timeout)
        if not answer.result_type or answer.result_type[0] == answer.RESULT_INVALID:
            point, why = target.pose.position, self._why_no_solution(target)
            raise NoIKSolution("the %s arm has no solution for the end-point at x y z %.3f %.3f %.3f in %s with this "
                               "orientation%s; more: rostopic echo -n 1 %s"
                               % (self.name, point.x, point.y, point.z, target.header.frame_id, why and ": " + why,
                                  IK_REPORT % self.name))
        return dict(zip(answer.joints[0].name, answer.joints[0].position, strict=True))

    def _why_no_solution(self, target: PoseStamped) -> str:
        """The sentence in the IK service's report on `target`, "" where there is none, as on a physical robot."""
        report = newest(IK_REPORT % self.name, rospy.AnyMsg)
        if report is None:
            return ""
        package, name = report._connection_header["type"].split("/")
        try:
            verdicts = getattr(importlib.import_module(package + ".msg"), name)().deserialize(report._buff).verdicts
        except (ImportError, AttributeError):
            return ""
        return next((verdict.detail for verdict in verdicts if verdict.target == target), "")

    def _command(self, mode, values, unit: str):
        """Send one command; returns its values by joint name."""
        values = require_joint_values(values, self._joint_names, unit)
        if not values:
            self._warn("joints", "a command without joints is not sent")
            return values
        self._ignored.sent(time.monotonic())
        self._send(mode, values)
        return values

    def _send(self, mode, values) -> None:
        self._command_publisher.publish(
            JointCommand(mode=mode, names=list(values), command=list(values.values())))

    def _warn_if_hindered(self, is_far_from_goal) -> None:
        hindrance = self._hindrance.look(rospy.get_time(), is_far_from_goal, self._angles_by_name())
        if hindrance.text:
            self._warn("hindered", hindrance.text)

    def _warn(self, reason, text: str) -> None:
        """Log `text`, and the same `reason` again after REPEAT_S: programs repeat their commands."""
        now_s = time.monotonic()
        if now_s - self._warned_at_s.get(reason, -math.inf) >= REPEAT_S:
            self._warned_at_s[reason] = now_s
            rospy.logwarn("%s arm: %s", self.name, text)

    def _angles_by_name(self):
        with self._lock:
            return dict(self._angles)

    def _reading(self, read_all, joint: str) -> float:
        require_joint(joint, self._joint_names)
        return read_all()[joint]

    def _endpoint_state(self):
        with self._lock:
            return self._endpoint

    def _point(self, vector):
        return self.Point(vector.x, vector.y, vector.z)

    def _refusal(self):
        """Why the robot takes no commands, "" if it does, or has not reported yet."""
        with self._lock:
            return why_not_ready(self._robot_state) if self._robot_state is not None else ""

    def _has_joint_states(self) -> bool:
        with self._lock:
            return all(name in self._angles for name in self._joint_names)

    def _on_joint_states(self, message: Any) -> None:
        # Others may publish here too (a gripper's driver, a tool with positions only): take only this arm's joints.
        index = {name: i for i, name in enumerate(message.name)}
        indices = {name: index[name] for name in self._joint_names if name in index}
        with self._lock:
            for readings, values in ((self._angles, message.position), (self._velocities, message.velocity),
                                     (self._efforts, message.effort)):
                if len(values) == len(message.name):
                    readings.update((name, values[i]) for name, i in indices.items())

    def _on_endpoint_state(self, message: Any) -> None:
        with self._lock:
            self._endpoint = message

    def _on_robot_state(self, message: Any) -> None:
        with self._lock:
            self._robot_state = message
        if why := self._ignored.heard(time.monotonic(), why_not_ready(message)):
            self._warn("ignored", "a command has no effect: %s" % why)

    def _unregister(self) -> None:
        for end in (*self._subscribers, self._resets, self._speed_publisher, self._timeout_publisher,
                    self._command_publisher):
            end.unregister()


def _pose_stamped(pose: Any):
    """Return a pose in any of the forms that Limb.ik takes as a PoseStamped. Raises TypeError, ValueError."""
    if isinstance(pose, PoseStamped):
        stamped = copy.deepcopy(pose)
    elif isinstance(pose, Pose):
        stamped = PoseStamped(pose=pose)
    else:
        try:
            position, orientation = (pose["position"], pose["orientation"]) if isinstance(pose, dict) else pose
            stamped = PoseStamped(pose=Pose(_numbers(Point, position), _numbers(Quaternion, orientation)))
        except (KeyError, TypeError, ValueError) as error:
            raise type(error)("a pose is what endpoint_pose() returns, a Pose or PoseStamped, or a position x y z [m] "
                              "with an orientation x y z w, got %r" % (pose,)) from error
    stamped.header.frame_id = stamped.header.frame_id or BASE_FRAME
    for part in (stamped.pose.position, stamped.pose.orientation):
        for axis in part.__slots__:
            require_number(getattr(part, axis), "the pose's %s" % axis)
    return stamped


def _numbers(kind, values):
    if isinstance(values, kind):
        return values
    values = tuple(values)
    if len(values) != len(kind.__slots__):
        raise ValueError("%s where %d are due" % (counted(len(values), "number"), len(kind.__slots__)))
    return kind(*(require_number(value, "the pose's %s" % axis)
                  for axis, value in zip(kind.__slots__, values, strict=True)))
