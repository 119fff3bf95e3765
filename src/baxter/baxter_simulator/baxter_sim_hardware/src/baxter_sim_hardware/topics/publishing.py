# SPDX-License-Identifier: BSD-3-Clause
"""Publish each of the robot's topics at its rate, and none without a subscriber."""

from __future__ import annotations

import itertools
import math
from functools import partial
from typing import TYPE_CHECKING, Any

from baxter_sim_hardware.message_delay import Late
from sim_time.pace import Schedule

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from baxter_sim_hardware.snapshot import JointSnapshot
    from loop_ros.protocol import Publisher


class Publishing:
    """Topics by rate."""

    def __init__(self, take_snapshot: Callable[[], JointSnapshot], survived: Callable[[str, Exception], None],
                 now_s: Callable[[], float]) -> None:
        """take_snapshot: function -> `snapshot.JointSnapshot`; survived: function(what was being done, exception);
        now_s: function -> simulation time [s]."""
        self._take_snapshot, self._survived, self._now_s = take_snapshot, survived, now_s
        #: {rate of the table's rows: (its schedule, [(function, component, publisher)])}
        self._groups: dict[float | str, tuple[Schedule, list[tuple[Callable, object, Publisher]]]] = {}
        self._late = Late()
        self._delayed: Collection[float | str] = ()
        self._delay_of: Callable[[], float] = lambda: 0.0
        self._newest: dict[Publisher, list[Any]] = {}  # of delayed groups: the messages that were sent last
        self._idle_since_s, self._idle_until_s = math.inf, -math.inf  # between these nothing is due

    def add(self, rate: float | str, hz: float, function: Callable, component: object, publisher: Publisher) -> None:
        """Publish ``function(time_s, component, snapshot)``, a message or a tuple of them, at `hz`, and in a paused
        world once for a new subscriber. rate: the row's, which names the group."""
        group = self._groups.setdefault(rate, (Schedule(hz), []))[1]
        group.append((function, component, publisher))
        publisher.present = partial(self._present, function, component, publisher)

    def delay(self, rates: Collection[float | str], delay_of: Callable[[], float]) -> None:
        """The messages of groups `rates` take delay_of() [s], asked at each time that one is due, until they are
        sent."""
        self._delayed, self._delay_of = rates, delay_of

    def forget(self) -> None:
        """The joints were put elsewhere: drop what is on its way. In a paused world, subscribers get the state of
        now."""
        self._late.drop()
        self._newest.clear()
        for _, topics in self._groups.values():
            for _, _, publisher in topics:
                publisher.renew()

    def set_rate(self, rate: float | str, hz: float) -> None:
        """Publish a group at another rate [Hz]."""
        self._groups[rate][0].set_rate(hz)
        self._idle_until_s = -math.inf

    def publish(self, time_s: float) -> bool:
        """Publish the messages that are due at time_s [s], and those that were on their way; one that cannot be made is
        left out. Returns whether one was due."""
        if self._late:
            for ready in self._late.arrived(time_s):
                self._send([ready])
                self._newest.update(_by_publisher(ready))
        if self._idle_since_s <= time_s < self._idle_until_s:
            return False
        snapshot = None
        for rate, (schedule, topics) in self._groups.items():
            if not schedule.due(time_s):
                continue
            ready = []
            # Mostly nobody listens to any of them: the comprehension takes half the time of a loop.
            for function, component, publisher in [row for row in topics if row[2].has_listeners]:
                if snapshot is None:
                    snapshot = self._take_snapshot()
                try:
                    ready += [(publisher, message)
                              for message in _messages(function(time_s, component, snapshot))]
                except Exception as error:  # noqa: BLE001  (the robot goes on without one of its topics)
                    self._survived("publishing %s" % publisher.topic, error)
            if rate in self._delayed:
                for _, _, publisher in topics:
                    if not publisher.has_listeners:
                        self._newest.pop(publisher, None)
                self._late.send(time_s, self._delay_of(), ready)
            elif ready:
                self._send([ready])
        self._idle_since_s = time_s
        self._idle_until_s = min(schedule.next_s for schedule, _ in self._groups.values())
        return True

    def _present(self, function: Callable, component: object, publisher: Publisher) -> Sequence[Any]:
        if any(publisher is to for ready in self._late.waiting() for to, _ in ready):
            # That comes after the pause, and must not be older.
            return self._newest.get(publisher, ())
        try:
            return _messages(function(self._now_s(), component, self._take_snapshot()))
        except Exception as error:  # noqa: BLE001  (as above)
            self._survived("publishing %s" % publisher.topic, error)
            return ()

    def _send(self, groups: Iterable[Iterable[tuple[Publisher, Any]]]) -> None:
        for publisher, message in itertools.chain.from_iterable(groups):
            try:
                publisher.publish(message)
            except Exception as error:  # noqa: BLE001  (the robot goes on without one of its topics)
                self._survived("publishing %s" % publisher.topic, error)


def _by_publisher(ready: Iterable[tuple[Publisher, Any]]) -> dict[Publisher, list]:
    sent = {}
    for publisher, message in ready:
        sent.setdefault(publisher, []).append(message)
    return sent


def _messages(made: Any) -> tuple:
    return made if isinstance(made, tuple) else (made,)
