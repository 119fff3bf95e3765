# SPDX-License-Identifier: BSD-3-Clause
"""Requests to the supervisor at its control socket."""
from __future__ import annotations

import http.client
import json
import socket
from typing import TYPE_CHECKING, Any

from lab_class.labs import ClassError

if TYPE_CHECKING:
    from lab_class.store import Store

_TIMEOUT_S = 20.0


class NoClass(ClassError):
    """No class runs in this folder."""


class _Connection(http.client.HTTPConnection):
    def __init__(self, path: str) -> None:
        super().__init__("localhost", timeout=_TIMEOUT_S)
        self._path = path

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self._path)


def call(store: Store, method: str, path: str) -> Any:
    """The answer of the supervisor of this store.Store, as data (None for an empty one).

    Raises NoClass, and ClassError with the supervisor's words where it refuses.
    """
    running = store.running()
    if "control" not in running:
        raise NoClass("no class runs in %s; %s starts one" % (store.folder, store.command("up N")))
    connection = _Connection(running["control"])
    try:
        connection.request(method, path)
        answer = connection.getresponse()
        text = answer.read().decode()
    except TimeoutError:
        raise ClassError("the class in %s did not answer within %g s; is the machine overloaded?"
                         % (store.folder, _TIMEOUT_S)) from None
    except OSError as error:
        raise NoClass("no class runs in %s any more (%s); %s starts it again"
                      % (store.folder, error, store.command("up"))) from error
    finally:
        connection.close()
    if answer.status >= 400:
        raise ClassError(text.strip() or "the supervisor answered %d" % answer.status)
    return json.loads(text) if text else None
