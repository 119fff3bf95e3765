# SPDX-License-Identifier: BSD-3-Clause
"""XML-RPC clients of ROS masters and nodes, with a deadline for each answer.

ROS's own clients wait for ever for a stopped program that still accepts connections.
"""
from __future__ import annotations

import http.client
import xml.parsers.expat
import xmlrpc.client
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import rosgraph

#: All errors of a call: nobody there, not XML-RPC, an error response.
NO_ANSWER = (OSError, http.client.HTTPException, xmlrpc.client.Error, xml.parsers.expat.ExpatError, ValueError)


def proxy(uri: str, answer_s: float) -> Any:
    """An XML-RPC client; each of its calls raises TimeoutError after ``answer_s`` [s] without an answer."""
    return xmlrpc.client.ServerProxy(uri, transport=_Transport(answer_s))


def value(answer: Any) -> Any:
    """The value in a ROS answer (code, text, value). Raises ValueError for a refusal."""
    code, text, found = answer
    if code != 1:
        raise ValueError(text)
    return found


def master(caller: str, uri: str, answer_s: float) -> rosgraph.Master:
    """A ``rosgraph.Master`` at ``uri``, with the caller id ``caller``; its calls time out as those of proxy()."""
    import rosgraph  # imported late: most callers need only a proxy

    found = rosgraph.Master(caller, uri)
    found.handle = proxy(uri, answer_s)
    return found


class _Transport(xmlrpc.client.Transport):
    def __init__(self, answer_s: float) -> None:
        super().__init__()
        self._answer_s = answer_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._answer_s
        return connection
