# SPDX-License-Identifier: BSD-3-Clause
"""Has controllers follow trajectories, watches them, stops them."""
import math
import threading
import time
from dataclasses import dataclass, field

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
    JointTolerance,
)
from moveit_msgs.msg import MoveItErrorCodes
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from moveit_ros_move_group.controllers import (
    FAKE,
    FOLLOW,
    ControllerError,
    allowed_duration,
    choose,
    start_deviation,
)

# How often [s] a running execution is looked at.
_TICK_S = 0.01
# How long [s] a cancelled controller may take to say so, and the joints to come to rest.
_CANCEL_S = 0.2
_REST_S = 1.0
_RESTING_STATES = 3

_FOLLOW_ERRORS = {value: name for name, value in vars(FollowJointTrajectoryResult).items()
                  if isinstance(value, int) and name.isupper()}
_STATUS_NAMES = {value: name for name, value in vars(GoalStatus).items() if isinstance(value, int) and name.isupper()}


@dataclass
class ExecutionSettings:
    """``~trajectory_execution``: monitored: a limit on time is kept; scaling and margin [s] make it. start_tolerance:
    [rad or m], or by joint. wait_for_rest: the end is waited for until the joints rest. connection_timeout [s]."""

    monitored: bool = True
    scaling: float = 1.1
    margin: float = 0.5
    start_tolerance: object = 0.01
    wait_for_rest: bool = True
    connection_timeout: float = 15.0
    velocity_scaling: float = 1.0


@dataclass
class Outcome:
    """How an execution ended: a value of MoveItErrorCodes, and the sentence why where it is no success."""

    code: int
    text: str = ""
    joints: dict = field(default_factory=dict)


class Executor:
    """One execution at a time. monitor: gives the joints' values (SceneMonitor)."""

    def __init__(self, controllers, settings, monitor, initial=None):
        """controllers: list of controllers.Controller. initial: {joint: value}, where fake controllers begin."""
        self._controllers, self._settings, self._monitor = controllers, settings, monitor
        self._handles = {}
        self._busy = threading.Lock()
        self._stop = threading.Event()
        self._fake_states = None
        if any(controller.kind == FAKE for controller in controllers):
            # Latched: who shows the joints may come later than they are said to be somewhere.
            self._fake_states = rospy.Publisher("~fake_controller_joint_states", JointState, queue_size=100, latch=True)
            if initial:
                self._fake_states.publish(_joint_state(initial.keys(), initial.values()))
        for controller in controllers:
            self._handle(controller)

    def stop(self):
        """End what is being executed, if anything is."""
        self._stop.set()

    def execute(self, message, preempted=lambda: False, invalidated=lambda: None):
        """Follow a RobotTrajectory to its end; return an Outcome.

        preempted(): whether the caller wants it to end; invalidated(): None, or the sentence why the rest of the way is
        no longer free. Both are asked every few milliseconds.
        """
        trajectory = message.joint_trajectory
        if not trajectory.points:
            if message.multi_dof_joint_trajectory.points:
                return Outcome(MoveItErrorCodes.CONTROL_FAILED, "no controller moves the multi-DOF joints %s"
                               % ", ".join(message.multi_dof_joint_trajectory.joint_names))
            return Outcome(MoveItErrorCodes.SUCCESS)
        flaw = _flaw(trajectory)
        if flaw:
            return Outcome(MoveItErrorCodes.INVALID_MOTION_PLAN, flaw)
        if not self._busy.acquire(blocking=False):
            return Outcome(MoveItErrorCodes.CONTROL_FAILED,
                           "another trajectory is being executed; wait or stop it first")
        self._stop.clear()
        try:
            return self._follow(trajectory, preempted, invalidated)
        except ControllerError as error:
            return Outcome(MoveItErrorCodes.CONTROL_FAILED, str(error))
        finally:
            self._busy.release()

    def _follow(self, trajectory, preempted, invalidated):
        chosen = choose(self._controllers, trajectory.joint_names, self._is_alive)
        off = start_deviation(trajectory.joint_names, trajectory.points[0].positions, self._monitor.joint_values(),
                              self._settings.start_tolerance, self._monitor.continuous)
        if off:
            return Outcome(MoveItErrorCodes.CONTROL_FAILED,
                           "Invalid Trajectory: start point deviates from current robot state more than the allowed "
                           "start tolerance: joint '%s' by %.4g; plan again from the current state" % off, dict([off]))
        handles = []
        for controller in chosen:
            handle = self._handle(controller)
            if not handle.connected(self._settings.connection_timeout):
                return Outcome(MoveItErrorCodes.CONTROL_FAILED, "Action client not connected: %s does not answer; is "
                               "the controller running, and is its name in controller_list right?" % controller)
            handles.append(handle)
        for controller, handle in zip(chosen, handles, strict=True):
            handle.send(part_of(trajectory, controller.joints))
        return self._watch(trajectory, chosen, handles, preempted, invalidated)

    def _watch(self, trajectory, chosen, handles, preempted, invalidated):
        duration = trajectory.points[-1].time_from_start.to_sec()
        allowed = allowed_duration(duration, chosen, self._settings.scaling, self._settings.margin)
        begin = rospy.get_time()
        # Time that has been set back, as by a reset of the simulation, ends nothing; the limit starts anew.
        while True:
            running = [handle for handle in handles if not handle.done.is_set()]
            if not running:
                break
            running[0].done.wait(_TICK_S)
            now = rospy.get_time()
            begin = min(begin, now)
            if rospy.is_shutdown() or self._stop.is_set() or preempted():
                return self._cancel(handles, MoveItErrorCodes.PREEMPTED, "stopped on request")
            reason = invalidated()
            if reason:
                return self._cancel(handles, MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE, reason)
            failed = next((handle for handle in handles if handle.done.is_set() and handle.error()), None)
            if failed is not None:
                return self._cancel(handles, MoveItErrorCodes.CONTROL_FAILED, failed.error())
            if self._settings.monitored and now - begin > allowed:
                return self._cancel(handles, MoveItErrorCodes.TIMED_OUT, "%s did not end within %.2f s (%.2f s planned)"
                                    % (", ".join(map(str, chosen)), allowed, duration))
        for handle in handles:
            if handle.error():
                code = MoveItErrorCodes.PREEMPTED if handle.was_preempted() else MoveItErrorCodes.CONTROL_FAILED
                return Outcome(code, handle.error())
        if self._settings.wait_for_rest:
            self._wait_for_rest(trajectory.joint_names, preempted)
        return Outcome(MoveItErrorCodes.SUCCESS)

    def _cancel(self, handles, code, text):
        for handle in handles:
            handle.cancel()
        deadline = time.monotonic() + _CANCEL_S
        for handle in handles:
            handle.done.wait(max(0.0, deadline - time.monotonic()))
        return Outcome(code, text)

    def _wait_for_rest(self, names, preempted):
        """Until three joint states in a row agree within the start tolerance."""
        tolerance = self._settings.start_tolerance
        limits = [tolerance.get(name, 0.0) if isinstance(tolerance, dict) else tolerance for name in names]
        deadline, before, same, number = time.monotonic() + _REST_S, None, 0, -1
        while time.monotonic() < deadline and not rospy.is_shutdown() and not self._stop.is_set() and not preempted():
            count, values = self._monitor.joint_update()
            if count == number:
                time.sleep(_TICK_S)
                continue
            number, now = count, [values.get(name, math.nan) for name in names]
            if before is not None:
                still = all(limit <= 0.0 or abs(a - b) <= limit
                            for a, b, limit in zip(now, before, limits, strict=True))
                same = same + 1 if still else 0
                if same >= _RESTING_STATES - 1:
                    return
            before = now

    def _is_alive(self, controller):
        return self._handle(controller).connected(0.0)

    def _handle(self, controller):
        key = controller.action or controller.name
        if key not in self._handles:
            if controller.kind == FAKE:
                self._handles[key] = FakeHandle(controller, self._fake_states, self._monitor)
            elif controller.kind == FOLLOW:
                self._handles[key] = FollowHandle(controller)
            else:
                self._handles[key] = GripperHandle(controller)
        return self._handles[key]


class _ActionHandle:
    """A controller that serves an action. done: set once it has ended."""

    def __init__(self, controller, action_type):
        self.controller, self.done = controller, threading.Event()
        self._client = actionlib.ActionClient(controller.action, action_type)
        self._sent, self._ended = None, None  # goal handles: of the newest goal, and of the newest that is over

    def connected(self, timeout_s):
        """Whether the action's server is there; waited for so long in wall time."""
        deadline = time.monotonic() + timeout_s
        client = self._client
        # actionlib's own waiting sleeps in ROS time, which may stand still.
        while not all(end.get_num_connections() for end in (client.pub_goal, client.pub_cancel, client.status_sub,
                                                            client.result_sub)):
            if time.monotonic() >= deadline or rospy.is_shutdown():
                return False
            time.sleep(_TICK_S)
        return True

    def send(self, trajectory):
        before, self._sent, self._ended = self._sent, None, None
        self.done.clear()

        def moved(handle):
            # It may be called before send_goal returns, and once more for a goal that is over.
            if handle != before and handle.get_comm_state() == actionlib.CommState.DONE:
                self._ended = handle
                self.done.set()

        self._sent = self._client.send_goal(self._goal(trajectory), moved)

    def cancel(self):
        if self._sent is not None:
            self._sent.cancel()

    def was_preempted(self):
        return self._status() in (GoalStatus.PREEMPTED, GoalStatus.RECALLED)

    def error(self):
        """The sentence what went wrong, empty where nothing has."""
        status = self._status()
        if status in (None, GoalStatus.SUCCEEDED):
            return ""
        return "controller %s ended with %s%s" % (self.controller, _STATUS_NAMES.get(status, status), self._detail())

    def _status(self):
        return self._ended.get_terminal_state() if self._ended is not None else None

    def _goal(self, trajectory):
        raise NotImplementedError

    def _detail(self):
        text = self._ended.get_goal_status_text()
        return ": %s" % text if text else ""


class FollowHandle(_ActionHandle):
    """FollowJointTrajectory."""

    def __init__(self, controller):
        super().__init__(controller, FollowJointTrajectoryAction)

    def _goal(self, trajectory):
        goal, options = FollowJointTrajectoryGoal(trajectory=trajectory), self.controller.options
        goal.path_tolerance = tolerances_of(options.get("path_tolerance"), self.controller.joints)
        goal.goal_tolerance = tolerances_of(options.get("goal_tolerance"), self.controller.joints)
        if isinstance(options.get("goal_time_tolerance"), (int, float)):
            goal.goal_time_tolerance = rospy.Duration(options["goal_time_tolerance"])
        return goal

    def _detail(self):
        result = self._ended.get_result()
        if result is None:
            return super()._detail()
        name = _FOLLOW_ERRORS.get(result.error_code, str(result.error_code))
        text = result.error_string or self._ended.get_goal_status_text()
        return ", %s%s" % (name, ": %s" % text if text else "")


class GripperHandle(_ActionHandle):
    """GripperCommand: the last point's position is the command."""

    def __init__(self, controller):
        super().__init__(controller, GripperCommandAction)

    def _goal(self, trajectory):
        goal, options = GripperCommandGoal(), self.controller.options
        point = trajectory.points[-1]
        if options.get("parallel"):
            goal.command.position = sum(point.positions)
        else:
            name = options.get("command_joint", trajectory.joint_names[0])
            index = trajectory.joint_names.index(name) if name in trajectory.joint_names else 0
            goal.command.position = point.positions[index]
        effort = point.effort[0] if point.effort else options.get("max_effort", 0.0)
        goal.command.max_effort = float(effort)
        return goal

    def error(self):
        allowed = self.controller.options.get("allow_failure") and self._status() == GoalStatus.ABORTED
        return "" if allowed else super().error()


class FakeHandle:
    """A controller that moves nothing and says where the joints would be."""

    def __init__(self, controller, publisher, monitor):
        self.controller, self.done = controller, threading.Event()
        self._publisher, self._monitor = publisher, monitor
        self._cancelled = threading.Event()

    def connected(self, timeout_s):
        return True

    def send(self, trajectory):
        self.done.clear()
        self._cancelled.clear()
        threading.Thread(target=self._play, args=(trajectory,), daemon=True).start()

    def cancel(self):
        self._cancelled.set()

    def was_preempted(self):
        return self._cancelled.is_set()

    def error(self):
        return ""

    def _play(self, trajectory):
        kind = self.controller.options["type"]
        points = trajectory.points[-1:] if kind == "last point" else trajectory.points
        if kind == "interpolate":
            self._interpolate(trajectory)
        else:
            begin = rospy.get_time()
            for point in points:
                wait = point.time_from_start.to_sec() if kind == "via points" else 0.0
                while rospy.get_time() - begin < wait and not self._over():
                    time.sleep(_TICK_S)
                if self._over():
                    break
                self._say(trajectory.joint_names, point.positions)
        self.done.set()

    def _interpolate(self, trajectory):
        points, begin = trajectory.points, rospy.get_time()
        step = 1.0 / float(self.controller.options.get("rate", 10.0) or 10.0)
        while not self._over():
            now = rospy.get_time() - begin
            after = next((i for i, point in enumerate(points) if point.time_from_start.to_sec() > now), len(points))
            if after == len(points):
                self._say(trajectory.joint_names, points[-1].positions)
                return
            if after == 0:
                self._say(trajectory.joint_names, points[0].positions)
            else:
                a, b = points[after - 1], points[after]
                share = (now - a.time_from_start.to_sec()) / (b.time_from_start - a.time_from_start).to_sec()
                self._say(trajectory.joint_names, [p + share * (q - p)
                                                   for p, q in zip(a.positions, b.positions, strict=True)])
            time.sleep(step)

    def _over(self):
        return self._cancelled.is_set() or rospy.is_shutdown()

    def _say(self, names, positions):
        self._publisher.publish(_joint_state(names, positions))


def _joint_state(names, positions):
    message = JointState(name=list(names), position=list(positions))
    message.header.stamp = rospy.Time.now()
    return message


def part_of(trajectory, joints):
    """Return the JointTrajectory of those of its joints that are among ``joints``."""
    keep = [i for i, name in enumerate(trajectory.joint_names) if name in joints]
    if len(keep) == len(trajectory.joint_names):
        return trajectory

    def pick(values):
        return [values[i] for i in keep] if values else []

    part = JointTrajectory(header=trajectory.header, joint_names=[trajectory.joint_names[i] for i in keep])
    part.points = [JointTrajectoryPoint(pick(point.positions), pick(point.velocities), pick(point.accelerations),
                                        pick(point.effort), point.time_from_start) for point in trajectory.points]
    return part


def tolerances_of(value, joints):
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


def _flaw(trajectory):
    """The sentence why a JointTrajectory cannot be executed, or an empty one."""
    count, last = len(trajectory.joint_names), -1.0
    if not count or len(set(trajectory.joint_names)) != count:
        return "the trajectory's joint names are %s; each joint has to be there once" % (
            ", ".join(trajectory.joint_names) or "missing")
    for i, point in enumerate(trajectory.points, 1):
        if len(point.positions) != count:
            return "point %d of the trajectory has %d positions for %d joints" % (i, len(point.positions), count)
        numbers = (*point.positions, *point.velocities, *point.accelerations)
        if not all(map(math.isfinite, numbers)):
            return "point %d of the trajectory holds a number that is not finite" % i
        now = point.time_from_start.to_sec()
        if now <= last:
            return "point %d of the trajectory is at %.6g s, the one before it at %.6g s; times have to grow" % (
                i, now, last)
        last = now
    return ""
