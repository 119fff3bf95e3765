# SPDX-License-Identifier: BSD-3-Clause
"""Interactive markers at the ends of arms, under the names that MoveIt's panel gives them."""
from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import InteractiveMarker, InteractiveMarkerControl, Marker, MenuEntry

from motion_planning_rviz.drawing import GOAL, START
from motion_planning_rviz.messages import pose_message

if TYPE_CHECKING:
    from visualization_msgs.msg import InteractiveMarkerFeedback

    from motion_planning_rviz.menu import PanelEntry

#: The topic of MoveIt's panel for its markers; programs expect them there.
TOPIC = "/rviz_moveit_motion_planning_display/robot_interaction_interactive_marker_topic"
# A control's axis is the x axis of its orientation.
_HALF = 0.5 ** 0.5
_AXES = {"x": Quaternion(0.0, 0.0, 0.0, 1.0), "y": Quaternion(0.0, 0.0, _HALF, _HALF),
         "z": Quaternion(0.0, -_HALF, 0.0, _HALF)}
_BALL = 0.35


def marker_name(which: str, link: str) -> str:
    """Return the name of the marker that drags ``link`` of "goal" or "start"."""
    return "EE:%s_%s" % (which, link)


def marker_message(which: str, link: str, pose: np.ndarray, frame: str, scale: float) -> InteractiveMarker:
    """Return the InteractiveMarker of ``which`` ("goal", "start") for a link at ``pose`` (4, 4) in ``frame``: arrows
    and rings along and about three axes, and a ball. scale [m]."""
    message = InteractiveMarker(name=marker_name(which, link), scale=scale, pose=pose_message(pose))
    # A stamp of zero: rviz keeps the marker in this frame, and answers in it.
    message.header.frame_id = frame
    ball = Marker(type=Marker.SPHERE, scale=Vector3(*[_BALL * scale] * 3),
                  color=ColorRGBA(*(GOAL if which == "goal" else START)))
    message.controls.append(InteractiveMarkerControl(
        name="ball", interaction_mode=InteractiveMarkerControl.MOVE_ROTATE_3D, always_visible=True, markers=[ball],
        orientation=Quaternion(0.0, 0.0, 0.0, 1.0), description="drag; right click for the menu"))
    for axis, orientation in _AXES.items():
        for what, mode in (("move", InteractiveMarkerControl.MOVE_AXIS),
                           ("rotate", InteractiveMarkerControl.ROTATE_AXIS)):
            message.controls.append(InteractiveMarkerControl(
                name="%s_%s" % (what, axis), interaction_mode=mode, orientation=orientation))
    return message


def menu_entries(entries: Iterable[PanelEntry]) -> list[MenuEntry]:
    """Return the MenuEntries of the panel's entries."""
    return [MenuEntry(id=entry.number, parent_id=entry.parent, title=entry.title, command_type=MenuEntry.FEEDBACK)
            for entry in entries]


class HandleMarkers:
    """The markers on ``topic``. on_feedback: function of an InteractiveMarkerFeedback; frame: the robot's root link."""

    def __init__(self, topic: str, frame: str, scale: float,
                 on_feedback: Callable[[InteractiveMarkerFeedback], None]) -> None:
        self._frame, self._scale, self._on_feedback = frame, scale, on_feedback
        self._server = InteractiveMarkerServer(topic)
        self._lock = threading.Lock()
        self._names, self._menu = set(), []

    def place(self, which: str, poses: Mapping[str, np.ndarray]) -> None:
        """Show markers of "goal" or "start" at ``poses`` {link: (4, 4)}, new ones and those that there are."""
        with self._lock:
            for link, pose in poses.items():
                name = marker_name(which, link)
                if name in self._names:
                    self._server.setPose(name, pose_message(pose))
                else:
                    message = marker_message(which, link, pose, self._frame, self._scale)
                    message.menu_entries = self._menu
                    self._insert(message)
                    self._names.add(name)
            self._server.applyChanges()

    def erase(self, which: str = "") -> None:
        """Take the markers of "goal" or "start" away, or all."""
        with self._lock:
            gone = {name for name in self._names if name.startswith("EE:" + which)}
            for name in gone:
                self._server.erase(name)
            self._names -= gone
            self._server.applyChanges()

    def set_menu(self, entries: Iterable[PanelEntry]) -> None:
        """Give every marker the menu of these menu.Entries."""
        with self._lock:
            self._menu = menu_entries(entries)
            for name in self._names:
                message = self._server.get(name)
                assert message is not None  # all of these names are on the server
                message.menu_entries = self._menu
                self._insert(message)
            self._server.applyChanges()

    def _insert(self, message: InteractiveMarker) -> None:
        self._server.insert(message)
        self._server.setCallback(message.name, self._on_feedback)
