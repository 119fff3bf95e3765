# SPDX-License-Identifier: BSD-3-Clause
"""Which handler gets a message that has come in, and in which order."""
from baxter_model import SIDES
from baxter_sim_hardware.errors import CommandRefused


class Handling:
    """The queues of the topics that the robot subscribes to, and their handlers."""

    def __init__(self, warnings):
        """warnings: `warnings.Warnings`, for messages that are refused."""
        self._warnings = warnings
        self._topics = {}  # queue -> (place in the order of handling, key of the row, component, handler)

    def add(self, queue, place, key, component, handler):
        """Have ``handler(component, message, time_s)`` called; within a tick those of a lower place come first."""
        self._topics[queue] = place, key, component, handler

    def handle(self, queues, time_s):
        """Handle all messages in those queues at time_s [s]; a refusal is logged."""
        for queue in sorted(queues, key=lambda queue: self._topics[queue][0]):
            for message in queue.drain():
                queue.guarded(self._call, queue, message, time_s)

    def drop(self, queues):
        """Forget all messages in those queues; returns the keys of the rows that had some."""
        return [self._topics[queue][1] for queue in queues if queue.drain()]

    def _call(self, queue, message, time_s):
        _, key, component, handler = self._topics[queue]
        try:
            handler(component, message, time_s)
        except CommandRefused as refusal:
            limb = "%s limb: " % component if component in SIDES else ""
            self._warnings.warn(time_s, (component, key), "%s%s refused: %s" % (limb, key, refusal))
