# SPDX-License-Identifier: BSD-3-Clause
"""Additions to the world's bodies in the pages' 3D view: the points of a sensor, and the frames of tf. No ROS: the
graph is an argument, with

- ``clouds()``: the topics with points; ``subscribe(topic, take)``: calls ``take(message)`` on any thread, returns an
  object with ``close()``
- ``frames()``: names in tf; ``pose(frame)``: a frame in the robot's base frame (4 x 4), or None
- ``base()``: the pose of the robot's base frame in the scene (4 x 4), or None
"""
from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from lab_web.clouds import CloudError, packed, points_of
from lab_web.lab import RobotError
from web_bridge.errors import shown

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from sensor_msgs.msg import PointCloud2

    from lab_web.overlay_topics import OverlayTopics

#: Period of frames [s], and the shortest time between two clouds of a topic [s].
FRAMES_S, CLOUD_S = 0.2, 0.2


class PageOverlay:
    """``show(client, data)`` sends bytes, ``answer(client, operation)`` an operation, ``told(client, code, text)`` an
    error to a page.
    """

    def __init__(self, graph: OverlayTopics, show: Callable[[int, bytes], object],
                 answer: Callable[[int, dict[str, Any]], object], told: Callable[[int, str, str], object],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._graph = graph
        self._show, self._answer, self._told = show, answer, told
        self._clock = clock
        self._lock = threading.Lock()
        self._wishes = {}  # client -> (topic, with frames?)
        self._subscriptions = {}  # topic -> object with close()
        self._due_s = {}  # topic -> time of its next cloud
        self._wrong = {}  # topic -> what was wrong with its last message

    def watch(self, client: int, operation: dict[str, Any]) -> None:
        """``points``: a topic with points, or ""; ``frames``: true to see the frames of tf. Does not wait. Raises
        RobotError.
        """
        topic, frames = operation.get("points", ""), operation.get("frames", False)
        if not isinstance(topic, str) or not isinstance(frames, bool):
            raise RobotError("\"points\" must be a topic or empty, \"frames\" true or false")
        with self._lock:
            self._wishes[client] = topic, frames

    def forget(self, client: int) -> None:
        """The page has gone. Does not wait."""
        with self._lock:
            self._wishes.pop(client, None)

    def run(self, ends: Callable[[], bool]) -> None:
        """Follow what pages want until ``ends()``; for a separate thread."""
        while not ends():
            began = self._clock()
            self.settle()
            self.send_frames()
            time.sleep(max(0.0, FRAMES_S - (self._clock() - began)))
        while self._subscriptions:
            self._subscriptions.popitem()[1].close()

    def settle(self) -> None:
        """Subscribe to the topics that somebody wants, and to no others; one thread calls it."""
        with self._lock:
            wanted = {topic for topic, _ in self._wishes.values()} - {""}
        for topic in self._subscriptions.keys() - wanted:
            self._subscriptions.pop(topic).close()
            self._wrong.pop(topic, None)
        for topic in wanted - self._subscriptions.keys():
            topics = self._graph.clouds()
            if topic in topics:
                self._subscriptions[topic] = self._graph.subscribe(
                    topic, lambda message, topic=topic: self._take(topic, message))
                continue
            text = "%s is no topic with points; there are %s" % (shown(topic), ", ".join(topics) or "none")
            for client in self._clients_of(topic):
                with self._lock:
                    if client in self._wishes:
                        self._wishes[client] = "", self._wishes[client][1]
                self._told(client, "refused", text)

    def _clients_of(self, topic: str) -> list[int]:
        with self._lock:
            return [client for client, (wanted, _) in self._wishes.items() if wanted == topic]

    def send_frames(self) -> None:
        """Send the frames of now to the pages that want them."""
        with self._lock:
            clients = [client for client, (_, frames) in self._wishes.items() if frames]
        base = self._graph.base() if clients else None
        if base is None:
            return
        poses = {name: self._graph.pose(name) for name in sorted(self._graph.frames())}
        frames = [[name, [round(float(value), 4) for value in (base @ pose)[:3].ravel()]]
                  for name, pose in poses.items() if pose is not None]
        for client in clients:
            self._answer(client, {"op": "frames", "frames": frames})

    def _take(self, topic: str, message: PointCloud2) -> None:
        now = self._clock()
        if now < self._due_s.get(topic, now):
            return
        self._due_s[topic] = now + CLOUD_S
        base, pose = self._graph.base(), self._graph.pose(message.header.frame_id)
        try:
            if base is None or pose is None:
                raise CloudError("tf does not know its frame %r" % message.header.frame_id)
            data, wrong = packed(*points_of(message), base @ pose), ""
        except CloudError as error:
            data, wrong = b"", "%s: %s" % (topic, error)
        for client in self._clients_of(topic):
            if data:
                self._show(client, data)
            elif self._wrong.get(topic) != wrong:
                # Once, not with each message.
                self._told(client, "refused", wrong)
        self._wrong[topic] = wrong
