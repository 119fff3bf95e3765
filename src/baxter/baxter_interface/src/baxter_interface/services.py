# SPDX-License-Identifier: BSD-3-Clause
"""Calls a service of the robot with a time limit; an error has one line with the reason."""
from __future__ import annotations

import errno
import threading
from typing import Any

import rosgraph
import rospy

from . import startup
from .waiting import others_than

# Longest wait for a service that is not there, and for its answer [s, wall]. The answer takes that long where the robot
# has a small part of a busy machine; rospy's own call would wait without an end.
THERE_S, ANSWER_S = 10.0, 30.0


class ServiceUnavailable(OSError, rospy.ROSException):
    """A service does not exist, or does not answer in time.

    Also a ROSException, which the original SDK raised then.
    """

    def __init__(self, text: str) -> None:
        OSError.__init__(self, errno.ETIMEDOUT, text)


def wait_for_service(name: str, timeout_s: float) -> None:
    """Wait until the service `name` (absolute) answers, `timeout_s` [s, wall] at most. Raises ServiceUnavailable."""
    try:
        rospy.wait_for_service(name, timeout_s)
    except rospy.ROSException as failure:
        raise ServiceUnavailable("there is no service %s after %.0f s%s" % (
            name, timeout_s, others_than(name, _services()))) from failure


def _services() -> list[str]:
    """List the names of the services that the master knows; none if it does not answer."""
    try:
        return [service for service, _ in startup.system_state(rosgraph.Master(rospy.get_name()))[2]]
    except (OSError, rosgraph.MasterException):
        return []


def call_service(name: str, kind: type, *arguments: Any, timeout_s: float | None = None) -> Any:
    """Call the service `name` of type `kind`, waiting for it and then for its answer, `timeout_s` [s, wall] each; by
    default THERE_S and ANSWER_S.

    Raises ServiceUnavailable, OSError with errno EIO if the service refused the call.
    """
    there_s, answer_s = (THERE_S, ANSWER_S) if timeout_s is None else (timeout_s, timeout_s)
    wait_for_service(name, there_s)
    answers, failures = [], []

    def call() -> None:
        try:
            answers.append(rospy.ServiceProxy(name, kind)(*arguments))
        except Exception as failure:  # raised in the caller's thread below
            failures.append(failure)

    # rospy's own call has no time limit: a server that was stopped would hold its clients for ever.
    caller = threading.Thread(target=call, name="call " + name, daemon=True)
    caller.start()
    caller.join(answer_s)
    if answers:
        return answers[0]
    if not failures:
        raise ServiceUnavailable("the service %s did not answer within %.0f s" % (name, answer_s))
    if isinstance(failures[0], rospy.ServiceException):
        raise OSError(errno.EIO, "the service %s failed: %s" % (name, failures[0])) from failures[0]
    raise failures[0]
