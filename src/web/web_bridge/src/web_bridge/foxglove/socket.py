# SPDX-License-Identifier: BSD-3-Clause
"""A client of the Foxglove WebSocket protocol on tornado."""
from __future__ import annotations

from typing import TYPE_CHECKING

from web_bridge.foxglove.session import FoxgloveSession
from web_bridge.foxglove.wire import SUBPROTOCOLS
from web_bridge.websocket import ClientSocket

if TYPE_CHECKING:
    from web_bridge.foxglove.rules import FoxgloveRules
    from web_bridge.outgoing import OutgoingBuffer

#: A client that has asked for files is served again when at most that much waits for it [bytes].
_ENOUGH_WAITS = 16 << 20


class FoxgloveSocket(ClientSocket):
    """``clients.bridge`` is a FoxgloveBridge, ``clients.options.rules`` are FoxgloveRules."""

    PATHS = r"/(?:foxglove)?"

    def prepare(self) -> None:
        super().prepare()
        offered = self.request.headers.get("Sec-WebSocket-Protocol", "")
        if not self._finished and not set(map(str.strip, offered.split(","))) & set(SUBPROTOCOLS):
            self.set_status(400)
            self.finish("this server speaks %s; the client offers %r\n" % (" and ".join(SUBPROTOCOLS), offered))

    def select_subprotocol(self, subprotocols: list[str]) -> str | None:
        return next((name for name in subprotocols if name in SUBPROTOCOLS), None)

    def new_session(self, rules: FoxgloveRules, outgoing: OutgoingBuffer) -> FoxgloveSession:
        session = FoxgloveSession(self._clients.bridge, outgoing, rules)
        session.open()
        return session

    async def on_message(self, message: str | bytes) -> None:
        await self.wait_for_room(_ENOUGH_WAITS)
        await super().on_message(message)
