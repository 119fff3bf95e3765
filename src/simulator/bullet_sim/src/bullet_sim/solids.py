# SPDX-License-Identifier: BSD-3-Clause
"""Changes the collision shapes of some links.

Descriptions contain shapes that only keep a controller at a distance, and then leave out the shape of the link inside.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from .errors import BulletSimError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from urdf_model import Robot

#: Choices: the link collides as it is drawn, or not at all.
AS_DRAWN, HOLLOW = "as drawn", "hollow"


def with_solids(robot: Robot, solids: Mapping[str, str] | None) -> Robot:
    """Return ``robot`` (urdf_model.Robot) with the collision shapes that ``solids`` asks for; without any, itself.

    ``solids``: {link: AS_DRAWN or HOLLOW}, or None. Raises BulletSimError for an unknown link, and for another choice.
    """
    links = {}
    for name, kind in (solids or {}).items():
        link = robot.links.get(name)
        if link is None:
            raise BulletSimError("robot '%s' has no link '%s' that could be %s; its links are %s"
                                 % (robot.name, name, kind, ", ".join(robot.links)))
        if kind not in (AS_DRAWN, HOLLOW):
            raise BulletSimError("link '%s' is to be '%s'; choices are '%s' and '%s'" % (name, kind, AS_DRAWN, HOLLOW))
        shapes = link.visuals if kind == AS_DRAWN else []
        links[name] = dataclasses.replace(link, collisions=list(shapes))
    return dataclasses.replace(robot, links={**robot.links, **links}) if links else robot
