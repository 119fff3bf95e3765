# SPDX-License-Identifier: BSD-3-Clause
"""An arm that follows another robot's: joint angles of a leader in, joint velocities out. Free of ROS.

Only while the leader's cuff is squeezed; from where both arms are at that moment, so that nothing jumps.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from baxter_model import SIDES

#: Of the messages that a leader is followed by: topic -> type; "%s" stands for the side.
TOPICS = {"/robot/joint_states": "sensor_msgs/JointState",
          "/robot/digital_io/%s_lower_cuff/state": "baxter_core_msgs/DigitalIOState",
          "/robot/digital_io/%s_upper_button/state": "baxter_core_msgs/DigitalIOState",
          "/robot/digital_io/%s_lower_button/state": "baxter_core_msgs/DigitalIOState",
          "/robot/navigators/%s_navigator/state": "baxter_core_msgs/NavigatorState"}
#: Buttons of a navigator (the wheel, back, the Rethink button) and their marks.
NAVIGATOR_MARKS = ("success", "failure", "again")
_BUTTONS = {"upper_button": "open", "lower_button": "close", "lower_cuff": "lower_cuff"}
# A leader that is silent for so long has let go [s]. A joint that moves so far between two looks is not followed [rad].
_SILENT_S, _MAX_STRIDE_RAD = 0.15, 0.3
# Rate at which the follower catches up [1/s].
_RATE = 8.0


def topics_of(sides: Sequence[str]) -> dict[str, str]:
    """{topic: type} of a leader's ``sides``."""
    return {topic % side if "%s" in topic else topic: kind for topic, kind in TOPICS.items() for side in sides}


class Leader:
    """The newest messages of a leader robot, as dicts like rosbridge's."""

    def __init__(self) -> None:
        self.position: dict[str, float] = {}
        self._heard = -np.inf
        self._down: dict[tuple[str, str], bool] = {}
        self._presses: list[tuple[str, str]] = []

    def take(self, topic: str, message: Mapping[str, Any], now: float) -> None:
        """A message that came at ``now`` [s]; one that cannot be read changes nothing."""
        name = topic.rpartition("/state")[0].rpartition("/")[2]
        side, _, part = name.partition("_")
        if topic.endswith("joint_states"):
            found = {joint: float(angle) for joint, angle in zip(message["name"], message["position"], strict=False)
                     if angle is not None and np.isfinite(angle)}
            self.position.update(found)
            if found:
                self._heard = now
        elif side not in SIDES:
            return
        elif part == "navigator":
            for mark, is_down in zip(NAVIGATOR_MARKS, message["buttons"], strict=False):
                self._press(side, mark, bool(is_down))
        elif part in _BUTTONS:
            self._press(side, _BUTTONS[part], message["state"] == 1)

    def _press(self, side: str, what: str, is_down: bool) -> None:
        if is_down and not self._down.get((side, what)):
            self._presses.append((side, what))
        self._down[side, what] = is_down

    def holds(self, side: str, now: float) -> bool:
        """Whether the cuff of ``side`` is squeezed, and the leader is there."""
        return bool(self._down.get((side, "lower_cuff"))) and now - self._heard < _SILENT_S

    def presses(self) -> list[tuple[str, str]]:
        """(side, open, close, success, failure or again) of buttons pressed since the last call."""
        pressed, self._presses = self._presses, []
        return [one for one in pressed if one[1] != "lower_cuff"]


class Clutch:
    """Engaged while something is held. signs (k,): directions of the follower's joints against the leader's."""

    def __init__(self, signs: np.ndarray) -> None:
        self._signs = signs
        self._offset: np.ndarray | None = None
        self._last = np.zeros(len(signs))
        self._refused = False

    def velocities(self, leader: np.ndarray, follower: np.ndarray, is_held: bool, seconds: float) -> np.ndarray:
        """Return velocities (k,) [rad/s] of the follower's joints, ``seconds`` after the last call.

        leader, follower (k,): angles [rad]. After a leap of the leader the clutch has to be let go first.
        """
        lead = self._signs * leader
        if not is_held:
            self._offset, self._refused = None, False
            return np.zeros(len(lead))
        if self._offset is None:
            self._offset, self._last = follower - lead, lead
        self._refused |= bool(np.abs(lead - self._last).max() > _MAX_STRIDE_RAD)
        speed, self._last = (lead - self._last) / max(seconds, 1e-3), lead
        if self._refused:
            return np.zeros(len(lead))
        return speed + _RATE * (lead + self._offset - follower)
