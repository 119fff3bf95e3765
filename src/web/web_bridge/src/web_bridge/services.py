# SPDX-License-Identifier: BSD-3-Clause
"""Services both ways: calls of clients, and services that clients offer. No ROS."""
import itertools
import threading
from collections import deque

from web_bridge.errors import BridgeError, ServiceFailed, shown

#: Calls of one client that are under way at a time; further ones wait, up to a number.
MAX_AT_ONCE, MAX_WAITING = 16, 1000
#: Calls of all clients that are under way at a time: services that never answer must not take all threads.
MAX_OF_ALL = 256


class Call:
    """A call that is under way. Whoever waits for its answer says how the wait can be ended."""

    def __init__(self):
        self._lock = threading.Lock()
        self._end = None
        self._is_cancelled = False

    def ends_by(self, end):
        """``end()`` ends the wait. It is called on another thread, or at once if the call is cancelled already."""
        with self._lock:
            self._end = end
            is_late = self._is_cancelled
        if is_late:
            end()

    def cancel(self):
        with self._lock:
            self._is_cancelled, end = True, self._end
        if end is not None:
            end()


class CallPool:
    """Runs the calls of all clients, each in a separate thread, because a service may take as long as it likes."""

    def __init__(self, most_at_once=MAX_AT_ONCE, most_waiting=MAX_WAITING, most_of_all=MAX_OF_ALL):
        self._limits = (most_at_once, most_waiting, most_of_all)
        self._lock = threading.Lock()
        self._running = {}  # client -> set of Call
        self._waiting = {}  # client -> calls

    @property
    def under_way(self):
        """How many calls wait for their answers."""
        with self._lock:
            return sum(map(len, self._running.values()))

    def run(self, client, call):
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

    def forget(self, client):
        """Drop the calls of a client that have not begun, and wait no longer for the answers to the others."""
        with self._lock:
            self._waiting.pop(client, None)
            running = list(self._running.get(client, ()))
        for call in running:
            call.cancel()

    def _work(self, client, call, under_way):
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
    def __init__(self, client, key):
        self.client = client
        self.key = key
        self.done = threading.Event()
        self.answer = None  # (client that answered, worked, values)


class OfferedServices:
    """Services that clients offer to ROS."""

    def __init__(self, graph, codec):
        self._graph = graph
        self._codec = codec
        self._lock = threading.Lock()
        self._offers = {}  # resolved name of the service -> (client, handle)
        self._requests = {}  # id -> _Request
        self._numbers = itertools.count()

    def advertise(self, client, service, type_name):
        """Raises BridgeError, where a node offers the service, for instance. A service of another client goes over to
        this one: a page that was reloaded does not wait for the end of its old connection.
        """
        key = self._graph.resolve(service)
        with self._lock:
            holder, handle = self._offers.pop(key, (None, None))
            if handle is not None:
                handle.close()
                if holder is not client:
                    holder.status("warning", "another client offers the service %s from now on" % service, None)

            def handler(request, new_response):
                return self._ask(client, service, key, request, new_response)
            self._offers[key] = (client, self._graph.advertise_service(service, type_name, handler))

    def unadvertise(self, service):
        """Returns whether a client offered it. Waiting callers get an error."""
        key = self._graph.resolve(service)
        with self._lock:
            _, handle = self._offers.pop(key, (None, None))
            if handle is None:
                return False
            self._give_up(lambda request: request.key == key)
            handle.close()
            return True

    def forget(self, client):
        """Withdraw everything that a client offers."""
        with self._lock:
            mine = [key for key, (holder, _) in self._offers.items() if holder is client]
            self._give_up(lambda request: request.client is client)
            for key in mine:
                self._offers.pop(key)[1].close()

    def answer(self, client, name, worked, values):
        """The answer to request ``name``, whichever client it was sent to. Raises BridgeError where that waits for
        none.
        """
        with self._lock:
            request = self._requests.pop(name, None)
        if request is None:
            raise BridgeError("no service request with id %s waits for an answer" % shown(name))
        request.answer = (client, worked, values)
        request.done.set()

    def _ask(self, client, service, key, request, new_response):
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

    def _give_up(self, concerns):
        for name, request in list(self._requests.items()):
            if concerns(request):
                del self._requests[name]
                request.done.set()
