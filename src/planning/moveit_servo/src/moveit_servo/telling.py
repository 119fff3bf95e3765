# SPDX-License-Identifier: BSD-3-Clause
"""A servo's reports: of the commands that it refuses, and why steps are not those wanted. Free of ROS."""
from __future__ import annotations

import math
import re

from moveit_servo.servo import Status

# For how long a refused command is the status, and at least a reason what is said, for people who read it [s].
_REFUSED_S, _KEPT_S = 1.0, 0.5
_NUMBER = re.compile(r"[-+]?\b(\d[\d.]*(e[-+]?\d+)?|nan|inf)\b", re.IGNORECASE)


class Telling:
    """Of one servo. Times are of one clock of wall time [s]. said: the newest (Status, reason) with a reason that is
    to be read, or (NO_WARNING, "")."""

    def __init__(self) -> None:
        self.said, self._since = (Status.NO_WARNING, ""), -math.inf
        self._refusal = ("", -math.inf)

    def refuse(self, text: str, now: float) -> None:
        """A command is not carried out; any thread."""
        self._refusal = text, now

    def take(self, status: Status, reason: str, now: float) -> Status:
        """Note what a step at ``now`` says; return the status to publish: a refusal goes before for a while."""
        refused, since = self._refusal
        if now - since < _REFUSED_S:
            status, reason = Status.INVALID, refused
        if reason:
            self._since = now
        if reason or now - self._since >= _KEPT_S:
            self.said = (status, reason)
        return status


def kind_of(text: str) -> str:
    """The text without its numbers: what is the same, however often it is said."""
    return _NUMBER.sub("#", text)
