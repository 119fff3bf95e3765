# SPDX-License-Identifier: BSD-3-Clause
"""How a rospy node starts and ends: limits on its ports, parameters that come later, Ctrl-C."""
from __future__ import annotations

import contextlib
import resource
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy

from rospy_fixes import table
from rospy_fixes.ports import limits
from rospy_fixes.ports.shared import FAULTS
from rospy_fixes.ports.threads import STATUS_NAME, ThreadFaults, lasting

_POLL_S, _REMINDER_S = 0.05, 5.0
# Shortest time between two messages about threads [s].
_PUBLISH_S = 1.0
_installed = []


def limit_ports(publishes: bool = True) -> ThreadFaults:
    """Install limits in this process on what others can do to its ports. Call it before ``rospy.init_node``, which
    opens them; a second call changes nothing.

    Returns the errors that threads met. ``publishes``: from the first one on, they are published on /diagnostics.
    """
    if _installed:
        return _installed[0]
    _installed.append(FAULTS)
    threading.excepthook = FAULTS.count_ends(threading.excepthook)
    if publishes:
        threading.Thread(target=lasting(FAULTS, "that publishes on /diagnostics", _publish(FAULTS), _PUBLISH_S),
                         args=(rospy.is_shutdown,), name="thread faults", daemon=True).start()
    _ask_for_files()
    table.amend_nodes()
    return FAULTS


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


def _publish(faults: ThreadFaults) -> Callable[[Callable[[], bool]], None]:
    """The loop of the thread that publishes the errors of threads, if there are any."""
    def publish(ends: Callable[[], bool]) -> None:
        publisher = None
        while not ends():
            faults.news.wait()
            if rospy.core.is_initialized():
                # Imported here: most nodes never need it.
                from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

                publisher = publisher or rospy.Publisher("/diagnostics", DiagnosticArray, latch=True, queue_size=1)
                faults.news.clear()
                text, values = faults.summary() or ("", {})
                name = rospy.get_name()
                message = DiagnosticArray(status=[DiagnosticStatus(
                    DiagnosticStatus.WARN, "%s: %s" % (name, STATUS_NAME), text, name,
                    [KeyValue(*row) for row in values.items()])])
                message.header.stamp = rospy.Time.now()
                publisher.publish(message)
            time.sleep(_PUBLISH_S)
    return publish


def _ask_for_files() -> None:
    """Raise the limit of open files as far as the system allows, up to the useful maximum."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = limits.OPEN_FILES if hard == resource.RLIM_INFINITY else min(limits.OPEN_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
