# SPDX-License-Identifier: BSD-3-Clause
"""The handlers of incoming messages, and their order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from baxter_model import SIDES
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.message_delay import Late

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from baxter_sim_hardware.warnings import Warnings
    from loop_ros.protocol import Subscription


class _Entry(NamedTuple):
    """place: in the order of handling; key: of the row; late: `Late`, the messages on their way, or None where they
    come at once; number: of the subscription, which names its stream of delays."""

    place: int
    key: str
    component: str | tuple[str, ...] | None
    handler: Callable[[Any, Any, float], None]
    late: Late | None
    number: int


class Handling:
    """The robot's subscriptions and their handlers."""

    def __init__(self, warnings: Warnings, delay_of: Callable[[int], float] | None = None) -> None:
        """warnings: `warnings.Warnings`, for messages that are refused; delay_of: function(number of a stream) -> how
        long what comes now is on its way [s], or None without delays."""
        self._warnings, self._delay_of = warnings, delay_of
        self._topics: dict[Subscription, _Entry] = {}
        self._on_way: list[Subscription] = []  # with messages on their way

    @property
    def waits(self) -> bool:
        """Whether messages are on their way, so that `handle` has to be called."""
        return bool(self._on_way)

    def add(self, subscription: Subscription, place: int, key: str, component: str | tuple[str, ...] | None,
            handler: Callable[[Any, Any, float], None], is_delayed: bool = False) -> None:
        """Register ``handler(component, message, time_s)``; within a tick, lower places come first."""
        late = Late() if is_delayed and self._delay_of is not None else None
        self._topics[subscription] = _Entry(place, key, component, handler, late, len(self._topics) + 1)

    def handle(self, pending: Iterable[Subscription], time_s: float) -> None:
        """Handle all messages of those subscriptions at time_s [s], and those that were on their way; a refusal is
        logged."""
        if self._delay_of is not None:
            pending = self._after_delays(self._delay_of, pending, time_s)
        for subscription in sorted(pending, key=lambda subscription: self._topics[subscription].place):
            late = self._topics[subscription].late
            for message in subscription.drain() if late is None else late.arrived(time_s):
                subscription.guarded(self._call, subscription, message, time_s)
        if self._on_way:
            self._on_way = [subscription for subscription in self._on_way if self._topics[subscription].late]

    def _after_delays(self, delay_of: Callable[[int], float], pending: Iterable[Subscription],
                      time_s: float) -> list[Subscription]:
        """Send off what has come in; the subscriptions that may have messages now, in their own order."""
        at_once = []
        for subscription in pending:
            entry = self._topics[subscription]
            if entry.late is None:
                at_once.append(subscription)
                continue
            if not entry.late:
                self._on_way.append(subscription)
            for message in subscription.drain():
                entry.late.send(time_s, delay_of(entry.number), message)
        return sorted(at_once + self._on_way, key=lambda subscription: self._topics[subscription].number)

    def drop(self, pending: Iterable[Subscription]) -> list[str]:
        """Drop all messages of those subscriptions, and those on their way; returns the keys of the rows that had
        some."""
        self.forget()
        return [self._topics[subscription].key for subscription in pending if subscription.drain()]

    def forget(self) -> None:
        """Drop what is on its way."""
        for subscription in self._on_way:
            late = self._topics[subscription].late
            if late is not None:
                late.drop()
        self._on_way = []

    def _call(self, subscription: Subscription, message: Any, time_s: float) -> None:
        entry = self._topics[subscription]
        try:
            entry.handler(entry.component, message, time_s)
        except CommandRefused as refusal:
            limb = "%s limb: " % entry.component if entry.component in SIDES else ""
            self._warnings.warn(time_s, (entry.component, entry.key), "%s%s refused: %s" % (limb, entry.key, refusal))
