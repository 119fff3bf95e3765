# SPDX-License-Identifier: BSD-3-Clause
"""The markers of a server as its messages tell them. No ROS: messages are objects with the fields of
visualization_msgs.
"""
from __future__ import annotations

import copy
import threading
from typing import Any

Point = tuple[float, float, float]  #: x, y, z [m]
Quaternion = tuple[float, float, float, float]  #: x, y, z, w


class MarkerMirror:
    """Markers by name, of the servers that publish on one topic. Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._servers = {}  # server id -> [sequence number, {name: marker}]

    def begin(self, init: Any) -> None:
        """A server has said all of its markers (InteractiveMarkerInit)."""
        with self._lock:
            self._servers[init.server_id] = [init.seq_num, {marker.name: marker for marker in init.markers}]

    def update(self, update: Any) -> None:
        """A server has said what changed (InteractiveMarkerUpdate)."""
        with self._lock:
            server = self._servers.setdefault(update.server_id, [0, {}])
            server[0] = update.seq_num
            for name in update.erases:
                server[1].pop(name, None)
            for marker in update.markers:
                server[1][marker.name] = marker
            for change in update.poses:
                if change.name in server[1]:
                    server[1][change.name].header, server[1][change.name].pose = change.header, change.pose

    def fill(self, init: Any) -> Any:
        """Lay copies of all markers, and the id and number of the server that spoke last, over an empty
        InteractiveMarkerInit.
        """
        with self._lock:
            for server_id, (number, markers) in self._servers.items():
                init.server_id, init.seq_num = server_id, number
                # Copied while nobody changes them.
                init.markers.extend(copy.deepcopy(list(markers.values())))
        return init


def multiplied(a: Quaternion, b: Quaternion) -> Quaternion:
    """The product of two quaternions (x, y, z, w)."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def moved(place: Point, turn: Quaternion, position: Point, orientation: Quaternion) -> tuple[Point, Quaternion]:
    """A pose (position, quaternion x y z w) in the parent frame of a transform with translation ``place``, rotation
    ``turn``.
    """
    conjugate = (-turn[0], -turn[1], -turn[2], turn[3])
    x, y, z, _ = multiplied(multiplied(turn, (*position, 0.0)), conjugate)
    return (place[0] + x, place[1] + y, place[2] + z), multiplied(turn, orientation)
