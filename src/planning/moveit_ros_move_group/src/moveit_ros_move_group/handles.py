# SPDX-License-Identifier: BSD-3-Clause
"""Handles of controllers: an action client each, or nothing where they are fake."""
from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
    JointTolerance,
)
from sensor_msgs.msg import JointState

from moveit_ros_move_group.controllers import FAKE, FOLLOW

if TYPE_CHECKING:
    from typing import TypeAlias

    from actionlib import ClientGoalHandle
    from control_msgs.msg import GripperCommandFeedback
    from trajectory_msgs.msg import JointTrajectory

    from moveit_ros_move_group.controllers import ControllerEntry

    Handle: TypeAlias = "FollowHandle | GripperHandle | FakeHandle"

# Polling period [s].
TICK_S = 0.01
# Between two joint states of a fake controller that interpolates, where its ``rate`` does not say [s].
_FAKE_STEP_S = 0.1
# A goal counts as begun only this long [s] afterwards: some servers say 0 until then, whatever the time.
_SINCE_S = 0.05

_FOLLOW_ERRORS = {value: name for name, value in vars(FollowJointTrajectoryResult).items()
                  if isinstance(value, int) and name.isupper()}
_STATUS_NAMES = {value: name for name, value in vars(GoalStatus).items() if isinstance(value, int) and name.isupper()}


class ControllerHandles:
    """A handle for each controller, made when it is first asked for; controllers of one action share it."""

    def __init__(self, controllers: Sequence[ControllerEntry], initial: Mapping[str, float] | None = None,
                 limits: Mapping[str, Sequence[float]] | None = None) -> None:
        """controllers: list of controllers.ControllerEntry. initial: {joint: value}, where fake controllers begin.
        limits: {joint: (lowest, highest)}, for grippers that are commanded in percent."""
        self._limits = limits or {}
        self._made: dict[str, Handle] = {}
        self._fake_states: rospy.Publisher | None = None
        if initial and any(controller.kind == FAKE for controller in controllers):
            self._fake_publisher().publish(_joint_state(initial.keys(), initial.values()))
        for controller in controllers:
            self.of(controller)

    def of(self, controller: ControllerEntry) -> Handle:
        key = controller.action or controller.name
        if key not in self._made:
            if controller.kind == FAKE:
                self._made[key] = FakeHandle(controller, self._fake_publisher())
            else:
                self._made[key] = (FollowHandle(controller) if controller.kind == FOLLOW
                                   else GripperHandle(controller, self._limits))
        return self._made[key]

    def _fake_publisher(self) -> rospy.Publisher:
        if self._fake_states is None:
            # Latched: a subscriber may connect later than the joints are published.
            self._fake_states = rospy.Publisher("~fake_controller_joint_states", JointState, queue_size=100, latch=True)
        return self._fake_states


_goals = itertools.count(1)


def goal_id() -> GoalID:
    """Return the id of a new goal in roscpp's form, which MoveIt's goals have: node, count, seconds.nanoseconds."""
    now = rospy.Time.now()
    return GoalID(stamp=now, id="%s-%d-%d.%d" % (rospy.get_caller_id(), next(_goals), now.secs, now.nsecs))


class _Goal:
    """One goal. handle: actionlib's once it is over; began: when, by the server's feedback [s, ROS time]."""

    def __init__(self) -> None:
        self.over, self.handle, self.began = threading.Event(), None, None

    def moved(self, handle: ClientGoalHandle) -> None:
        """The goal's state has changed; may come before send_goal returns, and again after the goal is over."""
        if handle.get_comm_state() == actionlib.CommState.DONE:
            self.handle = handle
            self.over.set()

    def told(self, handle: ClientGoalHandle,
             feedback: FollowJointTrajectoryFeedback | GripperCommandFeedback) -> None:
        """The goal's feedback has come."""
        if not isinstance(feedback, FollowJointTrajectoryFeedback):
            return
        since = feedback.desired.time_from_start.to_sec()
        if since > _SINCE_S:
            self.began = feedback.header.stamp.to_sec() - since


class _ActionHandle:
    """A controller that serves an action. Each goal has its own record: the late end of an older one ends no other."""

    def __init__(self, controller: ControllerEntry, action_type: type[rospy.Message]) -> None:
        self.controller = controller
        # Resolved: actionlib remaps the name as written, roscpp's version remaps the resolved name.
        self._client = actionlib.ActionClient(rospy.resolve_name(controller.action), action_type)
        self._client.manager._generate_id = goal_id  # rospy's ids end in milliseconds
        self._goal, self._open = _Goal(), []

    @property
    def done(self) -> threading.Event:
        """The Event that is set once the newest goal has ended."""
        return self._goal.over

    def connected(self, timeout_s: float, given_up: Callable[[], bool] = lambda: False) -> bool:
        """Whether the action's server exists; waits this long in wall time, or until ``given_up()``."""
        deadline = time.monotonic() + timeout_s
        client = self._client
        # actionlib's own waiting sleeps in ROS time, which may be paused.
        while not all(end.get_num_connections() for end in (client.pub_goal, client.pub_cancel, client.status_sub,
                                                            client.result_sub)):
            if time.monotonic() >= deadline or rospy.is_shutdown() or given_up():
                return False
            time.sleep(TICK_S)
        return True

    def send(self, trajectory: JointTrajectory) -> None:
        goal = self._goal = _Goal()
        self._open = [(sent, one) for sent, one in self._open if not one.over.is_set()]
        self._open.append((self._client.send_goal(self._goal_of(trajectory), goal.moved, goal.told), goal))

    def began(self) -> float | None:
        """ROS time [s] at which the newest goal began, None as long as its feedback has not told."""
        return self._goal.began

    def cancel(self) -> None:
        # A goal that was to take another's place may have been refused, and the other still run.
        for sent, goal in self._open:
            if not goal.over.is_set():
                sent.cancel()

    def was_preempted(self) -> bool:
        return self._status() in (GoalStatus.PREEMPTED, GoalStatus.RECALLED)

    def error(self) -> str:
        """The sentence what went wrong, empty where nothing has."""
        handle, status = self._goal.handle, self._status()
        if handle is None or status in (None, GoalStatus.SUCCEEDED):
            return ""
        return "controller %s ended with %s%s" % (self.controller, _STATUS_NAMES.get(status, status),
                                                  self._detail(handle))

    def _status(self) -> int | None:
        return self._goal.handle.get_terminal_state() if self._goal.handle is not None else None

    def _goal_of(self, trajectory: JointTrajectory) -> rospy.Message:
        raise NotImplementedError

    def _detail(self, handle: ClientGoalHandle) -> str:
        text = handle.get_goal_status_text()
        return ": %s" % text if text else ""


class FollowHandle(_ActionHandle):
    """FollowJointTrajectory."""

    def __init__(self, controller: ControllerEntry) -> None:
        super().__init__(controller, FollowJointTrajectoryAction)

    def _goal_of(self, trajectory: JointTrajectory) -> FollowJointTrajectoryGoal:
        goal, options = FollowJointTrajectoryGoal(trajectory=trajectory), self.controller.options
        goal.path_tolerance = tolerances_of(options.get("path_tolerance"), self.controller.joints)
        goal.goal_tolerance = tolerances_of(options.get("goal_tolerance"), self.controller.joints)
        if isinstance(options.get("goal_time_tolerance"), (int, float)):
            goal.goal_time_tolerance = rospy.Duration(options["goal_time_tolerance"])
        return goal

    def _detail(self, handle: ClientGoalHandle) -> str:
        result = handle.get_result()
        if result is None:
            return super()._detail(handle)
        name = _FOLLOW_ERRORS.get(result.error_code, str(result.error_code))
        text = result.error_string or handle.get_goal_status_text()
        return ", %s%s" % (name, ": %s" % text if text else "")


class GripperHandle(_ActionHandle):
    """GripperCommand: the last point's position is the command; with the option ``percent``, how much of the joint's
    range that is, 0 at its lower limit and 100 at its upper."""

    def __init__(self, controller: ControllerEntry, limits: Mapping[str, Sequence[float]]) -> None:
        super().__init__(controller, GripperCommandAction)
        self._limits = limits

    def _goal_of(self, trajectory: JointTrajectory) -> GripperCommandGoal:
        goal, options = GripperCommandGoal(), self.controller.options
        point = trajectory.points[-1]
        if options.get("parallel"):
            goal.command.position = sum(point.positions)
        else:
            name = options.get("command_joint", trajectory.joint_names[0])
            index = trajectory.joint_names.index(name) if name in trajectory.joint_names else 0
            goal.command.position = self._command(trajectory.joint_names[index], point.positions[index])
        effort = point.effort[0] if point.effort else options.get("max_effort", 0.0)
        goal.command.max_effort = float(effort)
        return goal

    def _command(self, joint: str, position: float) -> float:
        if not self.controller.options.get("percent") or joint not in self._limits:
            return position
        low, high = self._limits[joint]
        return min(100.0, max(0.0, 100.0 * (position - low) / (high - low)))

    def error(self) -> str:
        allowed = self.controller.options.get("allow_failure") and self._status() == GoalStatus.ABORTED
        return "" if allowed else super().error()


class FakeHandle:
    """A controller that moves nothing and says where the joints would be."""

    def __init__(self, controller: ControllerEntry, publisher: rospy.Publisher) -> None:
        self.controller, self.done = controller, threading.Event()
        self._publisher = publisher
        self._cancelled = threading.Event()
        # No playback says anything once the next one has begun.
        self._speaks = threading.Lock()
        rate = controller.options.get("rate")
        self._step = 1.0 / rate if isinstance(rate, (int, float)) and rate > 0.0 else _FAKE_STEP_S

    def connected(self, timeout_s: float, given_up: Callable[[], bool] | None = None) -> bool:
        return True

    def send(self, trajectory: JointTrajectory) -> None:
        # New events: the previous playback may still sleep, and must neither continue nor end this one.
        before = self._cancelled
        self.done, self._cancelled = threading.Event(), threading.Event()
        threading.Thread(target=self._play, args=(trajectory, self.done, self._cancelled, before), daemon=True).start()

    def began(self) -> None:
        return None

    def cancel(self) -> None:
        self._cancelled.set()

    def was_preempted(self) -> bool:
        return self._cancelled.is_set()

    def error(self) -> str:
        return ""

    def _play(self, trajectory: JointTrajectory, done: threading.Event, cancelled: threading.Event,
              before: threading.Event) -> None:
        """before: the Event that ends the previous playback, which goes on until the trajectory's stamp."""
        def over() -> bool:
            return cancelled.is_set() or rospy.is_shutdown()

        while rospy.get_rostime() < trajectory.header.stamp and not over():
            time.sleep(TICK_S)
        with self._speaks:
            before.set()
        kind = self.controller.options["type"]
        if kind == "interpolate":
            self._interpolate(trajectory, over)
        else:
            begin = rospy.get_time()
            for point in trajectory.points[-1:] if kind == "last point" else trajectory.points:
                wait = point.time_from_start.to_sec() if kind == "via points" else 0.0
                while rospy.get_time() - begin < wait and not over():
                    time.sleep(TICK_S)
                if over():
                    break
                self._say(trajectory.joint_names, point.positions, over)
        done.set()

    def _interpolate(self, trajectory: JointTrajectory, over: Callable[[], bool]) -> None:
        points, begin = trajectory.points, rospy.get_time()
        while not over():
            now = rospy.get_time() - begin
            after = next((i for i, point in enumerate(points) if point.time_from_start.to_sec() > now), len(points))
            if after == len(points):
                self._say(trajectory.joint_names, points[-1].positions, over)
                return
            if after > 0:
                a, b = points[after - 1], points[after]
                share = (now - a.time_from_start.to_sec()) / (b.time_from_start - a.time_from_start).to_sec()
                self._say(trajectory.joint_names, [p + share * (q - p)
                                                   for p, q in zip(a.positions, b.positions, strict=True)], over)
            time.sleep(self._step)

    def _say(self, names: Sequence[str], positions: Sequence[float], over: Callable[[], bool]) -> None:
        with self._speaks:
            if not over():
                self._publisher.publish(_joint_state(names, positions))


def _joint_state(names: Iterable[str], positions: Iterable[float]) -> JointState:
    message = JointState(name=list(names), position=list(positions))
    message.header.stamp = rospy.Time.now()
    return message


def tolerances_of(value: object, joints: Sequence[str]) -> list[JointTolerance]:
    """Return the JointTolerances of a controller_list's path_tolerance or goal_tolerance.

    A map {position|velocity|acceleration: number, list or {joint: number}}, or a list of {name, position, ...}.
    """
    fields = ("position", "velocity", "acceleration")
    tolerances = {joint: JointTolerance(name=joint) for joint in joints}
    if isinstance(value, dict):
        for key in fields:
            given = value.get(key)
            for i, joint in enumerate(joints):
                number = given.get(joint) if isinstance(given, dict) else given
                if isinstance(given, list):
                    number = given[i] if i < len(given) else None
                if isinstance(number, (int, float)):
                    setattr(tolerances[joint], key, float(number))
    elif isinstance(value, list):
        for entry in value:
            if isinstance(entry, dict) and entry.get("name") in tolerances:
                for key in fields:
                    if isinstance(entry.get(key), (int, float)):
                        setattr(tolerances[entry["name"]], key, float(entry[key]))
    else:
        return []
    return list(tolerances.values())
