# SPDX-License-Identifier: BSD-3-Clause
"""The panel's output: markers on topics for rviz's own displays."""
from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker

from motion_planning_rviz import drawing
from motion_planning_rviz.film import MarkerSet, PlaybackFilm
from motion_planning_rviz.interaction import WHICH
from motion_planning_rviz.messages import line_marker, marker_of, object_solids, playback_of, text_marker

if TYPE_CHECKING:
    from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, DisplayTrajectory

    from motion_planning.model import PlanningModel, State
    from motion_planning_rviz.client import BodyTouch, SceneSnapshot
    from motion_planning_rviz.drawing import Colour
    from motion_planning_rviz.handles import HandleMarkers
    from motion_planning_rviz.interaction import Handle
    from motion_planning_rviz.menu import PanelEntry

_COLOURS = {"goal": drawing.GOAL, "start": drawing.START}
#: Topics with pictures, below the node's name.
PICTURES = ("goal_state", "start_state", "contacts", "planning_scene", "text")
FILM = "planned_path"
# Of each line of text; rviz hides a text whose middle is out of view.
_COLUMNS, _ROWS = 60, 2
# Sizes of drawn things, as shares of the markers' size.
_TEXT, _ABOVE, _LINE, _CONTACT = 0.16, 1.0, 0.04, 0.15


class View:
    """Publishes the ghosts ``~goal_state`` and ``~start_state``, ``~contacts``, ``~planning_scene``, ``~planned_path``
    and ``~text`` (all MarkerArray), and ``~status`` (String). handles: handles.HandleMarkers; scale: size of its
    markers [m].
    """

    def __init__(self, model: PlanningModel, handles: HandleMarkers, scale: float) -> None:
        self._model, self._handles, self._scale = model, handles, scale
        self._pictures = {name: MarkerSet("~" + name, model.root) for name in PICTURES}
        self._status = rospy.Publisher("~status", String, queue_size=10, latch=True)
        self._film = PlaybackFilm("~" + FILM, model, _LINE * scale)
        self._solids, self._moving, self._links = {}, frozenset(), ()
        self._touches, self._anchor = {}, np.zeros(3)
        self._entries, self._said, self._logged = {}, None, ""

    # -- ghosts and handles -------------------------------------------------------------------------------------

    def group(self, name: str, handles: Iterable[Handle]) -> None:
        """Another group: its links are the ghosts'."""
        for which in WHICH:
            self._handles.erase(which)
        self._moving = frozenset(self._model.group(name).moving_links)
        self._solids = drawing.link_solids(self._model.robot, self._model.group(name).moving_links)
        self._links = tuple(handle.link for handle in handles)
        self._film.forget()

    def ghost(self, which: str, state: State, touches: Sequence[BodyTouch], attached: Iterable[AttachedCollisionObject],
              unreached: tuple[Handle, np.ndarray] | None) -> None:
        """Draw the group's links at ``state`` and their attached objects; bodies in contact are red.

        touches: client.Touches. attached: AttachedCollisionObjects. unreached: None, or (handle, pose (4, 4)) that the
        handle's link cannot reach.
        """
        frames = self._model.frames(state.q)
        poses = {link: frames[number] for link, number in self._model.link_index.items()}
        special = {name: drawing.COLLIDING for touch in touches for name in (*touch.links, *touch.held)}
        found = drawing.drawn(self._solids, poses, _COLOURS[which], special)
        for body in attached:
            # Attached objects are in the frame of their link, or of another link.
            frame = body.object.header.frame_id or body.link_name
            if body.link_name in self._moving and frame in poses:
                name = body.object.id
                found += drawing.drawn({name: object_solids(body.object)}, {name: poses[frame]}, _COLOURS[which],
                                       special)
        markers = [marker_of(one, self._model.root) for one in found]
        if unreached is not None:
            ends = [poses[unreached[0].link][:3, 3], unreached[1][:3, 3]]
            markers.append(line_marker("unreached", ends, self._model.root, drawing.COLLIDING, _LINE * self._scale))
        self._pictures[which + "_state"].show(markers)
        self._touches[which] = touches
        self._show_contacts()
        if which == "goal" and self._links:
            # Above the whole robot: an arm in front of the text would hide it.
            self._anchor = np.append(poses[self._links[0]][:2, 3], frames[:, 2, 3].max())

    def clear(self, which: str) -> None:
        """No ghost and no markers of "goal" or "start"."""
        self._handles.erase(which)
        self._pictures[which + "_state"].show([])
        self._touches.pop(which, None)
        self._show_contacts()

    def place(self, which: str, poses: Mapping[Handle, np.ndarray]) -> None:
        """Put markers to ``poses`` {Handle: (4, 4)}."""
        self._handles.place(which, {handle.link: pose for handle, pose in poses.items()})

    def menu(self, entries: Iterable[PanelEntry]) -> None:
        """Show menu.Entries behind a right click. Those of earlier menus stay known: a click may be on its way."""
        self._entries.update({entry.number: entry.command for entry in entries})
        self._handles.set_menu(entries)

    def command(self, number: int) -> tuple[Any, ...]:
        """The command of an entry of any menu so far, empty for an unknown one."""
        return self._entries.get(number, ())

    def _show_contacts(self) -> None:
        markers = []
        for touch in (touch for touches in self._touches.values() for touch in touches):
            marker = Marker(ns="%s=%s" % (touch.a, touch.b), id=len(markers), type=Marker.SPHERE,
                            pose=Pose(Point(*touch.point), Quaternion(0.0, 0.0, 0.0, 1.0)),
                            scale=Vector3(*[_CONTACT * self._scale] * 3), color=ColorRGBA(1.0, 0.0, 0.0, 1.0))
            marker.header.frame_id = touch.frame
            markers.append(marker)
        self._pictures["contacts"].show(markers)

    # -- text, scene, path --------------------------------------------------------------------------------------

    def say(self, motion: str, notes: Sequence[str]) -> None:
        """Write lines above the robot at its goal, the ends of long ones left out, and all of them onto ``~status``.

        motion: the present action; it is also logged.
        """
        lines = [line for line in (motion, *notes) if line]
        rows = [row for line in lines for row in textwrap.wrap(line, _COLUMNS, max_lines=_ROWS,
                                                                placeholder=" ...")]
        height = _TEXT * self._scale
        place = self._anchor + (0.0, 0.0, _ABOVE * self._scale + 0.5 * height * len(rows))
        self._pictures["text"].show([text_marker("\n".join(rows), place, self._model.root, height)] if rows else [])
        if lines != self._said:
            self._said = lines
            self._status.publish("\n".join(lines))
        if motion and motion != self._logged:
            rospy.loginfo("%s", motion)
        self._logged = motion

    def scene(self, snapshot: SceneSnapshot) -> None:
        """Draw the objects of the world and attached objects at their present poses, from a client.SceneSnapshot."""
        markers = []
        for one in snapshot.objects:
            markers += _object(one, one.header.frame_id, snapshot.colours.get(one.id, drawing.THING))
        for body in snapshot.attached:
            markers += _object(body.object, body.object.header.frame_id or body.link_name,
                               snapshot.colours.get(body.object.id, drawing.HELD))
        self._pictures["planning_scene"].show(markers)

    def path(self, message: DisplayTrajectory) -> None:
        """Show a DisplayTrajectory again and again. Raises ValueError for one that cannot be shown."""
        self._film.show(playback_of(self._model, message), self._links)

    def show_path(self, shown: bool) -> None:
        """Show the planned path, or hide it."""
        self._film.enable(shown)

    def forget_path(self) -> None:
        """Remove the planned path."""
        self._film.forget()


def _object(message: CollisionObject, frame: str, colour: Colour) -> list[Marker]:
    poses = {message.id: np.eye(4)}
    markers = [marker_of(one, frame) for one in drawing.drawn({message.id: object_solids(message)}, poses, colour)]
    for marker in markers:
        marker.frame_locked = True  # attached objects move with their link
    return markers
