# SPDX-License-Identifier: BSD-3-Clause
"""Arms that pages steer by twists, as long as something is held. No ROS: a servo is an argument, with

- ``is_there``: whether it listens
- ``steer(twist, in_tool)``: go on with (6,) numbers, -1 to 1: x, y, z, roll, pitch, yaw
- ``speeds``: what 1 means [m/s, rad/s]
- ``reason``: why it holds the arm back, or ""
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from arm_kinematics import KinematicsError, pose_from_quaternion
from lab_web.lab import PageLab, RobotError
from urdf_model.transforms import quaternion_from_matrix

#: How long a page's word holds of what is held [s]: twice as long as one that draws without a graphics card is silent.
FRESH_S = 0.3
#: Of a servo whose arm stays where it is; the robot knows why.
_STUCK = "does not follow"
_START = "roslaunch moveit_servo baxter_servo.launch"
#: Rate at which a hand goes to where it is led [1/s]; leaps of what leads it begin a new way [m, rad].
_LED_RATE, _LEAP_M, _LEAP_RAD = 6.0, 0.15, 0.7


class ServoControls(Protocol):
    """The controls of one arm's servo."""

    reason: str

    @property
    def speeds(self) -> Sequence[float]: ...

    @property
    def is_there(self) -> bool: ...

    def steer(self, twist: np.ndarray, in_tool: bool) -> None: ...


def _turn_of(rotation: np.ndarray) -> np.ndarray:
    """(3,) axis times angle [rad] of a rotation (3, 3)."""
    quaternion = quaternion_from_matrix(rotation)
    x, y, z, w = quaternion if quaternion[3] >= 0.0 else -quaternion
    sine = math.sqrt(x * x + y * y + z * z)
    return np.array((x, y, z)) * (2.0 * math.atan2(sine, w) / sine if sine > 1e-9 else 2.0)


class Led(NamedTuple):
    """Where a hand is led: motion (4, 4) since the grip ``number`` began, shift and turn in the base's axes."""

    number: float
    motion: np.ndarray


class _Way:
    """The way of one hand that is led."""

    def __init__(self, led: Led, pose: np.ndarray) -> None:
        self._number, self._last = led.number, led.motion
        # What is led and what leads are where they are: nothing jumps.
        self._shift = pose[:3, 3] - led.motion[:3, 3]
        self._turn = led.motion[:3, :3].T @ pose[:3, :3]

    def goes_on(self, led: Led) -> bool:
        """Whether ``led`` belongs to this way."""
        leap = led.motion[:3, 3] - self._last[:3, 3]
        turn = _turn_of(led.motion[:3, :3] @ self._last[:3, :3].T)
        self._last = led.motion
        return bool(led.number == self._number and np.linalg.norm(leap) < _LEAP_M
                    and np.linalg.norm(turn) < _LEAP_RAD)

    def twist(self, led: Led, pose: np.ndarray, speeds: Sequence[float]) -> np.ndarray:
        """(6,) the shares of the speeds that lead ``pose`` there, each of both in its direction."""
        shift = self._shift + led.motion[:3, 3] - pose[:3, 3]
        turn = _turn_of(led.motion[:3, :3] @ self._turn @ pose[:3, :3].T)
        shares = [_LED_RATE * part / speed for part, speed in zip((shift, turn), speeds, strict=True)]
        return np.concatenate([part / max(1.0, float(np.linalg.norm(part))) for part in shares])


class SteeredMotion:
    """A motion of the lab (as lab_web.motion.PageMotion) that has no set-points of its own: servos make them.

    ``servos()``: {side: ServoControls}; ``explain(side)`` is called once for each arm that does not follow its servo;
    ``pose(side, measured)``: (4, 4) of a hand in the base, or None.
    """

    #: Joints that the lab itself holds when the motion ends; none, since the servos bring them to rest.
    limits: Mapping[str, Any] = {}

    def __init__(self, servos: Callable[[], Mapping[str, ServoControls]], explain: Callable[[str], None],
                 pose: Callable[[str, Mapping[str, float]], np.ndarray | None]) -> None:
        self._servos, self._explain, self._pose = servos, explain, pose
        self._led: dict[str, Led] = {}
        self._ways: dict[str, _Way] = {}
        self._twists: dict[str, np.ndarray] = {}
        self._in_tool, self._age_s = False, 0.0
        self._explained: set[str] = set()

    @property
    def is_moving(self) -> bool:
        return bool(self._twists or self._led)

    def aim(self, twists: dict[str, np.ndarray], in_tool: bool, led: dict[str, Led] | None = None) -> SteeredMotion:
        """Go on with ``twists`` {side: (6,)}, and with hands that are ``led``, until the next ones, for FRESH_S at
        most."""
        servos, led = self._servos(), led or {}
        for side in servos.keys() & (self._twists.keys() | self._led.keys()) - twists.keys() - led.keys():
            servos[side].steer(np.zeros(6), in_tool)
        self._ways = {side: way for side, way in self._ways.items() if side in led and way.goes_on(led[side])}
        self._twists, self._led, self._in_tool, self._age_s = twists, led, in_tool, 0.0
        return self

    def stop(self) -> bool:
        """Bring the arms to rest; returns whether there were any to steer."""
        moved = self.is_moving
        self.aim({}, self._in_tool)
        self._explained.clear()
        return moved

    def step(self, dt: float, measured: Mapping[str, float]) -> dict[str, float]:
        """Steer for ``dt`` [s]; no set-points."""
        self._age_s += dt
        if self._age_s > FRESH_S:
            self.stop()
        servos = self._servos()
        for side, led in self._led.items() if servos else ():
            pose = self._pose(side, measured)
            if pose is not None:
                way = self._ways.setdefault(side, _Way(led, pose))
                servos[side].steer(way.twist(led, pose, servos[side].speeds), False)
                self._ask_why(servos[side], side)
        for side, twist in self._twists.items() if servos else ():
            servos[side].steer(twist, self._in_tool)
            self._ask_why(servos[side], side)
        return {}

    def _ask_why(self, servo: ServoControls, side: str) -> None:
        if _STUCK in servo.reason and side not in self._explained:
            self._explained.add(side)
            self._explain(side)


def operation(lab: PageLab, steering: SteeredMotion,
              servos: Callable[[], Mapping[str, ServoControls]]) -> Callable[[int, dict], None]:
    """Return ``serve`` of the operation "steer" for :meth:`lab_web.lab.PageLab.add`: ``hands`` {side: six numbers} that
    something holds now, ``tool``: in the axes of each hand itself; ``led`` {side: {number, shift (3), turn (x, y, z,
    w)}}: hands that follow a device, and its motion since it was gripped. Raises RobotError, NotInControl.
    """
    def serve(client: int, asked: dict) -> None:
        led = _led_of(asked)
        twists = {side: twist for side, twist in _twists_of(asked).items() if side not in led}
        if not twists and not led:
            lab.let_go(client, steering)
            return
        there = servos()
        for side in (*twists, *led):
            if side not in there or not there[side].is_there:
                raise RobotError("nothing steers the %s hand; start the servos: %s" % (side[:20], _START))
        lab.start(client, lambda _limits, _measured: steering.aim(twists, asked.get("tool") is True, led),
                  is_stream=True)
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


def _led_of(asked: dict) -> dict[str, Led]:
    led = asked.get("led", {})
    try:
        found = {side: Led(float(one["number"]), pose_from_quaternion(one["shift"], one["turn"]))
                 for side, one in led.items()}
        if not all(math.isfinite(one.number) for one in found.values()):  # NaN would be another grip each time
            raise ValueError("a number is not finite")
        return found
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError, KinematicsError) as error:
        raise RobotError("\"led\" must be an object of sides with number, shift (3) and turn (4) each: %s"
                         % str(error)[:100]) from None
