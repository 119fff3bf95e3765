# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a lab: by the robot's own cameras, and from anywhere."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from sensor_renderer.best import best_renderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import looking_at
from urdf_model.writer import drawing_urdf
from world_picture.drawing import DrawingCache

from .errors import LabError
from .planning import FLOOR
from .tools import root_of

if TYPE_CHECKING:
    from sensor_renderer.gl_renderer import GlRenderer
    from sensor_renderer.tiny_renderer import TinyRenderer

    from .lab import Lab

#: {camera: the link that is its optical frame}
LINKS = {"head": "head_camera", "left_hand": "left_hand_camera", "right_hand": "right_hand_camera"}
OUTSIDE_FIELD_RAD, NEAR_M, FAR_M = 0.75, 0.05, 100.0


class CameraPicture(NamedTuple):
    """pixels (height, width, 3) uint8; depth (height, width) [m], or None where it was not asked for; camera (4, 4):
    its optical frame (x right, y down, z ahead) in `base`; matrix (3, 3): focal lengths and middle [pixels]."""

    pixels: np.ndarray
    depth: np.ndarray | None
    camera: np.ndarray
    matrix: np.ndarray


class LabCameras:
    """Draws the world of a lab. lab: `lab.Lab`. What it draws with is made at the first picture."""

    def __init__(self, lab: Lab) -> None:
        self._lab, self._shown = lab, None
        self._mirror: Mirror | None = None
        self._renderer: GlRenderer | TinyRenderer | None = None
        self._lenses = {}

    def close(self) -> None:
        """Free what it draws with."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def take(self, camera: str, width: int = 640, height: int = 400, depth: bool = False,
             moved: npt.NDArray[np.float64] | None = None) -> CameraPicture:
        """A picture by one of the robot's cameras: head, left_hand, right_hand. moved: where it sits, (4, 4) in its
        usual frame. Raises LabError for another name."""
        if camera not in LINKS:
            raise LabError("there is no camera '%s'; there are %s" % (camera, ", ".join(LINKS)))
        link = LINKS[camera]
        if not self._lenses:
            self._lenses = _lenses(self._lab.robot_urdf)
        frame = self._lab.robot.simulated.model.link_pose(link).matrix()
        if moved is not None:
            frame = frame @ moved
        return self._draw(Pinhole.from_field_of_view(width, height, *self._lenses[link]), frame, depth)

    def look(self, eye: npt.ArrayLike, target: npt.ArrayLike, width: int = 640, height: int = 480,
             depth: bool = False) -> CameraPicture:
        """A picture from `eye` (3,) towards `target` (3,) [m]."""
        pinhole = Pinhole.from_field_of_view(width, height, OUTSIDE_FIELD_RAD, NEAR_M, FAR_M)
        return self._draw(pinhole, looking_at(np.asarray(eye, dtype=float), np.asarray(target, dtype=float)), depth)

    def _draw(self, pinhole, frame, depth):
        renderer, mirror = self._follow()
        pixels, distance = renderer.render(mirror, pinhole, frame, True, depth)
        matrix = np.array([[pinhole.fx, 0.0, pinhole.cx], [0.0, pinhole.fy, pinhole.cy], [0.0, 0.0, 1.0]])
        return CameraPicture(np.array(pixels), None if distance is None else distance.copy(), frame, matrix)

    def _follow(self) -> tuple[GlRenderer | TinyRenderer, Mirror]:
        """Bring the mirror to the world's present state."""
        models = self._lab.world.models
        if self._mirror is None or self._renderer is None:
            self._mirror = Mirror(DrawingCache(), self._lab.find_mesh, self._lab._warn)
            self._renderer, problem = best_renderer()
            if problem:
                self._lab._warn(problem)
        shown = [(name, model) for name, model in models.items()]
        if shown != self._shown:
            self._mirror.set_scene([_entry(name, model) for name, model in shown])
            self._shown = shown
        values = []
        for model in models.values():
            pose = model.base_pose()
            values += [*pose.position, *pose.quaternion, *model.read_joints()[0].tolist()]
        self._mirror.set_state(np.array(values))
        return self._renderer, self._mirror


def _lenses(urdf):
    """{link: (horizontal field of view [rad], nearest, furthest [m])} of the cameras in a description."""
    return {block.get("reference"): tuple(float(block.findtext("sensor/camera/" + path))
                                          for path in ("horizontal_fov", "clip/near", "clip/far"))
            for block in root_of(urdf).findall("gazebo") if block.find("sensor/camera") is not None}


def _entry(name, model):
    """A model as the renderer needs it. It has a floor of its own, without a description."""
    return {"name": name, "urdf": None if name == FLOOR else drawing_urdf(model.merged),
            "joints": list(model.joint_names), "static": model.static}
