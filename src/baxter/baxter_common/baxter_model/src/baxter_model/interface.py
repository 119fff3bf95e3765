# SPDX-License-Identifier: BSD-3-Clause
"""The ROS interface of a physical robot: topics, services, parameters, frames, from interface.yaml beside this file."""
from __future__ import annotations

import functools
import pathlib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, cast

from .names import SIDES


@dataclass(frozen=True)
class Interface:
    """The interface of a physical robot with software 1.2.x.

    published, listened: {topic: type}, seen from the robot. services: {name: type, None if it is not public}.
    parameters: {name: "text" or "names"}. frames: names in tf. types_not_public: patterns of types.
    """

    published: dict
    listened: dict
    services: dict
    parameters: dict
    frames: tuple
    types_not_public: tuple

    def is_public(self, kind: str | None) -> bool:
        """Can programs that are not the vendor's use this type of message or service?"""
        return kind is not None and not any(fnmatchcase(kind, pattern) for pattern in self.types_not_public)


def both_sides(table: dict[str, str | None]) -> dict[str, str | None]:
    """The same table, with one row per side for names with {limb}."""
    return {name.format(limb=side): value for name, value in table.items() for side in SIDES}


def group_of(name: str) -> str:
    """The group that a topic is counted in: the part of its name below /robot, or its first part."""
    parts = name.strip("/").split("/")
    if parts[0] != "robot":
        return "/" + parts[0] if len(parts) > 1 else "/"
    return "/robot/" + parts[1] if len(parts) > 2 else "/robot"


@functools.cache
def physical_robot() -> Interface:
    """The Interface of a physical robot. Read once, and shared: do not change it."""
    import yaml

    with open(pathlib.Path(__file__).with_name("interface.yaml"), encoding="utf-8") as stream:
        table = cast("dict[str, Any]", yaml.safe_load(stream))
    published, listened, services, parameters = (
        both_sides(table[kind]) for kind in ("published", "listened", "services", "parameters"))
    return Interface(published, listened, services, parameters, tuple(table["frames"]),
                     tuple(table["types_not_public"]))
