# SPDX-License-Identifier: BSD-3-Clause
"""Has controllers follow trajectories, watches them, stops them."""
from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import rospy
from moveit_msgs.msg import MoveItErrorCodes
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from command_line.options import counted
from moveit_ros_move_group.controllers import NoControllers, allowed_duration, choose, start_deviation
from moveit_ros_move_group.handles import TICK_S
from moveit_ros_move_group.rest_of_the_way import LATER_S, NewWay

if TYPE_CHECKING:
    from moveit_msgs.msg import RobotTrajectory

    from moveit_ros_move_group.controllers import ControllerEntry
    from moveit_ros_move_group.handles import Handle
    from moveit_ros_move_group.monitor import SceneMonitor

# Time limits [s] for a cancelled controller to report it, for the joints to come to rest, and for the first joint state
# (MoveIt waits as long).
_CANCEL_S = 0.2
_REST_S = 1.0
_FIRST_STATE_S = 1.0
_RESTING_STATES = 3
# A controller whose action has been away for so long is not waited for [s, wall time: the simulation's may have ended].
_AWAY_S = 5.0
_INVALIDATED = MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE


class StartTolerances(dict[str, float]):
    """Tolerances of some joints, and one for all others."""

    def __init__(self, usual: float, by_joint: Mapping[str, float]) -> None:
        super().__init__(by_joint)
        self._usual = usual

    def get(self, name: str, default: float | None = None) -> float:
        return super().get(name, self._usual)


@dataclass
class ExecutionSettings:
    """``~trajectory_execution``: monitored: a limit on time is kept; scaling and margin [s] make it. start_tolerance:
    [rad or m], or by joint. wait_for_rest: whether execution ends only when the joints are at rest. connection_timeout
    [s]."""

    monitored: bool = True
    scaling: float = 1.1
    margin: float = 0.5
    start_tolerance: float | dict[str, float] = 0.01
    wait_for_rest: bool = True
    connection_timeout: float = 15.0

    @property
    def usual_start_tolerance(self) -> float:
        """That of joints without one of their own."""
        tolerance = self.start_tolerance
        return tolerance.get("", 0.0) if isinstance(tolerance, dict) else tolerance

    def allow_at_start(self, tolerance: float) -> None:
        """Put ``tolerance`` [rad or m] in the place of that of joints without one of their own."""
        own = self.start_tolerance
        self.start_tolerance = StartTolerances(tolerance, own) if isinstance(own, dict) else tolerance


@dataclass
class ExecutionOutcome:
    """How an execution ended: a value of MoveItErrorCodes, and the reason if it failed."""

    code: int
    text: str = ""
    joints: dict[str, float] = field(default_factory=dict)


class Executor:
    """One execution at a time. settings: ExecutionSettings, which may be changed."""

    def __init__(self, controllers: Callable[[], list[ControllerEntry]], settings: ExecutionSettings,
                 monitor: SceneMonitor, handle_of: Callable[[ControllerEntry], Handle]) -> None:
        """controllers(): list of controllers.ControllerEntry at present; may raise NoControllers.
        handle_of(controller): how it is spoken to, as handles.ControllerHandles.of."""
        self._controllers, self.settings, self._monitor = controllers, settings, monitor
        self._handle_of = handle_of
        self._busy = threading.Lock()
        self._stop = threading.Event()
        self._followed_by: list[Handle] = []

    def began(self) -> float | None:
        """ROS time [s] at which the trajectory that is being executed began, by the word of its controllers; None as
        long as they do not say."""
        return max((began for handle in self._followed_by if (began := handle.began()) is not None), default=None)

    def stop(self) -> None:
        """End what is being executed, if anything is."""
        self._stop.set()

    def execute(self, message: RobotTrajectory, preempted: Callable[[], bool] = lambda: False,
                invalidated: Callable[[], str | NewWay | None] = lambda: None,
                from_anywhere: bool = False) -> ExecutionOutcome:
        """Follow a RobotTrajectory to its end; return an ExecutionOutcome.

        preempted(): whether the caller wants to stop it; invalidated(): None, the reason why the rest of the path is no
        longer free, which ends the motion at once, or a NewWay, which is followed instead, until the joints rest if it
        is one that stops. Both are called every few milliseconds. from_anywhere: the first point need not be near the
        joints' positions, as for a hand with an object between its fingers.
        """
        trajectory = message.joint_trajectory
        if not trajectory.points:
            if message.multi_dof_joint_trajectory.points:
                return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED, "no controller moves the multi-DOF joints %s"
                                        % ", ".join(message.multi_dof_joint_trajectory.joint_names))
            return ExecutionOutcome(MoveItErrorCodes.SUCCESS)
        flaw = _flaw(trajectory)
        if flaw:
            return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED, flaw)
        if not self._busy.acquire(blocking=False):
            return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED,
                                    "another trajectory is being executed; wait or stop it first")
        self._stop.clear()
        try:
            return self._follow(trajectory, preempted, invalidated, from_anywhere)
        except NoControllers as error:
            return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED, str(error))
        finally:
            self._busy.release()

    def why_not(self, joints: Sequence[str]) -> str | None:
        """None where there are controllers for all ``joints``, else the sentence that names what is missing."""
        try:
            choose(self._controllers(), joints)
        except NoControllers as error:
            return str(error)
        return None

    def silent(self, timeout_s: float) -> list[ControllerEntry]:
        """Return the Controllers whose actions do not answer within ``timeout_s`` [s, wall time] in all."""
        deadline = time.monotonic() + timeout_s
        return [controller for controller in self._controllers()
                if not self._handle_of(controller).connected(max(0.0, deadline - time.monotonic()))]

    def _follow(self, trajectory: JointTrajectory, preempted: Callable[[], bool],
                invalidated: Callable[[], str | NewWay | None], from_anywhere: bool) -> ExecutionOutcome:
        def given_up() -> bool:
            return self._stop.is_set() or preempted()

        chosen = choose(self._controllers(), trajectory.joint_names, self._is_alive)
        flaw = None if from_anywhere else self._flaw_of_start(trajectory, given_up)
        if flaw is not None:
            return flaw
        handles = self._followed_by = [self._handle_of(controller) for controller in chosen]
        for controller, handle in zip(chosen, handles, strict=True):
            if not handle.connected(self.settings.connection_timeout, given_up):
                if given_up():
                    return ExecutionOutcome(MoveItErrorCodes.PREEMPTED, "stopped on request")
                return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED,
                                        "Action client not connected: %s does not answer; %s"
                                        % (controller, controller.remedy))
        try:
            _send(trajectory, chosen, handles)
            return self._watch(trajectory, chosen, handles, preempted, invalidated)
        except Exception:  # no motion may continue unsupervised
            for handle in handles:
                handle.cancel()
            raise

    def _flaw_of_start(self, trajectory: JointTrajectory, given_up: Callable[[], bool]) -> ExecutionOutcome | None:
        """An ExecutionOutcome where the joints are not where the trajectory starts, or do not say where they are; else
        None."""
        tolerance, names = self.settings.start_tolerance, trajectory.joint_names
        checked = [name for name, limit in zip(names, self._limits(names), strict=True) if limit > 0.0]
        # The first execution may be asked for before the first joint state has come.
        silent = self._monitor.wait_for_state(rospy.Time(), _FIRST_STATE_S, checked, given_up)
        if silent:
            return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED, "Failed to validate trajectory: %s" % silent)
        off = start_deviation(names, trajectory.points[0].positions, self._monitor.joint_values(), tolerance,
                              self._monitor.continuous)
        if off is None:
            return None
        return ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED,
                                "Invalid Trajectory: start point deviates from current robot state more than the "
                                "allowed start "
                                "tolerance: joint '%s' by %.4g; plan again from the current state" % off, dict([off]))

    def _watch(self, trajectory: JointTrajectory, chosen: Sequence[ControllerEntry], handles: Sequence[Handle],
               preempted: Callable[[], bool], invalidated: Callable[[], str | NewWay | None]) -> ExecutionOutcome:
        duration = trajectory.points[-1].time_from_start.to_sec()
        allowed = allowed_duration(duration, chosen, self.settings.scaling, self.settings.margin)
        begin, stops, answered = rospy.get_time(), "", time.monotonic()
        # If time is set back, as by a reset of the simulation, nothing ends; the limit starts again.
        while True:
            running = [handle for handle in handles if not handle.done.is_set()]
            if not running:
                break
            running[0].done.wait(TICK_S)
            now = rospy.get_time()
            begin = min(begin, now + LATER_S)
            if rospy.is_shutdown() or self._stop.is_set() or preempted():
                return self._cancel(handles, MoveItErrorCodes.PREEMPTED, "stopped on request")
            change = invalidated()
            if isinstance(change, NewWay):
                trajectory, begin, stops = change.trajectory.joint_trajectory, change.begins, change.stops
                duration = trajectory.points[-1].time_from_start.to_sec()
                allowed = allowed_duration(duration, chosen, self.settings.scaling, self.settings.margin)
                _send(trajectory, chosen, handles)
            elif change:
                outcome = self._cancel(handles, _INVALIDATED, change)
                # Who plans again begins where the joints rest.
                self._wait_for_rest(trajectory.joint_names, preempted)
                return outcome
            away = [one for one, handle in zip(chosen, handles, strict=True)
                    if not handle.done.is_set() and not handle.connected(0.0)]
            answered = answered if away else time.monotonic()
            failed = _failed(handles)
            if failed is None and time.monotonic() - answered > _AWAY_S:
                failed = ExecutionOutcome(MoveItErrorCodes.CONTROL_FAILED, "%s has ended while it moved the arm; %s"
                                          % (away[0], away[0].remedy))
            elif failed is None and self.settings.monitored and now - begin > allowed:
                failed = ExecutionOutcome(MoveItErrorCodes.TIMED_OUT, "%s did not end within %.2f s (%.2f s planned)"
                                          % (", ".join(map(str, chosen)), allowed, duration))
            if failed is not None:
                return self._cancel(handles, failed.code, failed.text) if not stops else self._cancel(
                    handles, _INVALIDATED, "%s; %s" % (stops, failed.text))
        failed = _failed(handles)
        if failed is not None and not stops:
            return failed
        if stops or self.settings.wait_for_rest:
            self._wait_for_rest(trajectory.joint_names, preempted)
        return ExecutionOutcome(_INVALIDATED, stops) if stops else ExecutionOutcome(MoveItErrorCodes.SUCCESS)

    def _cancel(self, handles: Sequence[Handle], code: int, text: str) -> ExecutionOutcome:
        for handle in handles:
            handle.cancel()
        deadline = time.monotonic() + _CANCEL_S
        for handle in handles:
            handle.done.wait(max(0.0, deadline - time.monotonic()))
        return ExecutionOutcome(code, text)

    def _wait_for_rest(self, names: Sequence[str], preempted: Callable[[], bool]) -> None:
        """Until three joint states in a row agree within the start tolerance."""
        limits = self._limits(names)
        deadline, before, same, number = time.monotonic() + _REST_S, None, 0, -1
        while time.monotonic() < deadline and not rospy.is_shutdown() and not self._stop.is_set() and not preempted():
            count, values = self._monitor.joint_update()
            if count == number:
                time.sleep(TICK_S)
                continue
            number, now = count, [values.get(name, math.nan) for name in names]
            if before is not None:
                still = all(limit <= 0.0 or abs(a - b) <= limit
                            for a, b, limit in zip(now, before, limits, strict=True))
                same = same + 1 if still else 0
                if same >= _RESTING_STATES - 1:
                    return
            before = now

    def _limits(self, names: Sequence[str]) -> list[float]:
        """The start tolerance of each joint [rad or m]; 0 where it is not checked."""
        tolerance = self.settings.start_tolerance
        return [tolerance.get(name, 0.0) if isinstance(tolerance, dict) else tolerance for name in names]

    def _is_alive(self, controller: ControllerEntry) -> bool:
        return self._handle_of(controller).connected(0.0)


def _send(trajectory: JointTrajectory, chosen: Sequence[ControllerEntry], handles: Sequence[Handle]) -> None:
    for controller, handle in zip(chosen, handles, strict=True):
        handle.send(part_of(trajectory, controller.joints))


def _failed(handles: Sequence[Handle]) -> ExecutionOutcome | None:
    """The ExecutionOutcome of the first of those that have ended with an error, or None."""
    for handle in handles:
        if handle.done.is_set() and handle.error():
            code = MoveItErrorCodes.PREEMPTED if handle.was_preempted() else MoveItErrorCodes.CONTROL_FAILED
            return ExecutionOutcome(code, handle.error())
    return None


def part_of(trajectory: JointTrajectory, joints: Container[str]) -> JointTrajectory:
    """Return the JointTrajectory of those of its joints that are among ``joints``."""
    keep = [i for i, name in enumerate(trajectory.joint_names) if name in joints]
    if len(keep) == len(trajectory.joint_names):
        return trajectory

    def pick(values: Sequence[float]) -> list[float]:
        return [values[i] for i in keep] if values else []

    part = JointTrajectory(header=trajectory.header, joint_names=[trajectory.joint_names[i] for i in keep])
    part.points = [JointTrajectoryPoint(pick(point.positions), pick(point.velocities), pick(point.accelerations),
                                        pick(point.effort), point.time_from_start) for point in trajectory.points]
    return part


def _flaw(trajectory: JointTrajectory) -> str:
    """The sentence why a JointTrajectory cannot be executed, or an empty one."""
    count, last = len(trajectory.joint_names), -1.0
    if not count or len(set(trajectory.joint_names)) != count:
        return "the trajectory's joint names are %s; each joint has to be there once" % (
            ", ".join(trajectory.joint_names) or "missing")
    for i, point in enumerate(trajectory.points, 1):
        if len(point.positions) != count:
            return "point %d of the trajectory has %s for %s" % (i, counted(len(point.positions), "position"),
                                                                 counted(count, "joint"))
        for name, one in (("velocities", "velocity"), ("accelerations", "acceleration"), ("effort", "effort")):
            given = len(getattr(point, name))
            if given not in (0, count):
                return "point %d of the trajectory has %s for %s" % (i, counted(given, one, name),
                                                                     counted(count, "joint"))
        numbers = (*point.positions, *point.velocities, *point.accelerations, *point.effort)
        if not all(map(math.isfinite, numbers)):
            return "point %d of the trajectory holds a number that is not finite" % i
        now = point.time_from_start.to_sec()
        if now <= last:
            return "point %d of the trajectory is at %.6g s, the one before it at %.6g s; times have to grow" % (
                i, now, last)
        last = now
    return ""
