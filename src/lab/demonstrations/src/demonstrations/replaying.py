# SPDX-License-Identifier: BSD-3-Clause
"""An episode of a robot as set-points over time, and when a robot may not follow them. Free of ROS."""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from baxter_model import JOINTS, SIDES, readiness

from .frames import ACTION, DemonstrationError
from .reading import DataSet
from .watching import NAMED

#: Each arm's numbers: its joints, then its gripper.
_OF_ARM = len(JOINTS) + 1


@dataclass(frozen=True)
class ReplayLimits:
    """speed_rad_s: of joints on the way to the episode's start; off_rad: of a joint from its set-point, more means that
    something is in the way; seen_s: age of the joint states [s]."""

    speed_rad_s: float = 0.3
    off_rad: float = 0.5
    seen_s: float = 0.5


def reason_to_stop(limits: ReplayLimits, enabled: bool, stopped: bool, seen_s: float, off_rad: float) -> str:
    """Why the replay ends now, "" if it goes on."""
    if stopped:
        return readiness.STOPPED
    if not enabled:
        return readiness.NOT_ENABLED
    if seen_s > limits.seen_s:
        return "the last joint states are %.1f s old" % seen_s
    if off_rad > limits.off_rad:
        return "a joint is %.2f rad from its set-point; something may be in the way" % off_rad
    return ""


class Replay:
    """actions (n, 16) as in sets of the recorder, rate_hz; start (14,): where the joints are [rad]. It goes straight to
    the first action at a limited speed, and then as recorded. Attributes: `begins_s`, when the episode begins;
    `ends_s`."""

    def __init__(self, actions: np.ndarray, rate_hz: int, start: np.ndarray, limits: ReplayLimits):
        self._actions, self._rate_hz, self._start = np.asarray(actions, dtype=float), rate_hz, np.asarray(start)
        furthest = float(np.abs(self._joints(0) - self._start).max())
        self.begins_s = furthest / limits.speed_rad_s
        self.ends_s = self.begins_s + (len(self._actions) - 1) / rate_hz

    def _joints(self, frame: int) -> np.ndarray:
        return np.concatenate([part[:-1] for part in self._actions[frame].reshape(len(SIDES), _OF_ARM)])

    def joints(self, time_s: float) -> np.ndarray:
        """(14,) set-points at a time from the start [rad]."""
        if time_s < self.begins_s:
            return self._start + time_s / self.begins_s * (self._joints(0) - self._start)
        at = min((time_s - self.begins_s) * self._rate_hz, len(self._actions) - 1.0)
        before = math.floor(at)
        after = min(before + 1, len(self._actions) - 1)
        return self._joints(before) + (at - before) * (self._joints(after) - self._joints(before))

    def openings(self, time_s: float) -> np.ndarray:
        """(2,) how far the grippers are to be open [%]."""
        frame = min(max(math.floor((time_s - self.begins_s) * self._rate_hz), 0), len(self._actions) - 1)
        return self._actions[frame].reshape(len(SIDES), _OF_ARM)[:, -1]


def actions_of(data: DataSet, number: int) -> np.ndarray:
    """(n, 16) of an episode. Raises DemonstrationError for other actions than finite positions."""
    names, wanted = data.schema.features[ACTION].names, tuple(name for name, _ in NAMED)
    if names != wanted:
        raise DemonstrationError("%s has the actions %s; a robot replays %s" % (
            data.folder, ", ".join(names or ("without names",)), ", ".join(wanted)))
    actions = data.episode(number).columns[ACTION]
    if not np.isfinite(actions).all():
        raise DemonstrationError("episode %d of %s has actions that are no finite numbers" % (number, data.folder))
    return actions
