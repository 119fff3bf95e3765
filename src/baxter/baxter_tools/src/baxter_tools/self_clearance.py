# SPDX-License-Identifier: BSD-3-Clause
"""Distances of the arms to each other and to the body, from the robot's description. Free of ROS messages and masters.

It uses the simulator's shapes and collision pairs, in a separate physics world.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np

from baxter_model.description import finger_openings
from baxter_model.self_collision import spawn_options
from bullet_sim import LOG, World
from bullet_sim.solids import with_solids
from model_files.resources import ResourceFinder
from urdf_model import parse_urdf


class SelfClearance:
    """Called with a posture (n,) [rad] of the joints `names`, returns the least distance between parts [m].

    Negative if parts overlap; FAR if none is nearer than SEEN_M, or a fiftieth of the smaller one's size. Fingers count
    as fully open.

    Parameters: the text of the robot's URDF; `names` of the joints; `warn` takes a line of text.
    Raises UrdfError and BulletSimError if the description is not a Baxter's.
    Attributes: lower, upper: limits (n,) [rad].
    """

    FAR, SEEN_M = 1.0, 0.02

    def __init__(self, urdf_xml: str, names: list[str], warn: Callable[[str], None] = LOG.warning) -> None:
        robot = parse_urdf(urdf_xml, source="robot_description")
        self._world = World(find_mesh=ResourceFinder(), warn=warn, contact_ahead_m=self.SEEN_M)
        options = spawn_options(robot.links)
        solid = with_solids(robot, options.pop("solids"))
        self._model = self._world.spawn(solid, "baxter", static=True, **options)
        self._index = self._model.index(names)
        self.lower, self.upper = self._model.lower[self._index], self._model.upper[self._index]
        openings = finger_openings(robot)
        self._model.set_joint_positions(self._model.index(openings), np.array(list(openings.values())))

    def __call__(self, posture: np.ndarray) -> float:
        self._model.set_joint_positions(self._index, np.asarray(posture))
        self._world.detect_contacts()
        return min((contact.distance for contact in self._world.contacts(self._model)), default=self.FAR)

    def close(self) -> None:
        """Close the physics world."""
        self._world.close()
