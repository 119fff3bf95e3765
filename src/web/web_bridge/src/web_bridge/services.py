# SPDX-License-Identifier: BSD-3-Clause
"""Services both ways: calls of clients, and services that clients offer. No ROS."""
from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from web_bridge.errors import BridgeError, ServiceFailed, shown

if TYPE_CHECKING:
    from genpy import Message

    from web_bridge.codec import Codec
    from web_bridge.foxglove.session import FoxgloveSession
    from web_bridge.graph import Closable, Graph
    from web_bridge.session import Session

#: Calls of one client that are under way at a time; further ones wait, up to a number.
MAX_AT_ONCE, MAX_WAITING = 16, 1000
#: Calls of all clients that are under way at a time: services that never answer must not take all threads.
MAX_OF_ALL = 256


class Call:
    """A call that is under way. Whoever waits for its answer says how the wait can be ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._end: Callable[[], None] | None = None
        self._is_cancelled = False

    def ends_by(self, end: Callable[[], None]) -> None:
        """``end()`` ends the wait. It is called on another thread, or at once if the call is cancelled already."""
        with self._lock:
            self._end = end
            is_late = self._is_cancelled
        if is_late:
            end()

    def cancel(self) -> None:
        with self._lock:
            self._is_cancelled, end = True, self._end
        if end is not None:
            end()


class CallPool:
    """Runs the calls of all clients, each in a separate thread, because a service may take as long as it likes."""

    def __init__(self, most_at_once: int = MAX_AT_ONCE, most_waiting: int = MAX_WAITING,
                 most_of_all: int = MAX_OF_ALL) -> None:
        self._limits = (most_at_once, most_waiting, most_of_all)
        self._lock = threading.Lock()
        self._running: dict[object, set[Call]] = {}
        self._waiting: dict[object, deque[Callable[[Call], None]]] = {}

    @property
    def under_way(self) -> int:
        """How many calls wait for their answers."""
        with self._lock:
            return sum(map(len, self._running.values()))

    def run(self, client: Session | FoxgloveSession, call: Callable[[Call], None]) -> None:
        """Call ``call(Call)`` soon. Raises BridgeError where too many calls wait."""
        at_once, most_waiting, of_all = self._limits
        with self._lock:
            if len(self._running.get(client, ())) >= at_once:
                waiting = self._waiting.setdefault(client, deque())
                if len(waiting) >= most_waiting:
                    raise BridgeError("%d service calls of this client wait already" % most_waiting)
                waiting.append(call)
                return
            if sum(map(len, self._running.values())) >= of_all:
                raise BridgeError("%d service calls wait for their answers already" % of_all)
            under_way = Call()
            self._running.setdefault(client, set()).add(under_way)
        threading.Thread(target=self._work, args=(client, call, under_way), daemon=True).start()

    def forget(self, client: Session | FoxgloveSession) -> None:
        """Drop the calls of a client that have not begun, and wait no longer for the answers to the others."""
        with self._lock:
            self._waiting.pop(client, None)
            running = list(self._running.get(client, ()))
        for call in running:
            call.cancel()

    def _work(self, client: Session | FoxgloveSession, call: Callable[[Call], None] | None, under_way: Call) -> None:
        while call is not None:
            try:
                call(under_way)
            finally:
                with self._lock:
                    running, waiting = self._running[client], self._waiting.get(client)
                    running.remove(under_way)
                    call = waiting.popleft() if waiting else None
                    if call is not None:
                        under_way = Call()
                        running.add(under_way)
                    else:
                        self._waiting.pop(client, None)
                        if not running:
                            del self._running[client]


class _Request:
    def __init__(self, client: Session, key: str) -> None:
        self.client = client
        self.key = key
        self.done = threading.Event()
        self.answer: tuple[Session, bool, Any] | None = None  # (client that answered, worked, values)


class OfferedServices:
    """Services that clients offer to ROS."""

    def __init__(self, graph: Graph, codec: Codec) -> None:
        self._graph = graph
        self._codec = codec
        self._lock = threading.Lock()
        self._offers: dict[str, tuple[Session, Closable]] = {}  # by the resolved name of the service
        self._requests: dict[str, _Request] = {}
        self._numbers = itertools.count()

    def advertise(self, client: Session, service: str, type_name: str) -> None:
        """Raises BridgeError, where a node offers the service, for instance. A service of another client goes over to
        this one: a page that was reloaded does not wait for the end of its old connection.
        """
        key = self._graph.resolve(service)
        with self._lock:
            if key in self._offers:
                holder, handle = self._offers.pop(key)
                handle.close()
                if holder is not client:
                    holder.status("warning", "another client offers the service %s from now on" % service, None)

            def handler(request: Message, new_response: Callable[[], Message]) -> Message:
                return self._ask(client, service, key, request, new_response)
            self._offers[key] = (client, self._graph.advertise_service(service, type_name, handler))

    def unadvertise(self, service: str) -> bool:
        """Returns whether a client offered it. Waiting callers get an error."""
        key = self._graph.resolve(service)
        with self._lock:
            _, handle = self._offers.pop(key, (None, None))
            if handle is None:
                return False
            self._give_up(lambda request: request.key == key)
            handle.close()
            return True

    def forget(self, client: Session) -> None:
        """Withdraw everything that a client offers."""
        with self._lock:
            mine = [key for key, (holder, _) in self._offers.items() if holder is client]
            self._give_up(lambda request: request.client is client)
            for key in mine:
                self._offers.pop(key)[1].close()

    def answer(self, client: Session, name: str, worked: bool, values: Any) -> None:
        """The answer to request ``name``, whichever client it was sent to. Raises BridgeError where that waits for
        none.
        """
        with self._lock:
            request = self._requests.pop(name, None)
        if request is None:
            raise BridgeError("no service request with id %s waits for an answer" % shown(name))
        request.answer = (client, worked, values)
        request.done.set()

    def _ask(self, client: Session, service: str, key: str, request: Message,
             new_response: Callable[[], Message]) -> Message:
        """On ROS's thread: the response to a request. Raises ServiceFailed."""
        waiting = _Request(client, key)
        with self._lock:
            if self._offers.get(key, (None,))[0] is not client:
                raise ServiceFailed("the client that offered %s has gone" % service)
            name = "service_request:%s:%d" % (service, next(self._numbers))
            self._requests[name] = waiting
        client.send({"op": "call_service", "id": name, "service": service, "args": self._codec.json.values(request)})
        waiting.done.wait()
        if waiting.answer is None:
            raise ServiceFailed("the client that offered %s has gone" % service)
        answerer, worked, values = waiting.answer
        if not worked:
            raise ServiceFailed(str(values) if values else "the client answered with result false")
        try:
            unread = []
            response = self._codec.reader.fill(new_response(), values, unread)
            answerer.warn_of("the answer to " + service, unread, name)
            return response
        except BridgeError as error:
            answerer.status("error", "the answer to %s: %s" % (service, error), name)
            raise ServiceFailed("the client's answer does not fit: %s" % error) from None

    def _give_up(self, concerns: Callable[[_Request], bool]) -> None:
        for name, request in list(self._requests.items()):
            if concerns(request):
                del self._requests[name]
                request.done.set()
