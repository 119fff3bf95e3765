# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are not read while nobody looks.

A page's server without a page used 5 % of a core for them. A class has many such servers.
"""
import time

import rospy

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
