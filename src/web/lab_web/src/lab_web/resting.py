# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are not read while nobody looks, or less often.

A page's server without a page used 5 % of a core for them. A class has many such servers.
"""
import time

import rospy

from rospy_limits.rest import Rest

# How long topics are still read when nobody needs them any more: a page that is loaded again finds all as it was [s].
LINGER_S = 10.0
# Between two looks at who needs them [s].
_LOOK_S = 0.1


class OnDemand:
    """Calls ``listen()`` when somebody needs it (``is_needed()``), and ``rest()`` when nobody has for LINGER_S.

    What sends the messages saves more than what reads them: a simulator does not even make those without a subscriber.
    ``clock`` is replaceable for tests.
    """

    def __init__(self, listen, rest, is_needed, clock=time.monotonic):
        self._listen, self._rest, self._is_needed, self._clock = listen, rest, is_needed, clock
        self._listens, self._needed_s = False, 0.0

    def look(self):
        """One look at who needs them."""
        if self._is_needed():
            self._needed_s = self._clock()
            if not self._listens:
                self._listen()
                self._listens = True
        elif self._listens and self._clock() - self._needed_s >= LINGER_S:
            self._listens = False
            self._rest()

    def run(self, ends):
        """Look until ``ends()``."""
        while not ends():
            self.look()
            rospy.rostime.wallsleep(_LOOK_S)


def rest(topics, is_needed, rest_s):
    """Let the topics {name: message class} rest while ``is_needed()`` is false and nobody else in this process has
    subscribed to them since: rospy has one connection and one thread for all subscribers of a topic.
    """
    for topic, kind in topics.items():
        shared = []
        subscription = rospy.Subscriber(topic, kind, Rest(_need(is_needed, shared), rest_s), queue_size=1).impl
        shared += [subscription, len(subscription.callbacks)]


def _need(is_needed, shared):
    # rospy may call back before ``shared`` is filled.
    return lambda: is_needed() or not shared or len(shared[0].callbacks) > shared[1]
