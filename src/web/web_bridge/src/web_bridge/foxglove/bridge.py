# SPDX-License-Identifier: BSD-3-Clause
"""State that all Foxglove clients share: channels, parameters, time, and the thread that looks at the graph. No ROS."""
from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from web_bridge.access import is_token, without_tokens
from web_bridge.errors import BridgeError
from web_bridge.foxglove import wire
from web_bridge.foxglove.assets import Assets
from web_bridge.foxglove.catalogue import NOTHING, Catalogue, CatalogueChanges, graph_update, is_different
from web_bridge.foxglove.channel_feeds import ChannelFeeds
from web_bridge.foxglove.parameters import shown_parameter
from web_bridge.foxglove.rules import FoxgloveRules
from web_bridge.publications import Publications
from web_bridge.services import CallPool

if TYPE_CHECKING:
    from web_bridge.codec import Codec
    from web_bridge.feeds import Arrival
    from web_bridge.foxglove.session import FoxgloveSession
    from web_bridge.graph import SubscribedTopic, WatchedGraph
    from web_bridge.loop_thread import Later

_LOG = logging.getLogger("web_bridge")
_CLOCK = "/clock"
#: The graph is looked at again after this time where it has changed; then ever more rarely [s].
_FIRST_LOOK_S, _SHORTEST_LOOK_S = 0.2, 0.05
#: Between two frames with the time [s].
_TIME_EVERY_S = 0.01


class FoxgloveOptions(NamedTuple):
    """``name``, ``session_id``, ``metadata``: for serverInfo. ``longest_look_s``: the graph is looked at at least that
    often. ``sim_time``: clients are sent the time of /clock. ``linger_s``: a publisher stays that long after its last
    client.
    """

    name: str = "foxglove_bridge"
    session_id: str = ""
    metadata: dict = {}  # noqa: RUF012 (never changed)
    longest_look_s: float = 5.0
    sim_time: bool = False
    linger_s: float = 10.0


class FoxgloveBridge:
    """``rules``: FoxgloveRules. ``close()`` ends its thread."""

    def __init__(self, graph: WatchedGraph, codec: Codec, later: Callable[[float, Callable[[], None]], Later],
                 rules: FoxgloveRules | None = None, options: FoxgloveOptions | None = None) -> None:
        self.options = options or FoxgloveOptions()
        self.rules = rules or FoxgloveRules()
        self.graph = graph
        self.codec = codec
        self.assets = Assets(graph.package_folder)
        self.feeds = ChannelFeeds(graph)
        self.publications = Publications(graph, codec, later, self.options.linger_s)
        self.calls = CallPool()
        self.catalogue = Catalogue(self.rules, graph.message_schema, graph.service_schema)
        self._later = later
        self._lock = threading.Lock()
        self._clients = set()
        self._graph_clients = set()
        self._parameter_clients = {}  # name -> clients
        self._watched = set()  # names that the graph tells changes of
        self._known = []  # frames for a new client
        self._state = NOTHING
        self._clock: SubscribedTopic | None = None
        self._time_ns = None
        self._time_waits = False
        self._told = set()
        self._wake = threading.Event()
        self._closing = threading.Event()
        graph.on_parameter(self._parameter_changed)
        self._thread = threading.Thread(target=self._watch, name="foxglove graph", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._wake.set()

    def look_soon(self) -> None:
        """Look at the graph without waiting for the next time."""
        self._wake.set()

    # Clients

    def add(self, client: FoxgloveSession) -> None:
        """A new client: send it what is known, and look for what is new."""
        with self._lock:
            self._clients.add(client)
            self._tell([client], self._known)
            if self._time_ns is not None:
                client.send_time(wire.time_frame(self._time_ns))
        self.look_soon()

    def remove(self, client: FoxgloveSession) -> None:
        with self._lock:
            self._clients.discard(client)
            self._graph_clients.discard(client)
            for clients in self._parameter_clients.values():
                clients.discard(client)
        self.look_soon()

    def follow_graph(self, client: FoxgloveSession) -> None:
        """Send the whole connection graph, and from now on its changes."""
        with self._lock:
            if client not in self._graph_clients:
                self._graph_clients.add(client)
                client.send("connectionGraphUpdate", **graph_update(NOTHING, self._state))

    def leave_graph(self, client: FoxgloveSession) -> None:
        with self._lock:
            self._graph_clients.discard(client)

    # Parameters

    def parameters(self) -> dict[str, Any]:
        """The tree of all parameters that clients may know. Raises BridgeError."""
        return without_tokens(self.graph.parameters())

    def watch_parameters(self, client: FoxgloveSession, names: list[str]) -> None:
        """Tell a client changes of parameters (absolute names). Raises BridgeError."""
        for name in names:
            with self._lock:
                self._parameter_clients.setdefault(name, set()).add(client)
                is_watched = name in self._watched
            if not is_watched:
                self.graph.watch_parameter(name)
                self._watched.add(name)

    def leave_parameters(self, client: FoxgloveSession, names: set[str]) -> None:
        with self._lock:
            for name in names:
                self._parameter_clients.get(name, set()).discard(client)

    def tell_parameter(self, name: str, value: Any) -> None:
        """Send a parameter's value to the clients that watch it; ``{}``: it is no longer set."""
        with self._lock:
            clients = list(self._parameter_clients.get(name, ()))
        if is_token(name):
            return
        parameter = {"name": name} if value == {} else shown_parameter(name, value)
        if clients and parameter is not None:
            for client in clients:
                client.send("parameterValues", parameters=[parameter])

    def _parameter_changed(self, name: str, value: float) -> None:
        # On a thread that holds rospy's lock.
        self._later(0.0, lambda: self.tell_parameter(name.rstrip("/"), value))

    # The graph

    def _watch(self) -> None:
        delay_s = _FIRST_LOOK_S
        while not self._closing.is_set():
            with self._lock:
                is_wanted = bool(self._clients)
            self._wake.wait(delay_s if is_wanted else None)
            was_asked = self._wake.is_set()
            # Clients that come and go all the time do not keep the master busy.
            if self._closing.wait(_SHORTEST_LOOK_S):
                return
            self._wake.clear()
            try:
                changes = self._look() if self._follow_clock() else None
            # A fault of ours must not end the thread.
            except Exception:
                _LOG.exception("looking at the graph failed")
                changes = None
            delay_s = _FIRST_LOOK_S if changes or was_asked else min(2 * delay_s, self.options.longest_look_s)

    def _look(self) -> CatalogueChanges | None:
        try:
            changes = self.catalogue.look(self.graph.state())
        except BridgeError as error:
            self._warn(str(error))
            return None
        for problem in changes.problems:
            self._warn(problem)
        if not changes:
            return None
        known = _texts(CatalogueChanges(channels=tuple(self.catalogue.channels.values()),
                                        services=tuple(self.catalogue.services.values())))
        news = _texts(changes)
        # A client that comes at this moment gets each channel once: known before, or new.
        with self._lock:
            self._known, self._state = known, self.catalogue.state
            self._tell(self._clients, news)
            if is_different(changes.graph):
                for client in self._graph_clients:
                    client.send("connectionGraphUpdate", **changes.graph)
        self.feeds.drop(changes.gone_channels)
        return changes

    @staticmethod
    def _tell(clients: list[FoxgloveSession] | set[FoxgloveSession], news: list[tuple[str | None, str]]) -> None:
        for client in clients:
            for capability, text in news:
                if capability is None or client.has(capability):
                    client.send_text(text)

    def _warn(self, text: str) -> None:
        # The same reason once, not with each look.
        if text not in self._told and len(self._told) < 1000:
            self._told.add(text)
            _LOG.warning("%s", text)

    # Time

    def _follow_clock(self) -> bool:
        """Hear /clock as long as there are clients; returns whether there are any."""
        with self._lock:
            is_wanted = bool(self._clients)
        if self.options.sim_time and is_wanted and self._clock is None:
            self._clock = self.graph.subscribe(_CLOCK, self._clock_arrived)
        elif not is_wanted and self._clock is not None:
            self._clock.close()
            self._clock: SubscribedTopic | None = None
            self._time_ns = None
        return is_wanted

    def _clock_arrived(self, arrival: Arrival) -> None:
        time_ns = wire.time_of_clock(arrival.data)
        with self._lock:
            is_first, self._time_ns = not self._time_waits, time_ns
            self._time_waits = True
        if is_first:
            self._later(_TIME_EVERY_S, self._send_time)

    def _send_time(self) -> None:
        with self._lock:
            self._time_waits = False
            clients = list(self._clients)
            time_ns = self._time_ns
        if time_ns is not None:
            frame = wire.time_frame(time_ns)
            for client in clients:
                client.send_time(frame)


def _texts(changes: CatalogueChanges) -> list[tuple[str | None, str]]:
    """[(capability that a client needs, frame)] of CatalogueChanges."""
    found = [
        (None, "unadvertise", "channelIds", changes.gone_channels),
        (None, "advertise", "channels", [one.advertised() for one in changes.channels]),
        ("services", "unadvertiseServices", "serviceIds", changes.gone_services),
        ("services", "advertiseServices", "services", [one.advertised() for one in changes.services])]
    return [(capability, wire.text(op, **{name: values})) for capability, op, name, values in found if values]
