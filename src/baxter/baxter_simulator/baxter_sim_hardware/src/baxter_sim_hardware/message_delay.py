# SPDX-License-Identifier: BSD-3-Clause
"""The effect `delay`: messages take their time on the way between a client and the robot."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from baxter_sim_hardware import effects
from baxter_sim_hardware.numbered_random import NumberedRandom

if TYPE_CHECKING:
    from collections.abc import Mapping


class MessageDelay:
    """How long messages take.

    rows: {number: {name: value}} as `effects.read` has them for "delay"; seed: integer of the jitter, 0 or more.
    """

    def __init__(self, rows: Mapping[str, Mapping[str, float]], seed: int) -> None:
        self._least = effects.positive(rows, "least", "message")
        self._width = max(effects.positive(rows, "most", "message") - self._least, 0.0)
        self._random = NumberedRandom(seed)

    def of(self, stream: int, tick: int) -> float:
        """The delay [s] of what is sent on one stream (an integer, one for each way of messages) in one tick. It
        follows from the two numbers, so it does not depend on what else is sent."""
        return self._least + self._width * self._random.at(tick, stream, 1).random()


class Late:
    """Things on their way on one stream, in their order: none overtakes another."""

    def __init__(self) -> None:
        self._waiting = deque()  # (when it arrives [s], what)

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def send(self, time_s: float, delay_s: float, what: object) -> None:
        """Sent at time_s [s], it arrives so much later, or with the one before."""
        arrival = time_s + delay_s
        if self._waiting:
            arrival = max(arrival, self._waiting[-1][0])
        self._waiting.append((arrival, what))

    def arrived(self, time_s: float) -> list:
        """[what has arrived by time_s [s]], each only once."""
        found = []
        while self._waiting and self._waiting[0][0] <= time_s + 1e-9:
            found.append(self._waiting.popleft()[1])
        return found

    def waiting(self) -> list:
        """[what is on its way], oldest first."""
        return [what for _, what in self._waiting]

    def drop(self) -> None:
        """Lose everything that is on its way."""
        self._waiting.clear()
