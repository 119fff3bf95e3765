# SPDX-License-Identifier: BSD-3-Clause
"""The node: keeps the scene and the robot's state, lets the servo make a step each period, publishes its set-points."""
from __future__ import annotations

import argparse
import math
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rosgraph.names
import rospy
from control_msgs.msg import JointJog
from geometry_msgs.msg import PoseStamped, TwistStamped
from moveit_msgs.msg import PlanningScene, PlanningSceneComponents
from moveit_msgs.srv import (
    ChangeControlDimensions,
    ChangeControlDimensionsResponse,
    ChangeDriftDimensions,
    ChangeDriftDimensionsResponse,
    GetPlanningScene,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8, String
from std_srvs.srv import Empty, EmptyResponse

from disk_cache import compiler_pages
from model_files.resources import ResourceFinder
from motion_planning.errors import PlanningError
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners.planning import sphere_model_of
from moveit_ros_move_group.convert.geometry import matrix_of
from moveit_ros_move_group.monitor import SceneMonitor
from moveit_servo.commands import CommandIgnored, Commands, Frame, bounded_pose, sent_at
from moveit_servo.convex_parts import ConvexParts, cuts_named
from moveit_servo.outputs import message_of, message_type
from moveit_servo.servo import Servo, ServoCommand, Status
from moveit_servo.settings import ServoSettings, SettingsError, at_run_time
from moveit_servo.surroundings import Surroundings
from moveit_servo.telling import Telling, kind_of
from moveit_servo.warming import warm_up
from rospy_fixes.ports.event_log import EventLog, printable
from rospy_fixes.ports.threads import ThreadFaults, lasting
from rospy_nodes.start import MissingParameter, end_on_signals, limit_ports, wait_for_param

# Wall time to wait for the robot's model, and for all of the arm's joint states until that is complained of [s].
_DESCRIPTION_TIMEOUT_S, _JOINTS_TIMEOUT_S = 60.0, 10.0
# Wall time between two looks at the parameters, at the scene, and at the reason of a status [s].
_PARAMETERS_EVERY_S, _SCENE_EVERY_S, _REASON_EVERY_S = 1.0, 0.1, 0.25
# Wall time after a command without a step that tells that ROS time stands still [s].
_STANDS_S = 1.0
# A step covers at most this many periods: after a pause the motion goes on where it was.
_MAX_PERIODS = 3.0
# A joint that is said to move faster [rad/s, m/s], or to be so far beyond its limits [rad, m], says nothing of use; nor
# does one without limits that is further away.
_MAX_SPEED, _MAX_BEYOND, _FARTHEST = 1e3, 1.0, 1e6
_SCENE_TOPIC = "move_group/monitored_planning_scene"
_AXES = ("x_translation", "y_translation", "z_translation", "x_rotation", "y_rotation", "z_rotation")
# Private parameters that are no settings of the servo.
_OTHER_PARAMETERS = {"robot_description", "monitored_planning_scene_topic", "planning_scene_monitor_options",
                     "planning_scene_monitor"}
_TOPICS = ("cartesian_command_in_topic", "joint_command_in_topic", "joint_topic", "status_topic", "command_out_topic")

_DESCRIPTION = """Steer an arm, as MoveIt Servo does.

Subscribes: ~delta_twist_cmds, ~delta_joint_cmds, ~target_pose, joint_states, and the planning scene's topics.
Publishes: the controller's command, ~status, ~status_reason.
Services: ~change_drift_dimensions, ~change_control_dimensions, ~reset_servo_status.
Parameters: those of MoveIt Servo's YAML files, read again once a second; ~robot_description,
~monitored_planning_scene_topic.
"""


class ServoNode:
    """Callbacks put commands and states in, ``run`` takes them out."""

    def __init__(self, model: PlanningModel, exact: ExactChecker, settings: ServoSettings,
                 faults: ThreadFaults) -> None:
        self.model, self.exact, self._faults = model, exact, faults
        self.servo = Servo(model, settings)
        self._parts = ConvexParts(sphere_model_of(exact), cuts_named(settings.mesh_cuts, model))
        self.commands = Commands(self.servo.joints)
        self._lock, self._news = threading.Lock(), threading.Event()
        self._q, self._velocity = model.default_state().q.copy(), np.zeros(len(model.variables))
        lower, upper = model.bounds.T
        self._least, self._most = (np.where(model.continuous, without, np.clip(limits, -_FARTHEST, _FARTHEST))
                                   for limits, without in ((lower - _MAX_BEYOND, -_FARTHEST),
                                                           (upper + _MAX_BEYOND, _FARTHEST)))
        self._heard: set[str] = set()
        self._indices = [model.index[name] for name in self.servo.joints]
        self._sent, self._halts, self._new_settings, self._begun_with = False, 0, settings, settings
        self._telling, self._events, self._rests = Telling(), EventLog(rospy.logwarn), True
        # Wall times of the newest command and step [s].
        self._came, self._stepped = -math.inf, math.inf
        topics = topics_of(settings, rospy.get_name())
        self.monitor = SceneMonitor(model, lambda _, error: self._events.add(kind_of(str(error)), str(error)),
                                    {"joint_state_topic": topics["joint_topic"]})
        self._prepare(self.monitor.scene())
        kind = message_type(settings.command_out_type)
        self._out = rospy.Publisher(topics["command_out_topic"], kind, queue_size=2, tcp_nodelay=True)
        self._status = rospy.Publisher(topics["status_topic"], Int8, queue_size=2)
        self._reason = rospy.Publisher("~status_reason", String, queue_size=2, latch=True)
        take = {"queue_size": 2, "tcp_nodelay": True}
        self._kept = [
            rospy.Subscriber(topics["joint_topic"], JointState, self._on_joints, queue_size=2),
            rospy.Subscriber(topics["cartesian_command_in_topic"], TwistStamped, self._on_twist, **take),
            rospy.Subscriber(topics["joint_command_in_topic"], JointJog, self._on_jog, **take),
            rospy.Subscriber("~target_pose", PoseStamped, self._on_pose, **take),
            rospy.Subscriber(rospy.get_param("~monitored_planning_scene_topic", _SCENE_TOPIC), PlanningScene,
                             lambda message: self.monitor.apply(message, "the planning scene"), queue_size=100),
            rospy.Service("~change_drift_dimensions", ChangeDriftDimensions, self._on_drift),
            rospy.Service("~change_control_dimensions", ChangeControlDimensions, self._on_control),
            rospy.Service("~reset_servo_status", Empty, self._on_reset)]
        for place, work in (("that follows the scene", self._watch_scene),
                            ("that follows the parameters", self._watch_parameters),
                            ("that publishes reasons", self._tell_reasons)):
            threading.Thread(target=lasting(faults, place, work), args=(rospy.is_shutdown,), name=place,
                             daemon=True).start()

    # -- what comes in -------------------------------------------------------------------------------------------

    def _on_joints(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            return  # the scene's monitor says so
        moves = len(message.velocity) == len(message.name)
        with self._lock:
            for number, name in enumerate(message.name):
                index, angle = self.model.index.get(name), message.position[number]
                if index is None:
                    continue
                if not self._least[index] <= angle <= self._most[index]:
                    self._events.add(("position", name), "joint %s is said to be at %g, and can be at %g to %g; it is "
                                     "ignored" % (name, angle, self._least[index], self._most[index]))
                    continue
                speed = message.velocity[number] if moves else 0.0
                if not abs(speed) < _MAX_SPEED:  # drivers that do not measure it send NaN
                    rospy.logwarn_once("the velocity of joint %s comes as %g; such velocities count as 0"
                                       % (name, speed))
                    speed = 0.0
                self._q[index], self._velocity[index] = angle, speed
                self._heard.add(name)

    def _on_twist(self, message: TwistStamped) -> None:
        part = message.twist
        values = [getattr(vector, axis) for vector in (part.linear, part.angular) for axis in "xyz"]
        self._take(message.header, lambda frame, since: self.commands.take_twist(
            values, frame, since, self.servo.settings), self.servo.settings.incoming_command_timeout)

    def _on_jog(self, message: JointJog) -> None:
        def take(_, since):
            remark = self.commands.take_jog(message.joint_names, message.velocities, since, self.servo.settings)
            if remark:
                self._refuse(remark)
        self._take(message.header, take, self.servo.settings.incoming_command_timeout)

    def _on_pose(self, message: PoseStamped) -> None:
        def take(frame, since):
            # The one before ends; from now on the target stands still, also one that is told from the moving hand.
            self.commands.forget_pose()
            pose = bounded_pose(matrix_of(message.pose, "target_pose"))
            axes = self._axes(frame if len(frame) else self.servo.settings.planning_frame, self._q)
            self.commands.take_pose(axes @ pose, since)
        self._take(message.header, take, self.servo.settings.target_pose_timeout or math.inf)

    def _refuse(self, text: str) -> None:
        """Say that a command is not carried out, on the topics of the status and in the log."""
        self._telling.refuse(text, time.monotonic())
        self._events.add(kind_of(text), text)

    def _take(self, header: Any, take: Any, timeout: float) -> None:
        """Give a command to ``commands``, where it counts for ``timeout`` [s]; say why one is ignored."""
        arrived, self._came = rospy.get_time(), time.monotonic()
        since = sent_at(header.stamp.to_sec(), arrived)
        if arrived - since >= timeout:
            self._refuse("a command has come %.2f s after its stamp, and counts for %g s; do the clocks agree?"
                         % (arrived - since, timeout))
            since = -math.inf
        frame = header.frame_id.lstrip("/")
        try:
            # What tf alone knows is looked up once for each command, which keeps it.
            of_robot = not frame or frame in self.model.link_index or frame == self.model.frame
            place = frame if of_robot else self.monitor.tf_frame(frame)
            with self._lock:
                take(place, since)
        except (CommandIgnored, PlanningError) as error:
            self._refuse("%s; it is ignored" % error)
        self._news.set()

    def _on_drift(self, request: Any) -> ChangeDriftDimensionsResponse:
        self.commands.drift = np.array([getattr(request, "drift_" + axis) for axis in _AXES], dtype=bool)
        return ChangeDriftDimensionsResponse(success=True)

    def _on_control(self, request: Any) -> ChangeControlDimensionsResponse:
        self.commands.control = np.array([getattr(request, "control_" + axis) for axis in _AXES], dtype=bool)
        return ChangeControlDimensionsResponse(success=True)

    def _on_reset(self, _: Any) -> EmptyResponse:
        self._telling = Telling()  # nothing is ever latched here
        return EmptyResponse()

    # -- steps ---------------------------------------------------------------------------------------------------

    def wait_for_joints(self) -> bool:
        """Wait for a state of each of the arm's joints; False: the node ends."""
        begin, told = time.monotonic(), False
        while not rospy.is_shutdown():
            missing = [name for name in self.servo.joints if name not in self._heard]
            if not missing:
                return True
            if not told and time.monotonic() - begin > _JOINTS_TIMEOUT_S:
                told = True
                rospy.logwarn("no joint state has come for %s; is %s the right joint_topic?", ", ".join(missing),
                              rospy.resolve_name(self.servo.settings.joint_topic))
            time.sleep(0.02)
        return False

    def run(self) -> None:
        """Make a step each period of ROS time until the node ends; after an unforeseen error without the command that
        was given, from where the arm is."""
        lasting(self._faults, "that makes the steps", self._steps)(rospy.is_shutdown)

    def _begin_again(self) -> None:
        """Forget commands and motion."""
        with self._lock:
            self.commands.clear()
        self.servo.reset()
        self._rests = True

    def _steps(self, ends: Callable[[], bool]) -> None:
        self._begin_again()
        last = rospy.get_time()
        due = last
        while not ends():
            settings = self.servo.settings
            period, now = settings.publish_period, rospy.get_time()
            # A period that has become shorter counts at once.
            due = min(max(due + period, now - period), now + period)
            begins = self._wait_until(due, settings)
            now = rospy.get_time()
            if now < last:
                self._begin_again()
                last = due = now
                continue
            seconds = min(now - last, _MAX_PERIODS * settings.publish_period)
            last = now
            if begins:
                seconds, due = settings.publish_period, now
            if seconds > 0.0:
                self._step(now, seconds)

    def _wait_until(self, due: float, settings: ServoSettings) -> bool:
        """Wait until a step is ``due`` [s]. True: a command has come before to an arm at rest, which begins at once,
        with a step of one period."""
        while not rospy.is_shutdown():
            left = due - rospy.get_time()
            if left <= 0.0 or left > 10.0 * settings.publish_period:
                break
            if self._rests or settings.low_latency_mode:
                if self._news.wait(left if self._rests else min(left, 0.001)):
                    return self._rests
            else:
                try:
                    rospy.sleep(left)
                except rospy.ROSException:  # time has gone back, or the node ends
                    break
        return False

    def _step(self, now: float, seconds: float) -> None:
        servo = self.servo
        if self._new_settings is not servo.settings:
            try:
                servo.settings = self._new_settings
            except SettingsError as error:
                rospy.logwarn("the parameters stay as they were: %s", error)
            self._new_settings = servo.settings
        settings = servo.settings
        self._news.clear()
        with self._lock:
            q, velocity = self._q.copy(), self._velocity.copy()
            kind, value, frame = self.commands.newest(now, settings)
        step = servo.step(q, velocity, self._command(kind, value, frame, q, settings), seconds)
        self._rests = step.rests
        if step.reached and not settings.target_pose_timeout:
            with self._lock:
                self.commands.forget_pose()
        self._stepped = time.monotonic()
        self._tell(step.status, step.reason)
        self._halts = self._halts + 1 if step.rests and not kind else 0
        self._sent |= bool(kind)
        if self._sent and (not settings.num_outgoing_halt_msgs_to_publish
                           or self._halts <= settings.num_outgoing_halt_msgs_to_publish):
            self._out.publish(message_of(step, q[self._indices], servo.joints, settings, seconds, now))

    def _tell(self, status: Status, reason: str) -> None:
        """Publish the status, of this or of a command that has been refused."""
        status = self._telling.take(status, reason, time.monotonic())
        if self._status.get_num_connections():
            self._status.publish(Int8(int(status)))

    def _command(self, kind: str, value: Any, frame: Frame, q: np.ndarray, settings: ServoSettings) -> ServoCommand:
        if not kind:
            return ServoCommand()
        if kind == "joints":
            return ServoCommand(joints=value)
        axes = self._axes(settings.planning_frame, q)[:3, :3]
        if kind == "pose":
            return ServoCommand(pose=value, axes=axes, drift=self.commands.drift)
        frame = frame if len(frame) else settings.robot_link_command_frame or settings.planning_frame
        turn = axes.T @ self._axes(frame, q)[:3, :3]
        return ServoCommand(twist=np.concatenate([turn @ value[:3], turn @ value[3:]]), drift=self.commands.drift,
                            axes=axes)

    def _axes(self, frame: Frame, q: np.ndarray) -> np.ndarray:
        """The pose (4, 4) of a frame in the model's frame; that of a link moves with the arm."""
        if isinstance(frame, np.ndarray):
            return frame
        frame = frame.lstrip("/")
        return self.servo.pose(q, frame) if frame in self.model.link_index else np.eye(4)

    # -- beside the steps ----------------------------------------------------------------------------------------

    def _watch_scene(self, ends: Callable[[], bool]) -> None:
        """Prepare the scene again whenever it has changed: the steps use the one before until then."""
        fetched = False
        while not ends():
            time.sleep(_SCENE_EVERY_S)
            if not fetched:
                fetched = self._fetch_scene()
            scene = self.monitor.scene()
            if _of_scene(scene) != self._prepared:
                self._prepare(scene)

    def _fetch_scene(self) -> bool:
        """Take over what move_group knew before; whether that needs no other try."""
        name = rospy.resolve_name("get_planning_scene")
        try:
            rospy.wait_for_service(name, timeout=_SCENE_EVERY_S)
            every = PlanningSceneComponents(components=1023)
            scene = rospy.ServiceProxy(name, GetPlanningScene)(every).scene
        except (rospy.ROSException, rospy.ServiceException):
            return False
        scene.robot_state.joint_state = JointState()
        self.monitor.apply(scene, "the scene of move_group")
        return True

    def _prepare(self, scene: Any) -> None:
        try:
            made = Surroundings(sphere_model_of(self.exact), self.servo.group, self._parts.added_to(scene))
        except PlanningError as error:
            self._prepared = _of_scene(scene)
            rospy.logerr("the scene cannot be prepared, the one before stays in force: %s", error)
            return
        self._prepared = _of_scene(scene)
        for text in made.remarks:
            rospy.logwarn("%s", text)
        self.servo.base, self.servo.surroundings, self._kept_scene = np.array(scene.state.base), made, scene

    def _watch_parameters(self, ends: Callable[[], bool]) -> None:
        """Take changed parameters over; those that need new connections need a restart, too."""
        before = ""
        while not ends():
            time.sleep(_PARAMETERS_EVERY_S)
            try:
                values = rospy.get_param("~", {})
                if repr(values) == before:  # NaN does not equal itself
                    continue
                before = repr(values)
                self._new_settings, later = at_run_time(settings_of(values, self.model), self._begun_with)
                for text in later:
                    self._events.add(text, "%s takes effect at the next start" % text)
            except SettingsError as error:
                rospy.logwarn("the parameters stay as they were: %s", error)
            except OSError:  # no master at the moment
                continue

    def _tell_reasons(self, ends: Callable[[], bool]) -> None:
        """Publish each new status with its reason, and which bodies are near."""
        told = (None, "")
        while not ends():
            time.sleep(_REASON_EVERY_S)
            self._tell_without_steps(time.monotonic())
            status, reason = self._telling.said
            if (status, reason) == told:
                continue
            changed = status is not told[0]
            told = status, reason
            if status in (Status.DECELERATE_FOR_COLLISION, Status.HALT_FOR_COLLISION):
                reason += self._between()
            reason = printable(reason)  # it quotes what others send, to terminals
            self._reason.publish(String(reason))
            if changed and reason:
                text = "%s: %s" % (status.name.lower().replace("_", " "), reason)
                text = reason if status is Status.INVALID else text  # a refusal has been logged
                self._events.add(kind_of(text), text)

    def _tell_without_steps(self, now: float) -> None:
        """At ``now`` of wall time [s]: while no steps are made, say what is refused, and that nothing moves."""
        if now - self._came < _STANDS_S < self._came - self._stepped:
            self._refuse("no step has been made for %.0f s: ROS time stands at %.3f s; is the simulation paused or "
                         "ended, or does it hardly run?" % (self._came - self._stepped, rospy.get_time()))
        if now - self._stepped > _STANDS_S:
            self._tell(Status.NO_WARNING, "")

    def _between(self) -> str:
        scene = self.monitor.scene()
        nearest = self.exact.nearest(scene, scene.state, self.servo.group.name)
        return "" if nearest is None else " between '%s' and '%s'" % (nearest.a, nearest.b)


def settings_of(values: dict, model: PlanningModel) -> ServoSettings:
    """Return the ServoSettings of a node's parameters, with the model's frame where they name none. Raises
    SettingsError."""
    if not isinstance(values, dict):
        raise SettingsError("the parameter of the node's name is %r; expected the servo's parameters below it"
                            % (values,))
    values = {name: value for name, value in values.items() if name not in _OTHER_PARAMETERS}
    values["planning_frame"] = values.get("planning_frame") or model.frame
    settings = ServoSettings.from_mapping(values)
    for name in ("planning_frame", "robot_link_command_frame", "ee_frame_name"):
        frame = getattr(settings, name)
        if frame and frame not in model.link_index and frame != model.frame:
            raise SettingsError("%s is '%s', which is no link of robot '%s'; its frame is '%s'"
                                % (name, frame, model.name, model.frame))
    for name in _TOPICS:
        if not _is_topic(getattr(settings, name)):
            raise SettingsError("%s is '%s'; expected a topic's name" % (name, getattr(settings, name)))
    return settings


def _is_topic(name: Any) -> bool:
    return isinstance(name, str) and name not in ("", "/", "~") and rosgraph.names.is_legal_name(name)


def _of_scene(scene: Any) -> tuple:
    """The parts of a scene that a Surroundings depends on; equal as long as nothing but joints has changed."""
    held = tuple((name, body.link, id(body)) for name, body in scene.state.attached.items())
    return (tuple(map(id, scene.objects.values())), id(scene.octomap), id(scene.allowed), held,
            tuple(scene.link_padding.items()), tuple(scene.link_scale.items()), scene.state.base.tobytes())


def topics_of(settings: ServoSettings, node: str) -> dict[str, str]:
    """Return the topics of a node, {parameter: name for rospy}, as MoveIt Servo names them: relative ones are private,
    but for joint states. In files of moveit_jog_arm, from which it comes, they begin with the node's name, and those
    that do not are public."""
    own = node.rpartition("/")[2] + "/"
    is_old = settings.cartesian_command_in_topic.startswith(own)

    def named(parameter: str) -> str:
        topic = getattr(settings, parameter)
        if topic.startswith(own):
            return "~" + topic.removeprefix(own)
        return topic if topic[0] in "/~" or parameter == "joint_topic" or is_old else "~" + topic
    return {parameter: named(parameter) for parameter in _TOPICS}


def build(faults: ThreadFaults) -> ServoNode:
    """Raises SettingsError, PlanningError, MissingParameter."""
    name = rospy.get_param("~robot_description", "robot_description")
    scene = rospy.get_param("~monitored_planning_scene_topic", _SCENE_TOPIC)
    for parameter, value in (("robot_description", name), ("monitored_planning_scene_topic", scene)):
        if not _is_topic(value):
            raise SettingsError("%s is %r; expected a name" % (parameter, value))
    urdf, srdf = (wait_for_param(name + end, _DESCRIPTION_TIMEOUT_S) for end in ("", "_semantic"))
    limits = (rospy.get_param(name + "_planning", None) or {}).get("joint_limits")
    model = PlanningModel.from_xml(urdf, srdf, {"joint_limits": limits} if limits else None)
    settings = settings_of(rospy.get_param("~", {}), model)
    if settings.unknown:
        rospy.logwarn("parameters without a meaning here: %s", ", ".join(settings.unknown))
    exact = ExactChecker(model, MeshReader(ResourceFinder()))
    for text in (*model.warnings, *exact.warnings):
        rospy.logwarn("%s", text)
    warm_up()
    return ServoNode(model, exact, settings, faults)


def main() -> None:
    parser = argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args(rospy.myargv()[1:])
    end_on_signals()
    try:
        faults = limit_ports()
        rospy.init_node("servo_server", disable_signals=True)
        node = build(faults)
    except (SettingsError, PlanningError, MissingParameter, rospy.ROSInitException) as error:
        if not rospy.is_shutdown():
            sys.exit("servo_server: %s" % error)
        return
    compiler_pages.release()
    if node.wait_for_joints():
        servo = node.servo
        rospy.loginfo("steers %s with group '%s': %s", servo.tip, servo.group.name, ", ".join(servo.joints))
        node.run()
        # Callbacks hold the node until Python has ended, and what is left of ruckig then is reported as a leak.
        servo.reset()
