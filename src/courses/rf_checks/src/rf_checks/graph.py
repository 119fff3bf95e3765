# SPDX-License-Identifier: BSD-3-Clause
"""Registrations and parameters at the ROS master of the judge's lab, and their changes.

The judge uses rosgraph and is not a node. Every process that reaches a master may register, unregister and set
parameters in any node's name. So a node counts as gone when its process is gone, even if another process has its name.
"""
from __future__ import annotations

import contextlib
import time
import xmlrpc.client
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import rosgraph

import master_calls
from baxter_model import SIDES
from rf_checks.recording import GraphChanges

#: Topics on which programs may publish. A lab with a servo or a trajectory server has nodes that command arms, too.
SHARED_TOPICS = frozenset(("/rosout", "/rosout_agg", "/tf", "/tf_static", "/diagnostics",
                           *("/robot/limb/%s/joint_command" % side for side in SIDES)))
_CALLER = "/lab_judge"
# Time limit for the master's response: a stopped one never answers.
_ANSWER_S = 5.0
# A node ends within this time after a shutdown request [s].
_END_S = 5.0
_NO_ANSWER = (OSError, xmlrpc.client.Error, rosgraph.MasterException)
_KINDS = ("publisher", "subscriber", "service")


class LabFailed(Exception):
    """The judge's own lab does not start or has ended; the text says why."""


class MasterSilent(LabFailed):
    """The ROS master takes connections, but does not answer in time."""


def registrations(state: Iterable[Iterable[tuple[str, list[str]]]]) -> set[tuple[str, str, str]]:
    """{(kind, name, node)} of a master's getSystemState; kind is "publisher", "subscriber" or "service"."""
    return {(kind, name, node) for kind, part in zip(_KINDS, state, strict=True) for name, nodes in part
            for node in nodes}


def flat(parameters: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A tree of parameters as {name: value}; an empty branch counts as a value."""
    found = {}
    for name, value in parameters.items():
        found.update(flat(value, prefix + "/" + name) if isinstance(value, dict) and value else
                     {prefix + "/" + name: value})
    return found


class JudgedGraph:
    """The master at `uri`. Everything registered when `remember` is called belongs to the lab."""

    def __init__(self, uri: str) -> None:
        self._uri = uri
        self._own: frozenset[tuple[str, str, str]] = frozenset()
        self._own_parameters: dict[str, Any] = {}
        self._processes: dict[str, Callable[[], bool]] = {}
        self.own_nodes: frozenset[str] = frozenset()

    def state(self) -> set[tuple[str, str, str]]:
        """The master's registrations, as `registrations` gives them. Raises LabFailed, MasterSilent."""
        return registrations(self._ask("getSystemState"))

    def nodes(self) -> set[str]:
        """Names of all nodes. Raises LabFailed, MasterSilent."""
        return {node for _, _, node in self.state()}

    def services(self) -> set[str]:
        """Names of all services. Raises LabFailed, MasterSilent."""
        return {name for kind, name, _ in self.state() if kind == "service"}

    def remember(self, processes: dict[str, Callable[[], bool]]) -> None:
        """Store the present state as the lab's. processes: {node: function that returns whether its process lives}."""
        self._own = frozenset(self.state())
        self._own_parameters = self._parameters()
        self.own_nodes = frozenset(node for _, _, node in self._own)
        self._processes = {node: lives for node, lives in processes.items() if node in self.own_nodes}

    def changes(self, with_parameters: bool = False) -> GraphChanges:
        """The GraphChanges since `remember`; parameters only on request, since that takes longer. Raises LabFailed."""
        now = self.state()
        topics = {name for kind, name, _ in self._own if kind == "publisher"} - SHARED_TOPICS
        intruders = {}
        for kind, name, node in sorted(now - self._own):
            if kind == "publisher" and name in topics and node not in self.own_nodes:
                intruders.setdefault(name, []).append(node)
        missing = self._ended() | (self.own_nodes - {node for _, _, node in now})
        missing |= self._ending({node for _, _, node in self._own - now} - missing)
        withdrawn = {name for _, name, node in self._own - now if node not in missing}
        changed = []
        if with_parameters:
            parameters = self._parameters()
            changed = sorted(name for name, value in self._own_parameters.items()
                             if name not in parameters or parameters[name] != value)
        return GraphChanges(sorted(missing), intruders, sorted(withdrawn), changed)

    def _ended(self) -> set[str]:
        return {node for node, lives in self._processes.items() if not lives()}

    def _ending(self, nodes: set[str]) -> set[str]:
        """Of the nodes that lack a registration, those that are shutting down: they unregister everything before they
        end."""
        deadline = time.monotonic() + _END_S
        while not nodes <= self._ended() and time.monotonic() < deadline:
            time.sleep(0.02)
        return nodes & self._ended()

    def is_as_it_was(self) -> bool:
        """Whether the state equals the remembered one. Raises LabFailed."""
        return (self.nodes() == self.own_nodes and not self.changes(with_parameters=True)
                and self._parameters().keys() == self._own_parameters.keys())

    def forget_strangers(self) -> None:
        """Unregister ended nodes that were not the lab's, and delete their parameters."""
        with contextlib.suppress(LabFailed, *_NO_ANSWER):
            for kind, name, node in self.state():
                if node in self.own_nodes:
                    continue
                master = self._master(node)  # a node is taken off in its own name
                with contextlib.suppress(rosgraph.MasterError):  # it is gone by now
                    if kind == "service":
                        master.unregisterService(name, master.lookupService(name))
                    elif kind == "publisher":
                        master.unregisterPublisher(name, master.lookupNode(node))
                    else:
                        master.unregisterSubscriber(name, master.lookupNode(node))
            for name in self._parameters().keys() - self._own_parameters.keys():
                self._master().deleteParam(name)

    def _parameters(self) -> dict[str, Any]:
        return flat(self._ask("getParam", "/"))

    def _ask(self, method: str, *words: str) -> Any:
        try:
            return getattr(self._master(), method)(*words)
        except TimeoutError as error:
            raise MasterSilent("the ROS master does not answer") from error
        except _NO_ANSWER as error:
            raise LabFailed("the ROS master is gone: %s" % error) from error

    def _master(self, caller: str = _CALLER):
        return master_calls.master(caller, self._uri, _ANSWER_S)
