# SPDX-License-Identifier: BSD-3-Clause
"""Whether configurations and edges of a group are free, by spheres; many at once."""
import copy
import functools

import numpy as np

from motion_planning.spheres import kernel
from motion_planning.spheres.tables import bake, split

#: States on an edge are at most this far apart [rad, the Euclidean distance of joint values].
RESOLUTION = 1.0 / 64.0


class SphereChecker:
    """A scene as one group sees it. It never changes, and may be used from any number of threads.

    tables: (robot, world), see ``kernel``. resolution [rad]: how far apart the states are that an edge is looked at in.
    """

    def __init__(self, sphere_model, group, scene, state=None, resolution=RESOLUTION):
        """``state``: where the joints are that the group does not move, and what is attached; the scene's where None.
        """
        self.group, self.resolution = group, resolution
        self.tables = bake(sphere_model, group, scene, scene.state if state is None else state)

    def valid(self, states):
        """Return (m,) bool: whether each of ``states`` (m, k) is free of collisions."""
        states = np.ascontiguousarray(np.atleast_2d(states), dtype=np.float32)
        free = np.empty(len(states), dtype=bool)
        if len(states):
            kernel.free_states(self.tables, states, free)
        return free

    def at(self, resolution):
        """Return this checker with edges looked at in steps of another ``resolution`` [rad]."""
        other = copy.copy(self)
        other.__dict__.pop("parts", None)
        other.resolution = resolution
        return other

    @functools.cached_property
    def parts(self):
        """[(indices (j,) of the group's joints, SphereChecker of these alone)] of parts that move independently of
        each other, each on joints of its own; what is between parts is not looked at. Empty where there are not two.
        """
        found = []
        for indices, tables in split(self.tables):
            alone = copy.copy(self)
            alone.__dict__.pop("parts", None)
            alone.tables = tables
            found.append((indices, alone))
        return found

    def edge(self, a, b):
        """Whether the straight line from ``a`` to ``b`` (k,) is free; ``a`` itself is not looked at."""
        return bool(kernel.edge_is_free(self.tables, np.ascontiguousarray(a, dtype=np.float32),
                                        np.ascontiguousarray(b, dtype=np.float32), np.float32(self.resolution)))
