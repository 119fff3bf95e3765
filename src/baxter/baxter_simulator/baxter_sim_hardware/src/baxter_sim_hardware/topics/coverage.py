# SPDX-License-Identifier: BSD-3-Clause
"""Coverage of the physical robot's interface: its topics, counted by group, and the reasons for missing ones."""

from __future__ import annotations

from collections import Counter, defaultdict
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from baxter_model import SIDES
from baxter_model.interface import group_of, physical_robot

from .interface import TOPICS

if TYPE_CHECKING:
    from collections.abc import Mapping


def served(namespace: str = "/robot") -> dict[str, str]:
    """{topic: type} of what the plugin opens."""
    return {name if name.startswith("/") else "%s/%s" % (namespace, name): row.type
            for row in TOPICS for _, name in row.names()}


def physical() -> dict[str, str]:
    """{topic: type} of the physical robot."""
    robot = physical_robot()
    return dict(sorted({**robot.published, **robot.listened}.items()))


def elsewhere(name: str, table: Mapping[str, Any]) -> str | None:
    """Which other node serves a topic, or None. table: the parsed content of config/topics_not_served.yaml."""
    return next((node for pattern, node in table["elsewhere"].items() if fnmatchcase(name, pattern)), None)


def reason_to_leave_out(name: str, kind: str, table: Mapping[str, Any]) -> str | None:
    """Why a topic is missing, or None if no reason is listed."""
    for entry in table["left_out"]:
        if any(fnmatchcase(kind, pattern) for pattern in entry.get("types", ())) or any(
                fnmatchcase(name, pattern) for pattern in entry.get("names", ())):
            return entry["reason"]
    return None


def markdown(table: Mapping[str, Any]) -> str:
    """The coverage section of docs/interface.md: counts by group, then what is left out."""
    here = served()
    counts, left_out = defaultdict(Counter), defaultdict(list)
    for name, kind in physical().items():
        count = counts[group_of(name)]
        count["physical"] += 1
        if name in here:
            count["here"] += 1
        elif elsewhere(name, table):
            count["elsewhere"] += 1
        else:
            count["left out"] += 1
            left_out[reason_to_leave_out(name, kind, table)].append(name)
    for name in set(here) - set(physical()):
        counts[group_of(name)]["more"] += 1
    columns = ("physical", "here", "elsewhere", "left out", "more")
    lines = ["| Group | Physical robot | Served here | By other nodes | Left out | Here beyond it |",
             "|---|" + "---:|" * len(columns)]
    total = Counter()
    for group in sorted(counts):
        total.update(counts[group])
        lines.append("| `%s` | %s |" % (group, " | ".join(str(counts[group][column]) for column in columns)))
    lines.append("| all | %s |" % " | ".join(str(total[column]) for column in columns))
    lines += ["", "Left out:", ""]
    for reason in sorted(left_out):
        lines.append("- %s (%d): %s" % (reason, len(left_out[reason]), ", ".join(
            "`%s`" % name for name in _both_sides(left_out[reason]))))
    return "\n".join(lines) + "\n"


def _both_sides(names: list[str]) -> list[str]:
    """The names, with left and right of the same topic joined into one."""
    seen = []
    for name in names:
        joint = name
        for side in SIDES:
            other = name.replace(side, "%s")
            if "%s" in other and all(other.replace("%s", each) in names for each in SIDES):
                joint = other.replace("%s", "<limb>")
        if joint not in seen:
            seen.append(joint)
    return seen
