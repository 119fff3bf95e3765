# SPDX-License-Identifier: BSD-3-Clause
"""Ends the thread of a node's XML-RPC server with the node.

rosgraph closes the server's socket and does not tell the server, which waits for requests on it. Such a wait returns at
once, so the thread takes a whole core for as long as the process lives: a notebook's kernel whose node has ended.
"""
from __future__ import annotations

import contextlib
import functools
import threading
from typing import Any


def amend(xmlrpc: Any) -> None:
    """Make rosgraph.xmlrpc's nodes end their server's loop when they shut down; it ends within 0.5 s."""
    close = xmlrpc.XmlRpcNode.shutdown

    @functools.wraps(close)
    def shutdown(self, reason):
        server = self.server
        close(self, reason)
        if server is not None:
            # It waits for the loop, which may be the one that called. At the interpreter's end no thread can start.
            with contextlib.suppress(RuntimeError):
                threading.Thread(target=server.shutdown, name="end of an XML-RPC server", daemon=True).start()

    xmlrpc.XmlRpcNode.shutdown = shutdown
