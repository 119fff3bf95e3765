# SPDX-License-Identifier: BSD-3-Clause
"""A mirror of the world that follows one simulator's snapshot. ROS-free."""
from __future__ import annotations

import os
from collections.abc import Callable

from model_files.resources import ResourceFinder
from sensor_renderer.mirror import Mirror
from world_picture.drawing import DrawingCache
from world_picture.snapshot import SnapshotReader


class WorldFollower:
    """Use it in the thread that made it. ``mirror``: the :class:`sensor_renderer.mirror.Mirror`; ``revision``: the
    number of the scene that it shows, None before the first; ``snapshot``: the state that it shows; ``warn(text)``.
    """

    def __init__(self, folder: str | os.PathLike[str], warn: Callable[[str], object],
                 drawings: DrawingCache | None = None) -> None:
        """``drawings``: as for :class:`sensor_renderer.mirror.Mirror`; by default all meshes are waited for.
        Raises world_picture.snapshot.SnapshotError if there is no snapshot in ``folder``."""
        self._reader = SnapshotReader(folder)
        self._finder = ResourceFinder()
        self.mirror = Mirror(drawings or DrawingCache(), self._finder, warn)
        self.revision = self.snapshot = None

    @property
    def is_alive(self) -> bool:
        """False once the simulator has ended."""
        return self._reader.is_alive

    def follow(self) -> bool:
        """Move the mirror's bodies to the newest state. Returns whether there is one that fits its scene. Raises
        SnapshotError.
        """
        snapshot = self._reader.read()
        if snapshot is None:
            return False
        if snapshot.revision != self.revision:
            scene = self._reader.scene()
            if scene.revision != snapshot.revision:
                return False  # a state of the new scene follows
            self._finder.forget_missing()
            self.mirror.set_scene(scene.bodies, scene.light)
            self.revision = scene.revision
        self.mirror.complete()
        self.mirror.set_state(snapshot.values)
        self.snapshot = snapshot
        return True
