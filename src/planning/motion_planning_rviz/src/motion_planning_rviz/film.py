# SPDX-License-Identifier: BSD-3-Clause
"""Marker arrays that change little by little, and the planned path as a film of them."""
from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import rospy
from visualization_msgs.msg import Marker, MarkerArray

from motion_planning_rviz import drawing
from motion_planning_rviz.messages import line_marker, marker_of

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel
    from motion_planning_rviz.playback import Playback

#: Pictures of the planned path each second.
FILM_HZ = 15.0


class MarkerSet:
    """A topic with one set of markers. Only markers that are no longer needed are deleted: otherwise rviz would load
    meshes again, and flicker.

    frame: a frame of tf.
    """

    def __init__(self, name: str, frame: str) -> None:
        self._frame = frame
        self._publisher = rospy.Publisher(name, MarkerArray, queue_size=2, latch=True)
        self._shown = None

    def show(self, markers: Sequence[Marker]) -> None:
        """Publish ``markers``, and delete the previous ones that are not among them."""
        keys = {(marker.ns, marker.id) for marker in markers}
        # An earlier process of this node may have left some.
        gone = [Marker(action=Marker.DELETEALL)] if self._shown is None else [
            Marker(ns=ns, id=number, action=Marker.DELETE) for ns, number in sorted(self._shown - keys)]
        for marker in gone:
            # rviz deletes a marker without a frame immediately, before it has drawn earlier ones.
            marker.header.frame_id = self._frame
        self._shown = keys
        if gone or markers:
            self._publisher.publish(MarkerArray(gone + list(markers)))

    def is_looked_at(self) -> bool:
        return self._publisher.get_num_connections() > 0


class PlaybackFilm:
    """Shows a playback.Playback on a topic again and again, in a separate thread. width: of the line [m]."""

    def __init__(self, name: str, model: PlanningModel, width: float) -> None:
        self._picture, self._model, self._width = MarkerSet(name, model.root), model, width
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._enabled, self._playback, self._begin = True, None, 0.0
        self._solids, self._lines = {}, []
        threading.Thread(target=self._run, name="film", daemon=True).start()

    def show(self, playback: Playback, links: Iterable[str]) -> None:
        """Show a path from now on; ``links``: those whose path is drawn as a line."""
        with self._lock:
            self._playback, self._begin = playback, time.monotonic()
            self._solids = drawing.link_solids(self._model.robot, playback.moving)
            self._lines = [line_marker("way of " + link, playback.trail(link), self._model.root, drawing.PATH,
                                       self._width) for link in links if link in playback.moving]
        self._wake.set()

    def enable(self, enabled: bool) -> None:
        """Show the path, or hide it until it is enabled again."""
        with self._lock:
            self._enabled = enabled
        self._wake.set()

    def forget(self) -> None:
        """Show nothing any more."""
        with self._lock:
            self._playback = None
        self._wake.set()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            with self._lock:
                playing = self._playback if self._enabled else None
                markers = self._markers(playing) if playing is not None and self._picture.is_looked_at() else []
                if markers or playing is None:
                    self._picture.show(markers)
            # Real time: a film continues while simulation time is paused.
            self._wake.wait(1.0 / FILM_HZ if playing is not None else None)
            self._wake.clear()

    def _markers(self, playback: Playback) -> list[Marker]:
        frames = self._model.frames(playback.at(time.monotonic() - self._begin))
        poses = {link: frames[self._model.link_index[link]] for link in self._solids}
        return self._lines + [marker_of(one, self._model.root)
                              for one in drawing.drawn(self._solids, poses, drawing.PATH)]
