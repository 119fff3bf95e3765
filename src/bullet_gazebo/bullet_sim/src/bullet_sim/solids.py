# SPDX-License-Identifier: BSD-3-Clause
"""Links that collide otherwise than their description says.

Descriptions put shapes around what a controller shall keep away from, which nothing bumps into, and leave out the shape
of what is thereby guarded.
"""

from __future__ import annotations

import dataclasses

from .errors import BulletSimError

#: What a link can be: what it is drawn as, or nothing that can be touched.
AS_DRAWN, HOLLOW = "as drawn", "hollow"


def with_solids(robot, solids):
    """Return ``robot`` (urdf_model.Robot) with the collision shapes that ``solids`` asks for; without any, itself.

    ``solids``: {link: AS_DRAWN or HOLLOW}, or None. Raises BulletSimError for a link that the robot has not, and for
    another word.
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
