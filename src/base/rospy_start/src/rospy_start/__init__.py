# SPDX-License-Identifier: BSD-3-Clause
"""How a rospy node starts and ends: parameters that come later, Ctrl-C."""
from __future__ import annotations

import signal
import threading
import time
from typing import Any

import rospy

_POLL_S, _REMINDER_S = 0.05, 5.0


class MissingParameter(Exception):
    """A parameter that did not come; the text names it and says what sets it."""


def wait_for_param(name: str, timeout_s: float, search: bool = False) -> Any:
    """Return a parameter that may be set a little later than this node starts; with ``search`` also that of a namespace
    above, the nearest one.

    Waits for ``timeout_s`` of wall time at most. Raises MissingParameter after that, and where the node is ended.
    """
    begin = told = time.monotonic()
    while not rospy.is_shutdown():
        found = rospy.search_param(name) if search else name
        if found and rospy.has_param(found):
            return rospy.get_param(found)
        now = time.monotonic()
        if now - begin > timeout_s:
            break
        if now - told > _REMINDER_S:
            rospy.loginfo("waiting for parameter %s", rospy.resolve_name(name))
            told = now
        time.sleep(_POLL_S)
    raise MissingParameter("parameter %s is not set; load the robot first, e.g. with load_robot_description:=true"
                           % rospy.resolve_name(name))


def end_on_signals() -> None:
    """End the node on Ctrl-C and SIGTERM; for nodes that call ``rospy.init_node`` with ``disable_signals``.

    From a separate thread: where the main thread is interrupted it may hold a lock of rospy's that the shutdown waits
    for, and rospy's own handler would then wait for ever. Before ``rospy.init_node`` has made the node, the signal ends
    the program.
    """
    def end(number: int, _frame: object) -> None:
        if not rospy.core.is_initialized():  # init_node would tell of an error, or go on
            raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(128 + number)
        threading.Thread(target=rospy.signal_shutdown, args=("signal %d" % number,)).start()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
