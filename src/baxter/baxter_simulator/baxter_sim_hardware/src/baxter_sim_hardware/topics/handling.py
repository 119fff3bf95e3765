# SPDX-License-Identifier: BSD-3-Clause
"""The handlers of incoming messages, and their order."""
from baxter_model import SIDES
from baxter_sim_hardware.errors import CommandRefused


class Handling:
    """The robot's subscriptions and their handlers."""

    def __init__(self, warnings):
        """warnings: `warnings.Warnings`, for messages that are refused."""
        self._warnings = warnings
        self._topics = {}  # subscription -> (place in the order of handling, key of the row, component, handler)

    def add(self, subscription, place, key, component, handler):
        """Register ``handler(component, message, time_s)``; within a tick, lower places come first."""
        self._topics[subscription] = place, key, component, handler

    def handle(self, pending, time_s):
        """Handle all messages of those subscriptions at time_s [s]; a refusal is logged."""
        for subscription in sorted(pending, key=lambda subscription: self._topics[subscription][0]):
            for message in subscription.drain():
                subscription.guarded(self._call, subscription, message, time_s)

    def drop(self, pending):
        """Drop all messages of those subscriptions; returns the keys of the rows that had some."""
        return [self._topics[subscription][1] for subscription in pending if subscription.drain()]

    def _call(self, subscription, message, time_s):
        _, key, component, handler = self._topics[subscription]
        try:
            handler(component, message, time_s)
        except CommandRefused as refusal:
            limb = "%s limb: " % component if component in SIDES else ""
            self._warnings.warn(time_s, (component, key), "%s%s refused: %s" % (limb, key, refusal))
