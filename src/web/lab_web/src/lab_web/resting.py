# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are read less often while nobody looks: several messages at a time, of which the last one counts.

Each message wakes its thread, and a simulated robot sends hundreds a second: a page's server without a page used 5 % of
a core for them. A class has many such servers.
"""
import time

import rospy

# A message that waited for its thread comes in less time than this after the one before it [s].
_AT_ONCE_S = 0.001


class Rest:
    """Callback of a subscription: holds up the thread that reads its topic for ``rest_s`` [s], while ``is_needed()`` is
    false.

    Not where messages have waited for the thread: they are read to the last one first, so that none becomes old.
    ``clock``, ``sleep`` are replaceable for tests.
    """

    def __init__(self, is_needed, rest_s, clock=time.monotonic, sleep=rospy.rostime.wallsleep):
        self._is_needed, self._rest_s, self._clock, self._sleep = is_needed, rest_s, clock, sleep
        self._last = clock()

    def __call__(self, _message):
        if self._clock() - self._last >= _AT_ONCE_S and not self._is_needed():
            self._sleep(self._rest_s)
        self._last = self._clock()


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
