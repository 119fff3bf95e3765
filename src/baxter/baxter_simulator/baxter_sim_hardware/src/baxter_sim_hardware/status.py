# SPDX-License-Identifier: BSD-3-Clause
"""The robot's status: levels of its diagnostics, checks of its description."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

from .errors import CommandRefused
from .robot_state import BaxterState

if TYPE_CHECKING:
    from collections.abc import Collection

OK, WARN, ERROR = 0, 1, 2  # levels of a DiagnosticStatus


def level_of(state: BaxterState) -> tuple[int, str]:
    """(level, text) of a robot_state.BaxterState: a stopped robot needs a person."""
    return (OK if state in (BaxterState.ENABLED, BaxterState.DISABLED) else ERROR), state.value


def check_fragment(link: str, joint: str, xml: str, links: Collection[str]) -> None:
    """Raises CommandRefused unless `xml` is a robot description and `link` one of the robot's links."""
    if link not in links:
        raise CommandRefused("urdf fragment for link '%s'; it must name one of the robot's links" % link)
    if not joint:
        raise CommandRefused("urdf fragment names no joint; it must name the one that will hold it")
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise CommandRefused("urdf fragment is not XML: %s" % error) from None
    if root.tag != "robot" or root.find("link") is None:
        raise CommandRefused("urdf fragment is <%s>; it must be a <robot> with a link" % root.tag)
