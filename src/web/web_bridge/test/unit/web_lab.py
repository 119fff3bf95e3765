# SPDX-License-Identifier: BSD-3-Clause
"""Servers on free ports of this machine in front of a fake graph, and clients of another implementation."""
import json
import time

import cbor2
import websocket
from fake_graph import FakeGraph, message_class, now

from lab_testing.waiting import stretched
from web_bridge.access import Access
from web_bridge.codec import Codec
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving
from web_bridge.session import Bridge, BridgeOptions
from web_bridge.websocket import Clients, SocketOptions


class Lab:
    """A server for one protocol; ``client``: the class of its clients."""

    def __init__(self, loop, bridge, options, client, socket=None):
        self.loop, self.bridge = loop, bridge
        self.clients = Clients(bridge, loop, options)
        self.serving = Serving(loop, self.clients.application(socket=socket), 0, "127.0.0.1")
        self._client, self._connected = client, []

    def connect(self, query="", **options):
        url = "ws://127.0.0.1:%d/%s" % (self.serving.port, query)
        client = self._client(websocket.create_connection(url, timeout=stretched(90), **options))
        self._connected.append(client)
        return client

    def forget_all_but_the_first(self):
        """Let go of clients that have ended their connections themselves."""
        self._connected[1:] = []

    def close(self):
        for client in self._connected:
            client.socket.shutdown()
        self.clients.shut_down()
        self.serving.close()
        self.loop.stop()


class AnyClient:
    """The operations of clients of both protocols. ``REASON``: the field with the text of a status."""

    REASON = ""

    def __init__(self, socket):
        self.socket = socket

    def send(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def frame(self):
        """The next frame, text or bytes. Raises WebSocketConnectionClosedException where the server has closed."""
        frame = self.socket.recv()
        if not self.socket.connected:
            raise websocket.WebSocketConnectionClosedException("the server has closed the connection")
        return frame

    def receive(self):
        """The next frame as a dict."""
        raise NotImplementedError

    def until(self, condition):
        """The first frame that fits; others are left out."""
        deadline = time.monotonic() + stretched(90)
        while time.monotonic() < deadline:
            frame = self.receive()
            if condition(frame):
                return frame
        raise AssertionError("no such frame came")

    def echo(self, text="are you there"):
        """A round trip through the server: an unknown op gets an error that names it."""
        self.send(text)
        return self.until(lambda frame: frame["op"] == "status" and text in frame[self.REASON])


class WebLab(Lab):
    def __init__(self, graph=None, access=None, **options):
        self.graph = graph or FakeGraph()
        self.codec = Codec(message_class, now)
        loop = LoopThread()
        bridge = Bridge(self.graph, self.codec, loop.later, BridgeOptions(unregister_timeout=0.1))
        super().__init__(loop, bridge, SocketOptions(access or Access(names=[]), **options), Client)


class Client(AnyClient):
    REASON = "msg"

    def receive(self):
        """The next frame: from JSON, or from CBOR."""
        frame = self.frame()
        return json.loads(frame) if isinstance(frame, str) else cbor2.loads(frame)
