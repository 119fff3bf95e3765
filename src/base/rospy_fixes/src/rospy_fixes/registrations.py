# SPDX-License-Identifier: BSD-3-Clause
"""A registration with the ROS master that hangs does not hold up the others of its node for ever.

rospy tries a registration until it succeeds, holding the locks of all topics meanwhile. A name that the master cannot
even read, such as one with a control character, is tried for ever, and a master that is stopped is waited for without
end: from then on the node makes no topic, no service and no connection. Here a registration that the master refuses
ends with a line in the log. One that gets no answer is tried for DEADLINE_S, then again and again by a thread, and
those that come meanwhile with it. A node that starts before its master still waits for it in its first registration.
A node that ends takes its leave of the master within ANSWER_S, or goes without.
"""
from __future__ import annotations

import contextlib
import functools
import http.client
import sys
import threading
import time
import xml.parsers.expat
import xmlrpc.client
from typing import Any

import master_calls

#: How long a registration holds up its node [s, wall].
DEADLINE_S = 10.0
#: Longest wait for an answer of the master [s, wall], and between two tries.
ANSWER_S, RETRY_S = 5.0, 0.2

# What the master has understood and refused, or could not read: the next try would end in the same way.
_REFUSALS = (xmlrpc.client.Fault, xml.parsers.expat.ExpatError, ValueError, TypeError, OverflowError)
_NO_ANSWER = (OSError, http.client.HTTPException, xmlrpc.client.ProtocolError)

#: Set while the master does not answer.
_silent = threading.Event()


def amend(module: Any) -> None:
    """Give the registrations of rospy.impl.registration's nodes a deadline, and the question of each subscriber of
    rospy.impl.statistics, whether to keep statistics: it has the locks of all topics meanwhile, too.
    """
    if hasattr(module, "SubscriberStatisticsLogger"):
        module.SubscriberStatisticsLogger.is_enabled = staticmethod(_keeps_statistics)
    else:
        _amend_registrations(module)


def _keeps_statistics():
    import rosgraph
    import rospy

    if _silent.is_set():
        return False
    try:
        code, _, value = master_calls.proxy(rosgraph.get_master_uri(), ANSWER_S).getParam(
            rospy.get_caller_id(), "/enable_statistics")
    except (*_REFUSALS, *_NO_ANSWER):
        return False
    return code == 1 and value


def _amend_registrations(registration):
    manager, kinds = registration.RegManager, registration.Registration
    added, removed, ended = manager.reg_added, manager.reg_removed, manager.cleanup
    methods = {kinds.PUB: "Publisher", kinds.SUB: "Subscriber", kinds.SRV: "Service"}

    @functools.wraps(added)
    def reg_added(self, name, data, kind):
        if not self.master_uri:
            added(self, name, data, kind)  # it says what is wrong
            return
        _late(self, registration).take((methods[kind], name, data))

    @functools.wraps(removed)
    def reg_removed(self, name, data, kind):
        if not self.master_uri:
            removed(self, name, data, kind)
            return
        _late(self, registration).withdraw(methods[kind], name, data)

    @functools.wraps(ended)
    def cleanup(self, reason):
        leave = threading.Thread(target=ended, args=(self, reason), name="last registrations", daemon=True)
        leave.start()
        leave.join(ANSWER_S)
        if leave.is_alive():
            _late(self, registration).say("this program ends, but the ROS master at %s does not answer: it still "
                                          "lists it (rosnode cleanup)" % self.master_uri)

    manager.reg_added, manager.reg_removed, manager.cleanup = reg_added, reg_removed, cleanup


class _Registrar:
    """The registrations of one node: those that are late, in their order, and the thread that tries them again."""

    def __init__(self, manager: Any, registration: Any) -> None:
        self._manager, self._rospy = manager, registration
        self._lock = threading.RLock()  # a signal's handler may run inside
        self._late = []  # of (end of the master's methods, name, type or address of a service)
        self._master, self._is_calling = self._proxy(), threading.Lock()
        self._has_answered = False  # the master, at least once

    def take(self, what: tuple[str, str, str]) -> None:
        """Register within the deadline, or later; the first one whenever the master comes: what rospy.init_node does
        next would fail without it.
        """
        end_s, is_told = time.monotonic() + DEADLINE_S, False
        with self._lock:
            must_wait = bool(self._late)
            if must_wait:
                self._late.append(what)
        while not must_wait and not self._rospy.is_shutdown():
            try:
                self._register(*what)
                return
            except _NO_ANSWER as error:
                if not self._has_answered and not is_told:
                    is_told = True
                    self.say("the ROS master at %s does not answer (%s); this program waits for it"
                              % (self._manager.master_uri, error))
                if not self._has_answered or time.monotonic() < end_s:
                    time.sleep(RETRY_S)
                    continue
                self.say("%s: the ROS master at %s does not answer (%s); it is asked again and again"
                          % (what[1], self._manager.master_uri, error))
            with self._lock:
                self._late.append(what)
            threading.Thread(target=self._try_again, name="late registrations", daemon=True).start()
            return

    def withdraw(self, method: str, name: str, data: str) -> None:
        """Unregister, or forget what is not registered yet."""
        with self._lock:
            late = [what for what in self._late if what[:2] == (method, name)]
            self._late = [what for what in self._late if what not in late]
        if not late:
            self._unregister(method, name, data)

    def _try_again(self):
        while not self._rospy.is_shutdown():
            with self._lock:
                if not self._late:
                    return
                what = self._late[0]
            try:
                self._register(*what)
            except Exception:  # noqa: BLE001  (those behind it must not wait for this one)
                time.sleep(RETRY_S)
                with self._lock:  # the next one has its turn
                    if what in self._late:
                        self._late.remove(what)
                        self._late.append(what)
                continue
            with self._lock:
                is_wanted = what in self._late
                if is_wanted:
                    self._late.remove(what)
            if not is_wanted:  # it was withdrawn in this moment
                self._unregister(*what)

    def _register(self, method, name, data):
        """Raises what _NO_ANSWER has."""
        rospy = self._rospy
        # Where a signal's handler, or the thread, calls in the middle of another call: by a connection of its own.
        is_free = self._is_calling.acquire(blocking=False)
        master = self._master if is_free else self._proxy()
        try:
            code, text, publishers = getattr(master, "register" + method)(rospy.get_caller_id(), name, data,
                                                                          self._manager.uri)
        except _REFUSALS as error:
            code, text, publishers = 0, error, []
        except _NO_ANSWER:
            _silent.set()
            raise
        finally:
            if is_free:
                self._is_calling.release()
        self._has_answered = True
        _silent.clear()
        if code != 1:
            rospy.logerr("%s is not registered, the ROS master refuses it: %s. Names have letters, digits, _ and /, "
                         "and begin with a letter, / or ~", ascii(name)[1:-1], text)
        elif method == "Subscriber":
            self._manager.publisher_update(name, publishers)

    def _unregister(self, method, name, data):
        address = data if method == "Service" else self._manager.uri
        try:
            getattr(self._proxy(), "unregister" + method)(self._rospy.get_caller_id(), name, address)
        except (*_REFUSALS, *_NO_ANSWER) as error:
            self.say("%s is still registered, the ROS master does not answer: %s" % (ascii(name)[1:-1], error))

    def say(self, line: str) -> None:
        """Write to the log file and the terminal alone: for a line on /rosout, rospy may ask the master for a parameter
        first, and wait for its answer without end.
        """
        self._manager.logger.error(line)
        with contextlib.suppress(OSError, ValueError, AttributeError):
            print(line, file=sys.stderr, flush=True)

    def _proxy(self):
        return master_calls.proxy(self._manager.master_uri, ANSWER_S)


def _late(manager, registration):
    notes = vars(manager)
    with contextlib.suppress(KeyError):
        return notes["_registrar"]
    return notes.setdefault("_registrar", _Registrar(manager, registration))
