# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are read less often while nobody needs them: several messages at a time, of which the last one counts.

Each message wakes its thread, and a simulated robot sends hundreds a second. Without ROS.
"""
import threading
import time

# A message that waited for its thread comes in less time than this after the one before it [s].
_AT_ONCE_S = 0.001


class Rest:
    """Callback of a subscription: holds up the thread that reads its topic for ``rest_s`` [s], while ``is_needed()`` is
    false.

    Not where messages have waited for the thread: they are read to the last one first, so that none becomes old.
    ``clock``, ``sleep`` are replaceable.
    """

    def __init__(self, is_needed, rest_s, clock=time.monotonic, sleep=time.sleep):
        self._is_needed, self._rest_s, self._clock, self._sleep = is_needed, rest_s, clock, sleep
        self._last = clock()

    def __call__(self, _message):
        if self._clock() - self._last >= _AT_ONCE_S and not self._is_needed():
            self._sleep(self._rest_s)
        self._last = self._clock()


class Demand:
    """Whether a topic is needed: from a call of :meth:`need` for ``linger_s`` [s]. ``is_needed``, ``sleep``: for a
    :class:`Rest`, whose sleep ends when the topic is needed.

    ``clock`` is replaceable for tests.
    """

    def __init__(self, linger_s, clock=time.monotonic):
        self._linger_s, self._clock = linger_s, clock
        self._needed_until = -float("inf")
        self._woken = threading.Event()

    def is_needed(self):
        return self._clock() < self._needed_until

    def need(self):
        """Any thread: somebody needs it from now on. Returns whether nobody did before, so that messages may be
        unread."""
        rested = not self.is_needed()
        self._needed_until = self._clock() + self._linger_s
        self._woken.set()
        return rested

    def sleep(self, seconds):
        """The thread that reads: sleep so long [s], or until :meth:`need`."""
        self._woken.clear()
        if not self.is_needed():
            self._woken.wait(seconds)
