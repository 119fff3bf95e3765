# SPDX-License-Identifier: BSD-3-Clause
"""Who drives the robot, and whether that page still answers. No ROS; times [s] come in as arguments."""

#: Period of a page's heartbeats [s]; the page gets it from here.
HEARTBEAT_S = 0.04
#: Silence after which the arms are stopped [s]. With the period of the commands it stays below 0.2 s.
SILENCE_S = 0.15


class NotInControl(Exception):
    """The client may not move the robot now; ``code`` is a key of the page's texts."""

    def __init__(self, code, text):
        super().__init__(text)
        self.code = code


class Control:
    """At most one client holds the control; a client that takes it takes it from the holder."""

    def __init__(self, silence_s=SILENCE_S):
        self._silence_s = silence_s
        self._heard_s = 0.0
        #: The client that holds the control, or None.
        self.holder = None

    def take(self, client, now_s):
        """Make ``client`` the holder; returns whether that changed anything."""
        changed = self.holder != client
        self.holder, self._heard_s = client, now_s
        return changed

    def release(self, client):
        """The client gives the control back, or has gone; returns whether it had it."""
        if self.holder != client:
            return False
        self.holder = None
        return True

    def beat(self, client, now_s):
        """A heartbeat of ``client`` has come."""
        if self.holder == client:
            self._heard_s = now_s

    def is_alive(self, now_s):
        """Is there a holder, and has its page been heard recently?"""
        return self.holder is not None and now_s - self._heard_s <= self._silence_s

    def check(self, client, now_s):
        """Raise NotInControl unless ``client`` holds the control and its page is alive."""
        if self.holder != client:
            raise NotInControl("not_in_control", "this page does not have the control; press \"Take control\" first")
        if not self.is_alive(now_s):
            raise NotInControl("page_silent", "no sign of life of this page for %g s; try again" % self._silence_s)
