# SPDX-License-Identifier: BSD-3-Clause
"""Where a leader's messages come from: another ROS master, or a rosbridge. Each in a thread that tries again."""
from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tornado.websocket import websocket_connect

from steering_devices.leader import topics_of

#: Called with topic and message, as dicts.
Take = Callable[[str, Mapping[str, Any]], None]
_AGAIN_S, _THROTTLE_MS = 1.0, 10


class LeaderAddressError(ValueError):
    """An address of no leader, with what would be right."""


def follow(address: str, sides: Sequence[str], take: Take, tell: Callable[[str], None]) -> Callable[[], None]:
    """Call ``take`` with the messages of the robot at ``address``, http:// of its master or ws:// of a rosbridge, in a
    thread, and ``tell`` when it is lost; return what ends that. Raises LeaderAddressError."""
    kinds = {"http": _from_master, "ws": _from_rosbridge, "wss": _from_rosbridge}
    kind = kinds.get(address.partition("://")[0])
    if kind is None:
        raise LeaderAddressError("a leader's address is http://HOST:11311 of its master or ws://HOST:9090 of its "
                                 "rosbridge, got '%s'" % address)
    ended = threading.Event()

    def run() -> None:
        while not ended.is_set():
            try:
                kind(address, sides, take, ended)
            except Exception as error:  # whatever another robot's server answers; the leader may come back
                tell("the leader at %s is lost: %s: %s; trying again" % (address, type(error).__name__, error))
            ended.wait(_AGAIN_S)

    thread = threading.Thread(target=run, name="leader", daemon=True)
    thread.start()

    def end() -> None:
        ended.set()
        thread.join()
    return end


def _from_master(address: str, sides: Sequence[str], take: Take, ended: threading.Event) -> None:
    """A process joins the other master: a node of ROS 1 knows one master alone."""
    relay = subprocess.Popen([sys.executable, "-m", "steering_devices.leader_relay", *sides], stdout=subprocess.PIPE,
                             stdin=subprocess.PIPE, text=True, env={**os.environ, "ROS_MASTER_URI": address})
    watch = threading.Thread(target=lambda: (ended.wait(), relay.terminate()), daemon=True)
    watch.start()
    try:
        for line in relay.stdout or ():
            heard = json.loads(line)
            take(heard["topic"], heard["msg"])
    finally:
        relay.kill()
        relay.wait()
    if not ended.is_set():
        raise OSError("its relay ended with %s" % relay.returncode)


def _from_rosbridge(address: str, sides: Sequence[str], take: Take, ended: threading.Event) -> None:
    async def listen() -> None:
        connection = await websocket_connect(address, connect_timeout=_AGAIN_S)
        for topic, kind in topics_of(sides).items():
            await connection.write_message(json.dumps({
                "op": "subscribe", "topic": topic, "type": kind, "queue_length": 1,
                "throttle_rate": _THROTTLE_MS if topic.endswith("joint_states") else 0}))
        try:
            reading: Any = None
            while not ended.is_set():
                reading = reading or asyncio.ensure_future(connection.read_message())
                if not (await asyncio.wait([reading], timeout=0.2))[0]:
                    continue
                text, reading = reading.result(), None
                if text is None:
                    raise OSError("its rosbridge has closed the connection")
                heard = json.loads(text)
                if heard.get("op") == "publish":
                    take(heard["topic"], heard["msg"])
        finally:
            connection.close()

    asyncio.run(listen())


def stamped(take: Callable[[str, Mapping[str, Any], float], None]) -> Take:
    """``take`` with the time of now."""
    return lambda topic, message: take(topic, message, time.monotonic())
