# SPDX-License-Identifier: BSD-3-Clause
"""``libactor_trajectory.so``: moves the actor of a world along its trajectory. ROS-free."""
from __future__ import annotations

import bisect
from typing import TYPE_CHECKING

import numpy as np

from bullet_sim import Pose
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from urdf_model.transforms import pose_matrix, quaternion_from_matrix

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from gazebo_ros.model_plugin import PluginContext

_PERIOD_S = 1.0 / 30.0  # of the poses, as in Gazebo


class ActorTrajectory:
    """Poses by time: straight between waypoints."""

    def __init__(self, waypoints: Iterable[tuple[float, Sequence[float]]]) -> None:
        """``waypoints``: list of (time [s], pose (6,): x, y, z [m], roll, pitch, yaw), at least one."""
        waypoints = sorted(waypoints, key=lambda waypoint: waypoint[0])
        self._times = [time for time, _ in waypoints]
        self._places = [np.array(pose[:3], dtype=float) for _, pose in waypoints]
        self._turns = [quaternion_from_matrix(pose_matrix(rpy=pose[3:])) for _, pose in waypoints]

    @property
    def length_s(self) -> float:
        """The time of the last waypoint."""
        return self._times[-1]

    def pose(self, time_s: float) -> Pose:
        """The Pose at a time [s] since the start; before the first waypoint that, after the last one that."""
        after = bisect.bisect_right(self._times, time_s)
        if after in (0, len(self._times)):
            at = min(after, len(self._times) - 1)
            return Pose(tuple(self._places[at].tolist()), tuple(self._turns[at].tolist()))
        before = after - 1
        part = (time_s - self._times[before]) / (self._times[after] - self._times[before])
        one, other = self._turns[before], self._turns[after]
        turned = one + part * ((other if one @ other >= 0.0 else -other) - one)
        place = self._places[before] + part * (self._places[after] - self._places[before])
        return Pose(tuple(place.tolist()), tuple((turned / np.linalg.norm(turned)).tolist()))


class ActorMotion(ModelPlugin):
    """Elements, as those of an actor's ``<script>``: ``loop`` (true), ``delay_start`` (0 s), ``auto_start`` (true),
    ``trajectory/waypoint``. Nothing pushes the actor, and it pushes nothing."""

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        waypoints = [(self._number(point, "time"), self._pose(point))
                     for point in context.element.iterfind("trajectory/waypoint")]
        moves = bool(waypoints) and self._flag("auto_start")
        self._trajectory = ActorTrajectory(waypoints) if moves else None
        self._loops = self._flag("loop")
        self._delay_s = self._number(context.element, "delay_start")
        self._began_s, self._next_s = context.world.time_s, 0.0

    def update(self, time_s: float, dt: float) -> None:
        if self._trajectory is None or time_s < self._next_s:
            return
        self._next_s = time_s + _PERIOD_S
        passed, length = time_s - self._began_s, self._trajectory.length_s
        if self._loops and length > 0.0:
            passed %= self._delay_s + length
        if passed >= self._delay_s:
            self.context.model.set_base_pose(self._trajectory.pose(passed - self._delay_s))

    def reset(self) -> None:
        self._began_s, self._next_s = self.context.world.time_s, 0.0

    def _flag(self, tag: str) -> bool:
        return self.context.element_text(tag, "true").lower() in ("true", "1")

    def _number(self, element: Any, tag: str) -> float:
        return self._numbers(element, tag, 1)[0]

    def _pose(self, element: Any) -> list[float]:
        return self._numbers(element, "pose", 6)

    def _numbers(self, element: Any, tag: str, count: int) -> list[float]:
        text = (element.findtext(tag) or "").strip() or " ".join(count * ["0"])
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or not np.isfinite(values).all():
            raise PluginError("actor '%s': <%s> is '%s', expected %d numbers"
                              % (self.context.model.name, tag, text, count))
        return values
