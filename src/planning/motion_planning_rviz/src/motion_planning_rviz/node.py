# SPDX-License-Identifier: BSD-3-Clause
"""The node: passes messages from rviz and other programs to the panel."""
from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Hashable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import rospkg
import rospy
import tf2_ros
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import DisplayTrajectory, PlanningScene, RobotState
from std_msgs.msg import Empty, String
from visualization_msgs.msg import InteractiveMarkerFeedback

from motion_planning.errors import PlanningError
from motion_planning.model import PlanningModel
from motion_planning_rviz import handles, interaction
from motion_planning_rviz.client import MoveGroupClient, NoAnswer
from motion_planning_rviz.interaction import WHICH, InteractionError
from motion_planning_rviz.messages import matrix_of, state_values, tells_joints_alone
from motion_planning_rviz.panel import Panel
from motion_planning_rviz.view import View
from motion_planning_rviz.worker import Worker
from rospy_nodes.start import MissingParameter, end_on_signals, limit_ports, wait_for_param

if TYPE_CHECKING:
    from std_msgs.msg import Header

    from motion_planning_rviz.interaction import Handle

# Wall time to wait for the robot's model, and between two log lines about waiting for move_group [s].
_DESCRIPTION_TIMEOUT_S, _TOLD_EVERY_S = 60.0, 10.0
# Wall time from the first answer of a move_group that has not heard from the joints [s]. Another one than ours may
# never say that it has.
_JOINTS_TIMEOUT_S = 30.0
_TF_TIMEOUT_S = 1.0
#: MoveIt's defaults, if robot_description_planning has no value.
_SPEED = "default_velocity_scaling_factor"
_USUAL_SPEED = 0.1
# Scene messages after a command that are not believed to tell of joints alone: the first may be older than the command,
# and the next leaves out what the command added where another program has removed it meanwhile.
_DOUBTED = 2
# Commands for the marker that was clicked.
_OF_A_HANDLE = ("add_box", "attach")


class PanelNode:
    """Subscriptions around a Panel."""

    def __init__(self, model: PlanningModel) -> None:
        self._model = model
        scale = float(rospy.get_param("~marker_scale", 0.2))
        markers = handles.HandleMarkers(rospy.get_param("~marker_topic", handles.TOPIC), model.root, scale,
                                        self._on_feedback)
        self._view = View(model, markers, scale)
        self._worker = Worker(self._on_error)
        self._client = MoveGroupClient(model, float(rospy.get_param("~planning_time", 5.0)))
        self._panel = Panel(model, self._client, self._view, self._worker, np.random.default_rng())
        self._buffer, self._listener = None, None
        self._doubted = 0
        self._subscribers = []

    def begin(self, description: str) -> None:
        """Wait for move_group, then serve. description: name of the parameter that holds the URDF."""
        speed = rospy.get_param("~speed", rospy.get_param("%s_planning/%s" % (description, _SPEED), _USUAL_SPEED))
        group = rospy.get_param("~group", "")
        told, answered = -_TOLD_EVERY_S, None
        while not rospy.is_shutdown():
            try:
                late = answered is not None and time.monotonic() - answered >= _JOINTS_TIMEOUT_S
                self._panel.begin(group, float(speed), measured=not late)
                break
            except InteractionError:
                raise
            except PlanningError as error:
                if not isinstance(error, NoAnswer) and answered is None:
                    answered = time.monotonic()
                if time.monotonic() - told >= _TOLD_EVERY_S:
                    rospy.loginfo("waiting for move_group: %s", error)
                    told = time.monotonic()
                time.sleep(0.2)
        self._subscribe()

    def _subscribe(self) -> None:
        panel = self._panel
        for name, action in (("plan", panel.plan), ("execute", panel.execute)):
            self._listen("/rviz/moveit/" + name, Empty, lambda _, action=action: self._put(action))
        self._listen("/rviz/moveit/stop", Empty, lambda _: panel.stop())
        for which in WHICH:
            self._listen("/rviz/moveit/update_%s_state" % which, Empty,
                         lambda _, which=which: self._put(lambda: panel.current(which)))
            self._listen("/rviz/moveit/update_custom_%s_state" % which, RobotState,
                         lambda message, which=which: self._put(lambda: panel.set_state(which, state_values(message))))
        self._listen("/rviz/moveit/select_planning_group", String,
                     lambda message: self._put(lambda: panel.select_group(message.data)))
        links = {handle.link for group in panel.groups for handle in interaction.handles_of(self._model, group)}
        for which in WHICH:
            for link in links:
                self._listen("/rviz/moveit/move_marker/%s_%s" % (which, link), PoseStamped,
                             lambda message, where=(which, link): self._move(*where, message.header, message.pose))
        self._listen("move_group/display_planned_path", DisplayTrajectory,
                     lambda message: self._put(lambda: self._view.path(message)))
        self._listen("move_group/monitored_planning_scene", PlanningScene, self._on_scene)

    def _listen(self, name: str, kind: type[rospy.Message], callback: Callable[[Any], None]) -> None:
        self._subscribers.append(rospy.Subscriber(name, kind, callback, queue_size=10))

    def _put(self, function: Callable[[], None], key: Hashable = None) -> None:
        self._worker.put(function, key)

    def _on_error(self, error: Exception) -> None:
        if isinstance(error, PlanningError | ValueError | tf2_ros.TransformException):
            self._panel.complain(str(error))
        else:
            rospy.logerr("%s: %s", type(error).__name__, error)

    def _on_scene(self, message: PlanningScene) -> None:
        doubted, self._doubted = self._doubted, max(self._doubted - 1, 0)
        if doubted or not tells_joints_alone(message):
            self._put(self._panel.refresh, "scene")

    # -- markers ------------------------------------------------------------------------------------------------

    def _on_feedback(self, message: InteractiveMarkerFeedback) -> None:
        which, _, link = message.marker_name.partition(":")[2].partition("_")
        kinds = InteractiveMarkerFeedback
        if message.event_type == kinds.POSE_UPDATE:
            self._move(which, link, message.header, message.pose, released=False)
        elif message.event_type == kinds.MOUSE_UP:
            self._move(which, link, message.header, message.pose)
        elif message.event_type == kinds.MENU_SELECT:
            self._choose(self._view.command(message.menu_entry_id), link)

    def _move(self, which: str, link: str, header: Header, pose: Pose, released: bool = True) -> None:
        def move() -> None:
            handle = self._handle(link)
            self._panel.drag(which, handle, self._in_root(header.frame_id) @ matrix_of(pose), released)

        self._put(move, None if released else (which, link))

    def _choose(self, command: Sequence[Any], link: str) -> None:
        if not command:
            return
        what, *values = command
        if what == "stop":
            self._panel.stop()
            return

        def choose() -> None:
            handle = [self._handle(link)] if what in _OF_A_HANDLE else []
            try:
                getattr(self._panel, "select_group" if what == "group" else what)(*handle, *values)
            finally:
                self._doubted = _DOUBTED

        self._put(choose)

    def _handle(self, link: str) -> Handle:
        for handle in self._panel.handles:
            if handle.link == link:
                return handle
        raise InteractionError("link '%s' is not an end of group '%s'" % (link, self._panel.query.group))

    def _in_root(self, frame: str) -> np.ndarray:
        """The pose (4, 4) of a frame in the root link, by tf where it is another."""
        frame = frame.lstrip("/")
        if frame in ("", self._model.root):
            return np.eye(4)
        if "\0" in frame:  # where tf2's library raises an error that does not name it
            raise InteractionError("%r is not a frame: it has a zero in it" % frame)
        if self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
        deadline = time.monotonic() + _TF_TIMEOUT_S
        while True:
            try:
                found = self._buffer.lookup_transform(self._model.root, frame, rospy.Time()).transform
                return matrix_of(Pose(found.translation, found.rotation))
            except tf2_ros.TransformException:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.02)


def main() -> None:
    """Run the node until it is shut down."""
    end_on_signals()
    limit_ports()
    rospy.init_node("planning_panel", disable_signals=True)
    logging.getLogger("actionlib").setLevel(logging.WARNING)
    other = rospy.get_param("~unless_installed", "")
    if other and other in rospkg.RosPack().list():
        rospy.loginfo("package %s is installed; its panel does what this node would do", other)
        return
    name = rospy.get_param("~robot_description", "robot_description")
    try:
        urdf, srdf = (wait_for_param(one, _DESCRIPTION_TIMEOUT_S) for one in (name, name + "_semantic"))
        limits = rospy.get_param(name + "_planning/joint_limits", None)
        PanelNode(PlanningModel.from_xml(urdf, srdf, {"joint_limits": limits} if limits else None)).begin(name)
    except (MissingParameter, PlanningError) as error:
        if not rospy.is_shutdown():
            sys.exit("planning_panel: %s" % error)
        return
    rospy.spin()
