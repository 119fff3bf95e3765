# SPDX-License-Identifier: BSD-3-Clause
"""The status of /gazebo on /diagnostics: messages and requests that failed, threads and plugins that failed."""
from __future__ import annotations

from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from command_line.options import counted
from gazebo_ros.pacing import ticks_between
from rospy_fixes.ports.threads import STATUS_NAME
from sim_time.stamps import stamp_ns

if TYPE_CHECKING:
    from gazebo_ros.simulation import HostedPlugin, Simulation
    from loop_ros.faults import Faults
    from loop_ros.protocol import LoopRos
    from rospy_fixes.ports.threads import ThreadFaults

RATE_HZ = 1.0
#: Prefix of the names of the statuses.
PREFIX = "gazebo: "
MESSAGES = PREFIX + "messages and requests"
# The hardware_id of all statuses.
_HARDWARE = "simulator"


class Diagnostics:
    """Call :meth:`on_tick` after each tick."""

    def __init__(self, simulation: Simulation, faults: Faults, threads: ThreadFaults, ros: LoopRos) -> None:
        """``faults``: :class:`loop_ros.faults.Faults`; ``threads``: :class:`rospy_fixes.ports.threads.ThreadFaults`."""
        self._simulation = simulation
        self._faults = faults
        self._threads = threads
        self.step_changed()
        self._publisher = ros.publisher("/diagnostics", DiagnosticArray)

    def step_changed(self) -> None:
        """The length of a tick has changed."""
        self._divisor = ticks_between(RATE_HZ, 1.0 / self._simulation.step_s)

    def on_tick(self) -> None:
        """Publish the messages due at this tick."""
        simulation = self._simulation
        if simulation.tick % self._divisor == 0 and self._publisher.has_listeners:
            message = DiagnosticArray(status=self.statuses())
            message.header.stamp = stamp_ns(simulation.time_ns)
            self._publisher.publish(message)

    def statuses(self) -> list[DiagnosticStatus]:
        """List of ``DiagnosticStatus``: one for all dropped messages and requests, one for the threads that serve
        others if one of them met an error, one for each plugin that has ever raised."""
        failed = [hosted for hosted in self._simulation.plugins if hosted.failures]
        return [self._dropped(), *self._restarted(), *map(_status_of, failed)]

    def _dropped(self) -> DiagnosticStatus:
        places = dict(self._faults.places)
        total = sum(fault.count for fault in places.values())
        if not total:
            return DiagnosticStatus(DiagnosticStatus.OK, MESSAGES, "all understood", _HARDWARE, [])
        return DiagnosticStatus(
            DiagnosticStatus.WARN, MESSAGES, "%d could not be digested and were dropped" % total, _HARDWARE,
            [KeyValue(place, "%d, the newest: %s" % (fault.count, fault.text)) for place, fault in places.items()])

    def _restarted(self) -> list[DiagnosticStatus]:
        found = self._threads.summary()
        if found is None:
            return []
        return [DiagnosticStatus(DiagnosticStatus.WARN, PREFIX + STATUS_NAME, found[0], _HARDWARE,
                                 [KeyValue(*row) for row in found[1].items()])]


def _status_of(hosted: HostedPlugin) -> DiagnosticStatus:
    name = "%splugin %s of %s" % (PREFIX, hosted.label, hosted.model_name)
    values = [KeyValue("failures", str(hosted.failures)), KeyValue("newest", hosted.last_error)]
    if hosted.has_failed:
        return DiagnosticStatus(DiagnosticStatus.ERROR, name, "failed; a reset revives it", _HARDWARE, values)
    return DiagnosticStatus(DiagnosticStatus.WARN, name, "works again, after %s" % counted(hosted.failures, "failure"),
                            _HARDWARE,
                            values)
