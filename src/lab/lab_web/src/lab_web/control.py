# SPDX-License-Identifier: BSD-3-Clause
"""The page that drives the robot, and whether it still answers. No ROS; times [s] come in as arguments."""
from __future__ import annotations

#: Period of a page's heartbeats [s]; the page gets it from here.
HEARTBEAT_S = 0.04
#: Silence of a page after which what it streams or holds ends [s]: sliders, buttons. With the period of commands it
#: stays below 0.2 s.
SILENCE_S = 0.15
#: Silence of the page's connection after which a motion of one click ends [s]: on a busy machine a browser may be
#: silent that long. Such a motion is slow, and ends by itself where the click said.
CONNECTION_SILENCE_S = 1.0
#: How long the connection of a page speaks for a page that does not answer [s]; the page gets it from here.
PAGE_HANGS_S = 2.0


class NotInControl(Exception):
    """The client may not move the robot now; ``code`` is a key of the page's texts."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Control:
    """At most one client holds the control; a client that takes it takes it from the holder."""

    def __init__(self, silence_s: float = SILENCE_S) -> None:
        self._silence_s = silence_s
        self._heard_s = self._connected_s = 0.0
        #: The client that holds the control, or None.
        self.holder = None

    def take(self, client: int, now_s: float) -> bool:
        """Make ``client`` the holder; returns whether that changed anything."""
        changed = self.holder != client
        self.holder, self._heard_s, self._connected_s = client, now_s, now_s
        return changed

    def release(self, client: int) -> bool:
        """The client gives the control back, or has gone; returns whether it had it."""
        if self.holder != client:
            return False
        self.holder = None
        return True

    def beat(self, client: int, now_s: float, page_answers: bool = True) -> None:
        """A heartbeat of ``client`` has come; of its connection alone where the page does not answer."""
        if self.holder == client:
            self._connected_s = now_s
            if page_answers:
                self._heard_s = now_s

    def is_alive(self, now_s: float) -> bool:
        """Is there a holder, and has its page been heard recently?"""
        return self.holder is not None and now_s - self._heard_s <= self._silence_s

    def is_connected(self, now_s: float) -> bool:
        """Is there a holder, and has its connection been heard recently enough for a motion of one click?"""
        return self.holder is not None and now_s - self._connected_s <= max(self._silence_s, CONNECTION_SILENCE_S)

    def check(self, client: int, now_s: float, is_stream: bool = True) -> None:
        """Raise NotInControl unless ``client`` holds the control and its page is alive, or, for a motion of one click,
        connected.
        """
        if self.holder != client:
            raise NotInControl("not_in_control", "this page does not have the control; press \"Take control\" first")
        if not (self.is_alive(now_s) if is_stream else self.is_connected(now_s)):
            raise NotInControl("page_silent", "no sign of life of this page; try again")
