# SPDX-License-Identifier: BSD-3-Clause
"""Arms that pages steer by twists, as long as something is held. No ROS: a servo is an argument, with

- ``is_there``: whether it listens
- ``steer(twist, in_tool)``: go on with (6,) numbers, -1 to 1: x, y, z, roll, pitch, yaw
- ``reason``: why it holds the arm back, or ""
"""
import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from lab_web.lab import Lab, RobotError

#: How long a page's word holds of what is held [s]: twice as long as one that draws without a graphics card is silent.
FRESH_S = 0.3
#: Of a servo whose arm stays where it is; the robot knows why.
_STUCK = "does not follow"
_START = "roslaunch moveit_servo baxter_servo.launch"


class Servo(Protocol):
    """What steers one arm."""

    reason: str

    @property
    def is_there(self) -> bool: ...

    def steer(self, twist: np.ndarray, in_tool: bool) -> None: ...


class Steering:
    """A motion of the lab (as lab_web.motion.Motion) that has no set-points of its own: servos make them.

    ``servos()``: {side: Servo}; ``explain(side)`` is called once for each arm that does not follow its servo.
    """

    #: Joints that the lab itself holds when the motion ends; none, since the servos bring them to rest.
    limits: Mapping[str, Any] = {}

    def __init__(self, servos: Callable[[], dict[str, Servo]], explain: Callable[[str], None]) -> None:
        self._servos, self._explain = servos, explain
        self._twists: dict[str, np.ndarray] = {}
        self._in_tool, self._age_s = False, 0.0
        self._explained: set[str] = set()

    @property
    def is_moving(self) -> bool:
        return bool(self._twists)

    def aim(self, twists: dict[str, np.ndarray], in_tool: bool) -> "Steering":
        """Go on with ``twists`` {side: (6,)} until the next ones, for FRESH_S at most."""
        servos = self._servos()
        for side in servos.keys() & self._twists.keys() - twists.keys():
            servos[side].steer(np.zeros(6), in_tool)
        self._twists, self._in_tool, self._age_s = twists, in_tool, 0.0
        return self

    def stop(self) -> bool:
        """Bring the arms to rest; returns whether there were any to steer."""
        moved = self.is_moving
        self.aim({}, self._in_tool)
        self._explained.clear()
        return moved

    def step(self, dt: float, _measured: Mapping[str, float]) -> dict[str, float]:
        """Steer for ``dt`` [s]; no set-points."""
        self._age_s += dt
        if self._age_s > FRESH_S:
            self.stop()
        servos = self._servos()
        for side, twist in self._twists.items() if servos else ():
            servos[side].steer(twist, self._in_tool)
            if _STUCK in servos[side].reason and side not in self._explained:
                self._explained.add(side)
                self._explain(side)
        return {}


def operation(lab: Lab, steering: Steering, servos: Callable[[], dict[str, Servo]]) -> Callable[[int, dict], None]:
    """Return ``serve`` of the operation "steer" for :meth:`lab_web.lab.Lab.add`: ``hands`` {side: six numbers} that
    something holds now, ``tool``: in the axes of each hand itself. Raises RobotError, NotInControl.
    """
    def serve(client: int, asked: dict) -> None:
        twists = _twists_of(asked)
        if not twists:
            lab.let_go(client, steering)
            return
        there = servos()
        for side in twists:
            if side not in there or not there[side].is_there:
                raise RobotError("nothing steers the %s hand; start the servos: %s" % (side, _START))
        lab.start(client, lambda _limits, _measured: steering.aim(twists, asked.get("tool") is True), is_stream=True)
    return serve


def _twists_of(asked: dict) -> dict[str, np.ndarray]:
    hands = asked.get("hands")
    if not isinstance(hands, dict):
        raise RobotError("\"hands\" must be an object of sides and six numbers each")
    for side, row in hands.items():
        if not (isinstance(row, list) and len(row) == 6 and all(
                isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1.0
                and math.isfinite(value) for value in row)):
            raise RobotError("the twist of the %s hand is no list of six numbers from -1 to 1" % str(side)[:20])
    return {side: np.array(row, dtype=float) for side, row in hands.items() if any(row)}
