# SPDX-License-Identifier: BSD-3-Clause
"""XML-RPC clients of ROS masters and nodes, with a deadline for each answer.

ROS's own clients wait for ever for a stopped program that still accepts connections.
"""
import xmlrpc.client


def proxy(uri, answer_s):
    """An XML-RPC client; each of its calls raises TimeoutError after `answer_s` [s] without an answer."""
    return xmlrpc.client.ServerProxy(uri, transport=_Transport(answer_s))


def master(caller, uri, answer_s):
    """A ``rosgraph.Master`` at `uri`, with the caller id `caller`; its calls time out as those of proxy()."""
    import rosgraph  # imported late: most callers need only a proxy

    found = rosgraph.Master(caller, uri)
    found.handle = proxy(uri, answer_s)
    return found


class _Transport(xmlrpc.client.Transport):
    def __init__(self, answer_s):
        super().__init__()
        self._answer_s = answer_s

    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = self._answer_s
        return connection
