# SPDX-License-Identifier: BSD-3-Clause
"""Detects whether a simulator is starting, from the ROS master and its roslaunch. Needs no rospy, no node.

A simulator is starting if:

- a roslaunch runs a process of the simulator, or one that spawns a model, which has not registered with the master yet;
- the simulator's node is registered and does not publish /clock yet;
- a node is spawning a model: gazebo_ros's spawn_model registers as a publisher of SPAWNING meanwhile.
"""
from __future__ import annotations

import socket
from collections.abc import Iterator
from urllib.parse import urlparse

import master_calls

# Gazebo's own name, which launch files give its node.
SIMULATOR = "/gazebo"
CLOCK = "/clock"
# A topic without messages; a registered publisher means that a spawn is in progress.
SPAWNING = "/gazebo/spawning"
# Longest wait for one answer [s].
ANSWER_TIMEOUT_S = 2.0


class SimulatorDied(OSError):
    """A starting simulator has ended; the text says which and what to do."""


class StartWatch:
    """Watches the start of a simulator at the master `uri`; `caller` is the caller id for the master."""

    def __init__(self, uri: str, caller: str = "/simulator_start") -> None:
        self._uri = uri
        self._caller = caller
        self._is_known = False

    def look(self) -> list[str]:
        """Return the names of starting processes and nodes; raises SimulatorDied if one of them has ended."""
        try:
            graph = MasterGraph(self._uri, self._caller)
        except master_calls.NO_ANSWER as error:
            if self._is_known:
                raise SimulatorDied("the simulator ended while it was waited for: the ROS master at %s is gone (%s). "
                                    "Its terminal says why; start it again" % (self._uri, error)) from error
            return []
        names = starting(graph)
        if SIMULATOR in graph.nodes:
            if graph.is_alive(SIMULATOR):
                self._is_known = True
            elif self._is_known:
                raise SimulatorDied("the simulator (%s) ended while it was waited for. Its terminal says why; start it "
                                    "again" % SIMULATOR)
        elif self._is_known and SIMULATOR not in names:
            raise SimulatorDied("the simulator (%s) was stopped while it was waited for; start it again" % SIMULATOR)
        return names


def starting(graph: MasterGraph) -> list[str]:
    """The names of the processes and nodes that are starting, sorted."""
    names = {name for name in graph.processes() if name not in graph.nodes and _is_of_a_start(name)}
    if SIMULATOR in graph.nodes and not graph.published.get(CLOCK) and graph.is_alive(SIMULATOR):
        names.add(SIMULATOR)
    names |= {node for node in graph.published.get(SPAWNING, ()) if graph.is_alive(node)}
    return sorted(names)


def _is_of_a_start(process: str) -> bool:
    return process == SIMULATOR or "spawn" in process


class MasterGraph:
    """The state of the master at one moment. Attributes: `published` {topic: [node]}, `nodes` {node}."""

    def __init__(self, uri: str, caller: str) -> None:
        self._caller = caller
        self._master = master_calls.proxy(uri, ANSWER_TIMEOUT_S)
        self.published, subscribed, services = (
            dict(part) for part in master_calls.value(self._master.getSystemState(caller)))
        self.nodes = {node for part in (self.published, subscribed, services) for nodes in part.values()
                      for node in nodes}

    def processes(self) -> Iterator[str]:
        """Names of the processes that every roslaunch of this master runs now, with a leading slash."""
        try:
            launches = master_calls.value(self._master.getParam(self._caller, "/roslaunch/uris"))
        except master_calls.NO_ANSWER:
            return
        for uri in launches.values() if isinstance(launches, dict) else ():
            # An ended roslaunch leaves its parameter behind.
            try:
                running, _ended = master_calls.value(master_calls.proxy(uri, ANSWER_TIMEOUT_S).list_processes())
                names = ["/" + name.rpartition("-")[0] for name, _starts in running]
            except (*master_calls.NO_ANSWER, TypeError):
                continue
            yield from names

    def is_alive(self, node: str) -> bool:
        """Whether the node's registered address accepts connections: the node may be too busy to answer."""
        try:
            address = urlparse(master_calls.value(self._master.lookupNode(self._caller, node)))
            socket.create_connection((address.hostname, address.port), timeout=ANSWER_TIMEOUT_S).close()
        except master_calls.NO_ANSWER:
            return False
        return True

