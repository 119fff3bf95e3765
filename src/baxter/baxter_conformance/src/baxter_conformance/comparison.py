# SPDX-License-Identifier: BSD-3-Clause
"""Compares each item of a physical robot's interface with the observed interface. No ROS needed."""
from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from enum import Enum
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from baxter_model.interface import group_of

from .contents import wrong_with_message, wrong_with_parameter

if TYPE_CHECKING:
    from baxter_model.interface import Interface

# A physical robot powers two of its three cameras; which ones are open is up to programs.
ANY_OF = {"/cameras/right_hand_camera": "/cameras/*_camera"}
# Topics on which a robot may send no messages: logs, notices of changes, and output that a program has requested.
MAY_BE_SILENT = ("/rosout*", "/hdraw", "/tf_static", "/robot/urdf", "/cameras/*", "/tf2_web_republisher/*")


class Verdict(Enum):
    """How an item was found."""

    MET = "met"
    MISSING = "missing"
    OTHER = "other than expected"


@dataclass(frozen=True)
class ConformanceFinding:
    """One item. is_public: can programs that are not the vendor's use it? reason: why it is not MET."""

    group: str
    name: str
    verdict: Verdict
    is_public: bool
    reason: str = ""


@dataclass
class SeenInterface:
    """The observed interface of a master and its nodes.

    published, listened: {topic: type, "" if unknown}. services: {name: type, None if the node does not answer}.
    parameters: {name: value}. frames: names in tf. links: names in robot_description. heard: {topic: newest message,
    None if none came in time}, for the subscribed topics.
    """

    published: dict = field(default_factory=dict)
    listened: dict = field(default_factory=dict)
    services: dict = field(default_factory=dict)
    parameters: dict = field(default_factory=dict)
    frames: set = field(default_factory=set)
    links: tuple = ()
    heard: dict = field(default_factory=dict)


def alternatives(name: str, topics: dict[str, str]) -> list[str]:
    """The observed topics that count as `name`."""
    for fixed, pattern in ANY_OF.items():
        if name.startswith(fixed + "/"):
            return sorted(topic for topic in topics if fnmatchcase(topic, pattern + name[len(fixed):]))
    return [name] if name in topics else []


def may_be_silent(topic: str) -> bool:
    """Whether a topic may have no messages."""
    return any(fnmatchcase(topic, pattern) for pattern in MAY_BE_SILENT)


def compare(robot: Interface, seen: SeenInterface) -> list[ConformanceFinding]:
    """Return a ConformanceFinding for each item of `robot` (baxter_model.interface.Interface); seen is a
    SeenInterface."""
    findings = []

    def add(group: str, name: str, kind: str | None, problem) -> None:
        verdict, reason = problem or (Verdict.MET, "")
        findings.append(ConformanceFinding(group, name, verdict, robot.is_public(kind), reason))

    for name, kind in robot.published.items():
        add(group_of(name), name, kind, _topic(name, kind, seen.published, "nobody publishes it")
            or _silence(name, seen))
    for name, kind in robot.listened.items():
        add(group_of(name), name, kind, _topic(name, kind, seen.listened, "nobody listens to it"))
    for name, kind in robot.services.items():
        add("services", name, kind, _service(name, kind, seen.services))
    for name, kind in robot.parameters.items():
        add("parameters", name, "", _parameter(name, kind, seen.parameters))
    for name in dict.fromkeys((*robot.frames, *seen.links)):
        add("frames", name, "", None if name in seen.frames else (Verdict.MISSING, "not in tf"))
    return findings


def _topic(name: str, kind: str, topics: dict[str, str], nobody: str) -> Any:
    found = alternatives(name, topics)
    if not found:
        return Verdict.MISSING, nobody
    types = {topics[one] for one in found} - {""}
    if types and kind not in types:
        return Verdict.OTHER, "type %s, not %s" % (", ".join(sorted(types)), kind)
    return None


def _silence(name: str, seen: SeenInterface) -> Any:
    if name not in seen.heard or may_be_silent(name):
        return None
    message = seen.heard[name]
    if message is None:
        return Verdict.OTHER, "no message came, or its definition differs"
    wrong = wrong_with_message(name, message)
    return (Verdict.OTHER, wrong) if wrong else None


def _service(name: str, kind: str | None, services: dict[str, str]) -> tuple[Verdict, str] | None:
    if name not in services:
        return Verdict.MISSING, "not registered"
    if services[name] is None:
        return Verdict.OTHER, "registered, but its node does not answer"
    if kind is not None and services[name] != kind:
        return Verdict.OTHER, "type %s, not %s" % (services[name], kind)
    return None


def _parameter(name: str, kind: str, parameters: dict[str, Any]) -> tuple[Verdict, str] | None:
    if name not in parameters:
        return Verdict.MISSING, "not set"
    wrong = wrong_with_parameter(name, kind, parameters[name])
    return (Verdict.OTHER, wrong) if wrong else None


def scores(findings: list[ConformanceFinding]) -> Any:
    """Return {group: (met, all)} of the public items, in alphabetical order."""
    table = defaultdict(lambda: [0, 0])
    for one in findings:
        if one.is_public:
            table[one.group][0] += one.verdict is Verdict.MET
            table[one.group][1] += 1
    return {group: tuple(table[group]) for group in sorted(table)}


def totals(findings: list[ConformanceFinding], is_public: bool) -> tuple[int, int]:
    """Return (met, all) of the public items, or of the others."""
    chosen = [one.verdict is Verdict.MET for one in findings if one.is_public == is_public]
    return sum(chosen), len(chosen)


def report(findings: list[ConformanceFinding]) -> list[str]:
    """The lines of the report: scores by group, missing and different items, the total score."""
    by_group = scores(findings)
    width = max(map(len, by_group))
    lines = ["%-*s  met  of" % (width, "group")]
    lines += ["%-*s %4d %4d" % (width, group, met, total) for group, (met, total) in by_group.items()]
    for verdict in (Verdict.MISSING, Verdict.OTHER):
        chosen = [one for one in findings if one.is_public and one.verdict is verdict]
        if chosen:
            lines += ["", verdict.value + ":", *("  %s: %s" % (one.name, one.reason) for one in chosen)]
    met, total = totals(findings, True)
    own_met, own = totals(findings, False)
    lines += ["", "Not counted, because their types are not public: %d, of which %d are here." % (own, own_met),
              "%d of %d met (%.1f %%)" % (met, total, 100.0 * met / total)]
    return lines
