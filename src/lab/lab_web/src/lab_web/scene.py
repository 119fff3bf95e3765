# SPDX-License-Identifier: BSD-3-Clause
"""The simulated world for a browser: shapes once, poses many times a second. No ROS.

The world comes from the simulator's shared memory, as for the cameras; so robots, objects and their meshes are those
that the cameras see.
"""
from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.following import WorldFollower

if TYPE_CHECKING:
    from collections.abc import Callable, Collection
    from os import PathLike

    from sensor_renderer.mirror import DrawnModel, Mirror

# How far the triangles that a browser gets may be from the mesh [m].
_WITHIN_M = 0.003
# A link is at rest where no number of its pose changes by more than this [m, and parts of rotation matrices]: less than
# a page could show. A robot that stands trembles by less, and pages draw nothing then.
_REST = 1e-4


class SceneText:
    """One scene. ``text``: JSON with ``revision``, ``light``, ``bodies`` [{name, links: [[{shape, colour}]], joints:
    their number, names: of each link and of the joint that moves it}];
    ``shapes``: {name: bytes of float32, three rows x y z nx ny nz [m] for each triangle}; names belong to contents;
    ``bodies``: {name: sensor_renderer.mirror.DrawnModel} in the scene's order.
    """

    def __init__(self, revision: int, text: str, shapes: dict[str, bytes],
                 bodies: dict[str, DrawnModel] | None = None) -> None:
        self.revision = revision
        self.text = text
        self.shapes = shapes
        self.bodies = bodies or {}


class SceneFollower(WorldFollower):
    """Follows one simulator; for one thread. ``warn(text)``."""

    def __init__(self, folder: str | PathLike[str], warn: Callable[[str], object]) -> None:
        """Raises world_picture.snapshot.SnapshotError if there is no snapshot in ``folder``."""
        super().__init__(folder, warn)
        self._shown = np.empty((0, 3, 4))  # poses that follow() told of
        #: The newest :class:`SceneText`, or None.
        self.picture: SceneText | None = None

    def follow(self) -> bool:
        """Read the newest state. Returns whether there is anything new to see. Raises SnapshotError."""
        if not super().follow() or self.revision is None:
            return False
        poses = self._matrices()
        if self.picture is None or self.picture.revision != self.revision:
            self.picture = picture_of(self.mirror, self.revision)
        elif np.allclose(poses, self._shown, rtol=0.0, atol=_REST):
            return False
        self._shown = poses
        return True

    def poses(self) -> bytes:
        """Bytes: the revision [uint32, 0 before the first], then for each link in the scene's order the upper three
        rows of its pose in the world [float32, (3, 4)].
        """
        return np.uint32(self.revision or 0).astype("<u4").tobytes() + self._matrices().astype("<f4").tobytes()

    def _matrices(self) -> np.ndarray:
        return np.concatenate([np.empty((0, 3, 4)), *(body.matrices[:, :3, :] for body in self.mirror.bodies.values())])


def picture_of(mirror: Mirror, revision: int) -> SceneText:
    """The SceneText of all bodies; equal triangles are one shape, floors are left out."""
    names, shapes, bodies = {}, {}, []
    for name, body in mirror.bodies.items():
        links = []
        for parts in body.parts:
            shown = []
            for part in parts:
                if part.is_floor:
                    continue
                if part.key not in names:
                    content = part.triangles_of(part.level(_WITHIN_M)).astype("<f4").tobytes()
                    names[part.key] = hashlib.sha256(content).hexdigest()[:24]
                    shapes[names[part.key]] = content
                shown.append({"shape": names[part.key], "colour": [float(value) for value in part.colour]})
            links.append(shown)
        # A link and the joint that moves it.
        parts = [[link, joint] for link, joint in zip(body.link_names, ["", *body.joint_names], strict=True)]
        bodies.append({"name": name, "links": links, "joints": len(body.joint_names), "names": parts})
    light = {key: [float(value) for value in getattr(mirror.light, key)] for key in ("ambient", "to_sun", "sun")}
    return SceneText(revision, json.dumps({"revision": revision, "bodies": bodies, "light": light}), shapes,
                     dict(mirror.bodies))


def bodies_of(picture: SceneText | None, joints: Collection[str]) -> dict[str, bool]:
    """{name of a body of ``picture`` (or of None) that is more than a floor: whether it has one of the ``joints``}."""
    return {name: not set(joints).isdisjoint(body.joint_names)
            for name, body in (picture.bodies.items() if picture else ())
            if any(body.parts) and not any(part.is_floor for parts in body.parts for part in parts)}
