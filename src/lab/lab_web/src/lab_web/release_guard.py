# SPDX-License-Identifier: BSD-3-Clause
"""Releases the buttons that pages hold when the page's server is killed: nothing else would release them.

A small process beside the server. It reads which buttons are held, a line of JSON for each change, and releases those
of the last line when the server has gone without a word. It loads rospy only then.
"""
from __future__ import annotations

import contextlib
import json
import signal
import sys
from typing import TYPE_CHECKING

from lab_web.child import Child

if TYPE_CHECKING:
    from collections.abc import Iterable


class ReleaseGuard:
    """The server's side; one thread at a time."""

    def __init__(self) -> None:
        # What ends the server's group of processes does not end this one.
        self._process = Child([sys.executable, "-m", "lab_web.release_guard"])

    def pressed(self, names: Iterable[str]) -> None:
        """These buttons are pressed now."""
        self._write(json.dumps(sorted(names)).encode() + b"\n")

    def close(self) -> None:
        """The server has released everything by itself."""
        self.pressed([])
        self._process.end()
        self._process.wait()

    def _write(self, line: bytes) -> None:
        # Where somebody has ended it, the buttons work without it.
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(line)
            self._process.stdin.flush()


def pressed_at_the_end(lines: Iterable[bytes]) -> list[str]:
    """The names in the last whole line; what is cut off counts as not written."""
    names = []
    for line in lines:
        if line.endswith(b"\n"):
            names = json.loads(line)
    return names


def main() -> None:
    """Wait until the server has gone, then release."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    names = pressed_at_the_end(sys.stdin.buffer)
    if names:
        release(names)


def release(names: Iterable[str]) -> None:
    """Release buttons of the simulated robot. Errors go to stderr: nobody else is left to hear them."""
    import rospy
    from bullet_sim_msgs.srv import Press

    from lab_web.robot_parts import PRESS_SERVICE
    proxy = rospy.ServiceProxy(PRESS_SERVICE, Press)
    for name in names:
        try:
            proxy(component=name, action="release", steps=0)
        except (rospy.ServiceException, OSError) as error:
            print("lab_web: %s stays pressed: %s" % (name, error), file=sys.stderr)


if __name__ == "__main__":
    main()
