# SPDX-License-Identifier: BSD-3-Clause
"""A client of rosbridge: a thread keeps the newest message of each topic."""
from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import websocket

#: Messages of a queue that nobody takes are dropped, the oldest first.
_QUEUE = 100


class RosbridgeError(ConnectionError):
    """The connection to a rosbridge cannot be made, or has ended; the text has its address and the reason."""


class RosbridgeClient:
    """address: ws://HOST:PORT; timeout_s: for the connection and for each message that is sent. Raises
    RosbridgeError."""

    def __init__(self, address: str, timeout_s: float = 5.0):
        self.address = address
        try:
            self._socket = websocket.create_connection(address, timeout=timeout_s)
            self._socket.settimeout(None)
        except (OSError, ValueError, websocket.WebSocketException) as error:
            raise RosbridgeError("there is no rosbridge at %s: %s" % (address, error)) from error
        self._lock, self._came = threading.Lock(), threading.Condition()
        self._newest: dict[str, tuple[dict[str, Any], float]] = {}
        self._queues: dict[str, deque[dict[str, Any]]] = {}
        self._takes: dict[str, Callable[[dict[str, Any]], bool]] = {}
        self._end = ""
        self._thread = threading.Thread(target=self._read, name="rosbridge", daemon=True)
        self._thread.start()

    def subscribe(self, topic: str, kind: str, throttle_ms: int = 0, queue: bool = False,
                  takes: Callable[[dict[str, Any]], bool] = lambda message: True) -> None:
        """Keep the newest message that `takes` says yes to; queue: and all of them, for `drain`."""
        self._takes[topic] = takes
        if queue:
            self._queues[topic] = deque(maxlen=_QUEUE)
        self._send({"op": "subscribe", "topic": topic, "type": kind, "throttle_rate": throttle_ms,
                    "queue_length": _QUEUE if queue else 1})

    def advertise(self, topic: str, kind: str) -> None:
        """Say that this client publishes a topic."""
        self._send({"op": "advertise", "topic": topic, "type": kind})

    def publish(self, topic: str, message: dict[str, Any]) -> None:
        """Raises RosbridgeError."""
        self._send({"op": "publish", "topic": topic, "msg": message})

    def newest(self, topic: str) -> tuple[dict[str, Any], float] | None:
        """The newest message and its age [s], None before the first. Raises RosbridgeError."""
        with self._came:
            self._require()
            found = self._newest.get(topic)
        return None if found is None else (found[0], time.monotonic() - found[1])

    def drain(self, topic: str) -> list[dict[str, Any]]:
        """All messages since the last call, of a topic with a queue."""
        with self._came:
            queue = self._queues[topic]
            found = list(queue)
            queue.clear()
        return found

    def wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Whether a condition on what came is true within the time. Raises RosbridgeError."""
        end = time.monotonic() + timeout_s
        while not condition():
            left = end - time.monotonic()
            with self._came:
                self._require()
                if left <= 0.0:
                    return False
                self._came.wait(min(left, 0.1))
        return True

    @property
    def is_open(self) -> bool:
        """Whether the connection is there."""
        return not self._end

    def close(self) -> None:
        """End the connection. A second call does nothing."""
        self._end = self._end or "it was closed here"
        self._socket.close()
        self._thread.join(2.0)

    def _require(self):
        if self._end:
            raise RosbridgeError("the connection to %s has ended: %s" % (self.address, self._end))

    def _send(self, operation):
        with self._lock:
            self._require()
            try:
                self._socket.send(json.dumps(operation))
            except (OSError, websocket.WebSocketException) as error:
                self._end = str(error) or type(error).__name__
                self._require()

    def _read(self):
        try:
            while True:
                text = self._socket.recv()
                if not text:
                    raise OSError("the server has closed it")
                said = json.loads(text)
                if said.get("op") == "publish":
                    self._take(said["topic"], said["msg"])
        except Exception as error:  # whoever waits must hear of it, whatever the server sent
            with self._came:
                self._end = self._end or str(error) or type(error).__name__
                self._came.notify_all()

    def _take(self, topic, message):
        takes = self._takes.get(topic)
        if takes is None or not takes(message):
            return
        with self._came:
            self._newest[topic] = message, time.monotonic()
            if topic in self._queues:
                self._queues[topic].append(message)
            self._came.notify_all()
