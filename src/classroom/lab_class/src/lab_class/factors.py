# SPDX-License-Identifier: BSD-3-Clause
"""The real-time factor of each running lab, as its simulator reports it: one rosbridge connection per lab."""
from __future__ import annotations

import asyncio
import json
import math
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tornado import httpclient, iostream, netutil, websocket

if TYPE_CHECKING:
    from pathlib import Path

_SUBSCRIBE = json.dumps({"op": "subscribe", "topic": "/gazebo/performance_metrics", "throttle_rate": 2000,
                         "queue_length": 1, "type": "gazebo_msgs/PerformanceMetrics"})
#: A report with the sensors of a robot is small [bytes].
_LARGEST_REPORT = 256 << 10
_AGAIN_S = 5.0


class _ToSocket(netutil.Resolver):
    """Resolves any host to one socket of this machine."""

    def initialize(self, path: Path) -> None:
        self._path = path

    async def resolve(self, host: str, port: int, family: Any = socket.AF_UNSPEC) -> list[tuple[int, str]]:
        return [(socket.AF_UNIX, str(self._path))]


class Factors:
    """``socket_of(name)``: the path of a lab's socket; ``token_of(name)``: a token with which one may watch it."""

    def __init__(self, socket_of: Callable[[str], Path], token_of: Callable[[str], str]) -> None:
        self._socket_of, self._token_of = socket_of, token_of
        self._tasks, self._factors = {}, {}

    def of(self, name: str) -> None:
        """The last report of a lab, or None."""
        return self._factors.get(name)

    def follow(self, name: str) -> None:
        """Listen to a lab that has begun to answer."""
        self.leave(name)
        self._tasks[name] = asyncio.ensure_future(self._listen(name))

    def leave(self, name: str) -> None:
        """Its processes are about to end."""
        task = self._tasks.pop(name, None)
        if task is not None:
            task.cancel()
        self._factors.pop(name, None)

    async def _listen(self, name: str) -> None:
        # Without the time: the lab's server need not follow the clock for a client that only reads its factor.
        address = "ws://localhost/rosbridge?time=none&token=" + self._token_of(name)
        while True:
            try:
                connection = await websocket.websocket_connect(
                    address, resolver=_ToSocket(path=str(self._socket_of(name))),
                    max_message_size=_LARGEST_REPORT)
                try:
                    await connection.write_message(_SUBSCRIBE)
                    while (message := await connection.read_message()) is not None:
                        factor = factor_of(message)
                        if factor is not None:
                            self._factors[name] = factor
                finally:
                    connection.close()
            except (OSError, httpclient.HTTPClientError, iostream.StreamClosedError, websocket.WebSocketError):
                pass
            self._factors.pop(name, None)
            await asyncio.sleep(_AGAIN_S)


def factor_of(message: str | bytes) -> float | None:
    """The real-time factor in a frame of rosbridge, None for any other frame: a lab is free to send what it likes."""
    try:
        factor = float(json.loads(message)["msg"]["real_time_factor"])
    except (ArithmeticError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return round(factor, 3) if math.isfinite(factor) else None
