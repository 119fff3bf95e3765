# SPDX-License-Identifier: BSD-3-Clause
"""Answers from the master's state: (publishers, subscribers, services), each a list of [name, [nodes]]. No ROS."""
from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterable
from typing import Any

#: Publishers, subscribers, services.
State = tuple[list[list[Any]], list[list[Any]], list[list[Any]]]
_OF_AN_ACTION = ("cancel", "feedback", "goal", "result", "status")


def allowed(names: Iterable[str], patterns: tuple[str, ...]) -> list[str]:
    """The names that a pattern allows, sorted; no patterns allow all."""
    return sorted({name for name in names if is_allowed(name, patterns)})


def is_allowed(name: str, patterns: tuple[str, ...]) -> bool:
    return not patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def finite(value: Any) -> Any:
    """A parameter's value with None for NaN and infinities, which JSON does not have."""
    if isinstance(value, dict):
        return {name: finite(part) for name, part in value.items()}
    if isinstance(value, list):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def topics(state: State) -> set[str]:
    return {name for part in state[:2] for name, _ in part}


def services(state: State) -> set[str]:
    return {name for name, _ in state[2]}


def nodes(state: State) -> list[str]:
    """All nodes that publish, subscribe or serve, sorted."""
    return sorted({node for part in state for _, members in part for node in members})


def of_node(state: State, node: str) -> tuple[list[str], list[str], list[str]]:
    """(topics it subscribes to, topics it publishes, its services), each sorted."""
    publishing, subscribing, serving = ([name for name, members in part if node in members] for part in state)
    return sorted(subscribing), sorted(publishing), sorted(serving)


def publishers(state: State, topic: str) -> list[str]:
    return sorted(dict(state[0]).get(topic, []))


def subscribers(state: State, topic: str) -> list[str]:
    return sorted(dict(state[1]).get(topic, []))


def providers(state: State, service: str) -> list[str]:
    return sorted(dict(state[2]).get(service, []))


def action_servers(names: Iterable[str]) -> list[str]:
    """The names under which all topics of an action are."""
    names = set(names)
    bases = {name[:-len("/goal")] for name in names if name.endswith("/goal")}
    return sorted(base for base in bases if all(base + "/" + part in names for part in _OF_AN_ACTION))
