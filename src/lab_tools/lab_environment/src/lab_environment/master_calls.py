# SPDX-License-Identifier: BSD-3-Clause
"""XML-RPC clients of ROS masters and nodes, with a deadline for each answer.

ROS's own wait without end for a program that takes connections and was stopped.
"""
import xmlrpc.client


def proxy(uri, answer_s):
    """An XML-RPC client; each of its calls raises TimeoutError after `answer_s` [s] without an answer."""
    return xmlrpc.client.ServerProxy(uri, transport=_Transport(answer_s))


def master(caller, uri, answer_s):
    """A ``rosgraph.Master`` at `uri`, asked in the name of the node `caller`; its calls time out as proxy()'s do."""
    import rosgraph  # programs that start ask for a proxy alone

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
