# SPDX-License-Identifier: BSD-3-Clause
"""libfetch_gazebo_plugin.so as a model plugin of /gazebo: the controllers of robot_controllers on the model's joints.

Their names, parameters, topics and actions; the trajectories, the vehicle and the joint states are ros_controllers'.
"""
from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from control_msgs.msg import GripperCommandAction, GripperCommandFeedback, GripperCommandResult

from controller_manager import EFFORT, POSITION, VELOCITY, ControlError, Controller, ControllerContext, ControllerError
from controller_manager.pid import Gains, Pid
from gazebo_ros.model_plugin import ModelPlugin
from gazebo_ros_control.cascade import CarriedChain, CascadeHardware
from gazebo_ros_control.goal_controller import GoalController
from gazebo_ros_control.point_head import PointHead
from ros_controllers.diff_drive import DiffDriveController
from ros_controllers.joint_state import JointStateController
from ros_controllers.joint_trajectory_controller import JointTrajectoryController
from sim_time.pace import Pace

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext
    from loop_ros.action_server import GoalHandle
    from loop_ros.protocol import Log

#: The node whose private parameters name the controllers and the joints' gains, as Gazebo's node is called.
NODE = "/gazebo"
JOINT_STATES_HZ = 100.0
# Of robot_controllers' trajectory controller: position error allowed at a goal [rad, m], and for how long [s].
GOAL_POSITION, GOAL_TIME_S = 0.02, 0.6
# Of its gripper: what counts as reached [m]; less than a way [m] in a time [s] is a stall; rate of the feedback.
REACHED_M, STALL_M, STALL_S, FEEDBACK_HZ = 0.002, 0.005, 2.0, 50.0


class _Context(ControllerContext):
    """A controller's place whose topics and actions may have other names than ros_controllers'."""

    def __init__(self, name: str, host: PluginContext, parameters: Mapping[str, Any],
                 names: Mapping[str, str] | None = None) -> None:
        """``parameters``: the controller's own, nested; ``names``: {ros_controllers' name: absolute name}."""
        tree = parameters
        for part in reversed(name.split("/")):
            tree = {part: tree}
        super().__init__(name, host.namespace, tree, host.branch(), host.log, host.robot)
        self._names = names or {}

    def resolve(self, name: str) -> str:
        first, slash, rest = name.partition("/")
        return self._names[first] + slash + rest if first in self._names else super().resolve(name)


class _Follower(JointTrajectoryController):
    """robot_controllers/FollowJointTrajectoryController: a goal starts it."""

    interface = POSITION

    def __init__(self, name: str, hardware: CascadeHardware, context: ControllerContext, crew: _Crew) -> None:
        super().__init__(name, hardware, context)
        self._crew = crew

    @property
    def busy(self) -> bool:
        return self._follower.goal is not None

    def _on_goal(self, handle):
        refusal = None if self._runs else self._crew.start(self)
        if refusal is not None:
            self._reject(handle, refusal)
        else:
            super()._on_goal(handle)

    def _start_adapter(self):
        """The hardware has no command yet, and gets one in the next update."""

    def _write(self, dt):
        self.hardware.command[POSITION][self._index], self.hardware.command[VELOCITY][self._index] = self._next[:2]


class _Gripper(GoalController):
    """robot_controllers/ParallelGripperController: two fingers with a common effort, held in the middle.

    Parameters: ``l_gripper_joint``, ``r_gripper_joint``; ``max_position`` (0.1 m), ``max_effort`` (10 N);
    ``centering``, a PID from the difference of the fingers' positions to the difference of their efforts.
    """

    hardware: CascadeHardware

    def __init__(self, name: str, hardware: CascadeHardware, context: ControllerContext, crew: _Crew) -> None:
        super().__init__(name, hardware, context, crew)
        self._index = self.claim(POSITION, [context.param(side + "_gripper_joint", side + "_gripper_finger_joint")
                                            for side in ("l", "r")])
        self._most_m, self._most_n = context.number("max_position", 0.1), context.number("max_effort", 10.0)
        centering = context.param("centering") is not None
        self._centering = Pid(Gains.from_params(context.entry, ["centering"])) if centering else None
        self._target, self._effort = self._most_m, self._most_n
        self._last, self._moved_s = 0.0, 0.0
        self._pace = Pace(FEEDBACK_HZ)
        self.serve("gripper_action", GripperCommandAction)

    @property
    def _opening(self):
        """How far apart the fingers are [m]."""
        return float(self.hardware.position[self._index].sum())

    def starting(self, time_s: float) -> None:
        super().starting(time_s)
        self._target, self._effort = self._opening, self._most_n

    def update(self, time_s: float, dt: float) -> None:
        self.idle(time_s)
        hardware, index = self.hardware, self._index
        hardware.command[POSITION][index] = self._target / 2.0
        shift = 0.0
        if self._centering is not None:
            left, right = hardware.position[index]
            shift = math.copysign(1.0, self._target - self._opening) * float(
                self._centering.update(hardware.position[index[:1]] - right, dt)[0])
        for i, effort in zip(index, (self._effort - shift, self._effort + shift), strict=True):
            hardware.largest_effort[i] = min(max(effort, 0.0), hardware.largest_effort[i])
        if self._goal is not None:
            self._watch(self._goal, time_s)

    def _on_goal(self, handle: GoalHandle) -> None:
        command = handle.goal.command
        is_finite = math.isfinite(command.position) and math.isfinite(command.max_effort)
        if not self._take(handle, None if is_finite else "position %r and max_effort %r must be finite"
                          % (command.position, command.max_effort)):
            return
        self._effort = command.max_effort if 0.0 < command.max_effort < self._most_n else self._most_n
        self._target = min(max(command.position, 0.0), self._most_m)
        self._last, self._moved_s = self._opening, self._time_s
        self._pace.restart()

    def _on_cancel(self, handle: GoalHandle) -> None:
        if handle is self._goal:
            self._end("")

    def _watch(self, handle: GoalHandle, time_s: float) -> None:
        opening, effort = self._opening, float(self.hardware.effort[self._index].sum())
        self._moved_s = min(self._moved_s, time_s)  # time may have gone back in a reset
        if self._pace.take(time_s) and self._server.feedback_is_heard:
            handle.publish_feedback(GripperCommandFeedback(position=opening, effort=effort))
        reached = abs(opening - handle.goal.command.position) < REACHED_M
        if abs(opening - self._last) > STALL_M:
            self._last, self._moved_s = opening, time_s
        if reached or time_s - self._moved_s > STALL_S:
            self._goal = None
            handle.succeed(GripperCommandResult(opening, effort, not reached, reached))


class _Weight(Controller):
    """robot_controllers/GravityCompensation: bears the links from ``root`` to ``tip``; claims no joint."""

    busy = False

    def __init__(self, name: str, hardware: CascadeHardware, context: ControllerContext, crew: _Crew) -> None:
        super().__init__(name, hardware, context)
        root, tip = context.param("root", "torso_lift_link"), context.param("tip", "wrist_roll_link")
        try:
            self._chain = CarriedChain(context.robot, root, tip)
        except KeyError as error:
            raise ControllerError("parameters root and tip of %s are %r and %r, and the robot has no such chain"
                                  % (context.namespace, root, tip)) from error
        self._index = hardware.index(EFFORT, self._chain.joints, context.namespace)

    def update(self, time_s: float, dt: float) -> None:
        self.hardware.command[EFFORT][self._index] += self._chain.efforts(self.hardware.position[self._index])


class _Mimic(Controller):
    """robot_controllers/ScaledMimicController: ``controlled_joint`` is ``mimic_scale`` times ``mimic_joint``."""

    busy = False

    def __init__(self, name: str, hardware: CascadeHardware, context: ControllerContext, crew: _Crew) -> None:
        super().__init__(name, hardware, context)
        self._scale = context.number("mimic_scale", 1.0)
        self._index = self.claim(POSITION, [context.param("controlled_joint", "bellows_joint")])
        self._other = hardware.index(POSITION, [context.param("mimic_joint", "torso_lift_joint")], context.namespace)

    def update(self, time_s: float, dt: float) -> None:
        self.hardware.command[POSITION][self._index] = self._scale * self.hardware.position[self._other]


class _Base(DiffDriveController):
    """robot_controllers/DiffDriveBaseController; wheels that stand are held."""

    busy = False

    def __init__(self, name: str, hardware: CascadeHardware, context: ControllerContext, crew: _Crew) -> None:
        super().__init__(name, hardware, context)


def _follower_context(name, host, given):
    constraints: dict[str, Any] = {"goal_time": GOAL_TIME_S, "stopped_velocity_tolerance": 0.0}
    joints = given.get("joints")
    for joint in joints if isinstance(joints, list) else ():
        constraints[str(joint)] = {"goal": GOAL_POSITION}
    parameters = {"joints": joints, "constraints": constraints, "action_monitor_rate": FEEDBACK_HZ}
    return _Context(name, host, parameters, {"follow_joint_trajectory": host.resolve(name)})


def _gripper_context(name, host, given):
    return _Context(name, host, given, {"gripper_action": host.resolve(name)})


def _point_head_context(name, host, given):
    return _Context(name, host, given, {"point_head": host.resolve(name)})


# The parameters of robot_controllers' vehicle: its name, its default, ros_controllers' name.
_VEHICLE = (
    ("l_wheel_joint", "l_wheel_joint", "left_wheel"), ("r_wheel_joint", "r_wheel_joint", "right_wheel"),
    ("track_width", 0.37476, "wheel_separation"), ("publish_tf", True, "enable_odom_tf"),
    ("odometry_frame", "odom", "odom_frame_id"), ("base_frame", "base_link", "base_frame_id"),
    ("timeout", 0.25, "cmd_vel_timeout"), ("publish_frequency", 100.0, "publish_rate"))
_SPEEDS = (("x", "linear", 1.0, 0.75), ("r", "angular", 4.5, 3.0))


def _base_context(name, host, given):
    parameters = {ours: given.get(theirs, default) for theirs, default, ours in _VEHICLE}
    per_metre = given.get("radians_per_meter", 16.5289)
    if isinstance(per_metre, bool) or not isinstance(per_metre, (int, float)) or not per_metre > 0.0:
        raise ControllerError("parameter %s/radians_per_meter is %r, expected a number above 0"
                              % (host.resolve(name), per_metre))
    parameters["wheel_radius"] = 1.0 / per_metre
    for letter, direction, velocity, acceleration in _SPEEDS:
        parameters[direction] = {"z" if letter == "r" else "x": {
            "has_velocity_limits": True, "max_velocity": given.get("max_velocity_" + letter, velocity),
            "has_acceleration_limits": True, "max_acceleration": given.get("max_acceleration_" + letter, acceleration)}}
    return _Context(name, host, parameters, {"cmd_vel": host.resolve(name) + "/command", "odom": host.resolve("odom")})


#: {type: (class, its context, whether it runs from the start without ``autostart``)}; a vehicle is started by commands.
_TYPES = {
    "robot_controllers/FollowJointTrajectoryController": (_Follower, _follower_context, False),
    "robot_controllers/ParallelGripperController": (_Gripper, _gripper_context, False),
    "robot_controllers/PointHeadController": (PointHead, _point_head_context, False),
    "robot_controllers/GravityCompensation": (_Weight, _Context, False),
    "robot_controllers/ScaledMimicController": (_Mimic, _Context, False),
    "robot_controllers/DiffDriveBaseController": (_Base, _base_context, True),
}


class _Crew:
    """The controllers, and which of them run: a controller that starts stops those with whom it shares joints."""

    def __init__(self, hardware: CascadeHardware, log: Log) -> None:
        self._hardware, self._log = hardware, log
        self._all, self._running = [], []
        self._time_s = 0.0

    def add(self, controller: Controller, runs: bool) -> None:
        self._all.append(controller)
        if runs:
            self.start(controller)

    def start(self, controller: Controller) -> str | None:
        """Start a controller, and return None, or the reason why it may not: one that shares a joint has a goal."""
        joints = _claimed(controller)
        rivals = [other for other in self._running if joints & _claimed(other)]
        for other in rivals:
            if other.busy:
                return "%s cannot start: %s has a goal and shares joints %s" % (
                    controller.name, other.name, ", ".join(sorted(joints & _claimed(other))))
        for other in rivals:
            other.stopping(self._time_s)
        controller.starting(self._time_s)
        self._running = [other for other in self._running if other not in rivals] + [controller]
        return None

    def update(self, time_s: float, dt: float) -> None:
        self._time_s = time_s
        self._hardware.clear()
        for controller in self._all:
            if controller not in self._running:
                controller.idle(time_s)
        for controller in self._running:
            controller.update(time_s, dt)

    def restart(self) -> None:
        """Goals end, and all that run start again where the joints are."""
        for controller in self._running:
            controller.stopping(self._time_s)
            controller.starting(self._time_s)

    def close(self) -> None:
        for controller in self._all:
            controller.close()


class RobotControllers(ModelPlugin):
    """``/gazebo/default_controllers`` lists the controllers; each has its parameters under its own name.

    Left out with a warning: types that are not in the table, and controllers with wrong parameters. Of the gains below
    ``/gazebo/<joint>`` the p of the position counts; the velocity is kept by a motor with the joint's largest effort.
    """

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        hardware = CascadeHardware(context.model, context.robot, [
            _number(context.param("%s/%s/position/p" % (NODE, joint)), 0.0) for joint in context.model.joint_names])
        self._hardware, self._crew = hardware, _Crew(hardware, context.log)
        self._crew.add(JointStateController("joint_states", hardware, _Context(
            "joint_states", context, {"publish_rate": JOINT_STATES_HZ})), True)
        names = context.param(NODE + "/default_controllers")
        if not isinstance(names, list):
            context.log.warn("model '%s' has no controllers: parameter %s/default_controllers is %r, expected a list "
                             "of their names" % (context.model.name, NODE, names))
            names = []
        for name in names:
            try:
                self._load(str(name))
            except ControlError as error:
                context.log.warn("model '%s': controller '%s' is left out: %s" % (context.model.name, name, error))

    def _load(self, name):
        given = self.context.param(name)
        given = given if isinstance(given, dict) else {}
        kind = given.get("type")
        if kind not in _TYPES:
            raise ControllerError("parameter %s/type is %r; the simulator serves %s"
                                  % (self.context.resolve(name), kind, ", ".join(sorted(_TYPES))))
        controller_class, make_context, runs = _TYPES[kind]
        context = make_context(name, self.context, given)
        try:
            controller = controller_class(name, self._hardware, context, self._crew)
        except ControlError:
            context.close()
            raise
        self._crew.add(controller, runs or given.get("autostart") is True)

    def update(self, time_s: float, dt: float) -> None:
        self._hardware.read()
        self._crew.update(time_s, dt)
        self._hardware.write(dt)

    def joints_set(self) -> None:
        self._hardware.read()
        self._crew.restart()

    def reset(self) -> None:
        self.joints_set()

    def hold(self) -> None:
        self._hardware.hold_all()

    def close(self) -> None:
        self._crew.close()


def _claimed(controller):
    return {joint for joints in controller.claims.values() for joint in joints}


def _number(value, absent):
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else absent
