# SPDX-License-Identifier: BSD-3-Clause
"""Publish each of the robot's topics at its rate, and none without a subscriber."""
import math

from sim_time.pace import Schedule


class Publishing:
    """Topics by rate."""

    def __init__(self, take_snapshot, survived):
        """take_snapshot: function -> `snapshot.Snapshot`; survived: function(what was being done, exception)."""
        self._take_snapshot, self._survived = take_snapshot, survived
        self._groups = {}  # rate of the table's rows -> (Schedule, [(function, component, publisher)])
        self._idle_since_s, self._idle_until_s = math.inf, -math.inf  # between these nothing is due

    def add(self, rate, hz, function, component, publisher):
        """Publish ``function(time_s, component, snapshot)`` at `hz`. rate: the row's, which names the group."""
        group = self._groups.setdefault(rate, (Schedule(hz), []))[1]
        group.append((function, component, publisher))

    def set_rate(self, rate, hz):
        """Publish a group at another rate [Hz]."""
        self._groups[rate][0].set_rate(hz)
        self._idle_until_s = -math.inf

    def publish(self, time_s):
        """Publish the messages that are due at time_s [s]; one that cannot be made is left out. Returns whether one was
        due."""
        if self._idle_since_s <= time_s < self._idle_until_s:
            return False
        snapshot = None
        for schedule, topics in self._groups.values():
            if not schedule.due(time_s):
                continue
            for function, component, publisher in topics:
                if publisher.has_listeners:
                    if snapshot is None:
                        snapshot = self._take_snapshot()
                    try:
                        publisher.publish(function(time_s, component, snapshot))
                    except Exception as error:  # noqa: BLE001  (the robot goes on without one of its topics)
                        self._survived("publishing %s" % publisher.topic, error)
        self._idle_since_s = time_s
        self._idle_until_s = min(schedule.next_s for schedule, _ in self._groups.values())
        return True
