# SPDX-License-Identifier: BSD-3-Clause
"""Labels of pixels: masks of models and of their classes, and the pixels' motion. ROS-free."""
from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sensor_renderer.moments import Moment
    from sensor_renderer.sensor_element import CameraElement

#: Largest numbers of the masks; a class beyond is counted as the last one.
MAX_CLASSES, MAX_MODELS = 255, 65535
NOTHING = "nothing"
# Names that differ by such an ending belong to one class: block_1, block-2, block3, block_clone.
_ENDING = re.compile(r"([_-]?\d+|_clone)+$")


class Labels:
    """Numbers of models and of classes, the same for all cameras. A number is never used again."""

    def __init__(self, classes: Iterable[tuple[str, Iterable[str]]] = ()) -> None:
        """``classes``: [(class's name, [patterns of models' names, as in a shell])]; they get the numbers from 1 on, in
        this order. Every other model is of the class that has its name, without a number at its end."""
        self._patterns = [(name, tuple(patterns)) for name, patterns in classes]
        self._classes = {NOTHING: 0}
        for name, _ in self._patterns:
            self._number(self._classes, name, MAX_CLASSES)
        self._models = {NOTHING: 0}

    def cover(self, models: Iterable[str]) -> None:
        """Give every model in ``models`` (names) its numbers."""
        for model in models:
            if model not in self._models:
                self._number(self._models, model, MAX_MODELS)
                self._number(self._classes, self._class_of(model), MAX_CLASSES)

    @property
    def models(self) -> dict[int, str]:
        """{number: model's name}."""
        return {number: name for name, number in self._models.items()}

    @property
    def classes(self) -> dict[int, str]:
        """{number: class's name}."""
        return {number: name for name, number in self._classes.items()}

    def masks(self, numbers: np.ndarray, links: Sequence[tuple[str, int]]) -> tuple[np.ndarray, np.ndarray]:
        """(classes uint8, models uint16), (height, width) each, of what :meth:`GlRenderer.identify` returns; 0 is
        nothing."""
        self.cover(model for model, _ in links)
        classes = [0, *(self._classes[self._class_of(model)] for model, _ in links)]
        models = [0, *(self._models[model] for model, _ in links)]
        return np.array(classes, dtype=np.uint8)[numbers], np.array(models, dtype=np.uint16)[numbers]

    def _class_of(self, model):
        for name, patterns in self._patterns:
            if any(fnmatch.fnmatchcase(model, pattern) for pattern in patterns):
                return name
        return _ENDING.sub("", model) or model

    @staticmethod
    def _number(table, name, most):
        table.setdefault(name, min(len(table), most))


def classes_of_parameter(value: object) -> list[tuple[str, list[str]]]:
    """The list that :class:`Labels` takes, of a list of {class: NAME, models: [PATTERN, ...]}. Raises
    ``ValueError``."""
    found = []
    for row in value if isinstance(value, list) else [value]:
        if not (isinstance(row, dict) and set(row) == {"class", "models"} and isinstance(row["models"], list)):
            raise ValueError("semantic_classes has %r; expected a list of {class: NAME, models: [PATTERN, ...]}"
                             % (row,))
        found.append((str(row["class"]), [str(pattern) for pattern in row["models"]]))
    return found


class OpticalFlow:
    """Optical flow between the pictures of one camera."""

    def __init__(self) -> None:
        self._before = None

    def flow(self, camera: CameraElement, moment: Moment, numbers: np.ndarray, links: Sequence[tuple[str, int]],
             depth: np.ndarray) -> np.ndarray:
        """float32 (height, width, 2): how far each pixel's point has moved in the picture since the last call, to the
        right and down [pixels]. The point at pixel p was at p - flow. NaN where nothing is, where it was behind the
        camera, and at the first call.

        ``camera``: :class:`sensor_renderer.sensor_element.CameraElement`; ``numbers``, ``links``, ``depth``: its view
        at ``moment``, as :meth:`CameraElement.identified` returns them.
        """
        eye, poses = moment.link_pose @ camera.offset, moment.link_poses()
        before, self._before = self._before, (eye, poses)
        found = np.full((*depth.shape, 2), np.nan, dtype=np.float32)
        if before is None:
            return found
        old_eye, old_poses = before
        rays = camera.rays
        for number in np.unique(numbers[numbers > 0]).tolist():
            model, link = links[number - 1]
            if model not in old_poses or len(old_poses[model]) <= link:
                continue
            # From a point in this moment's optical frame to the same point of the link in the last one's.
            way = np.linalg.inv(old_eye) @ old_poses[model][link] @ np.linalg.inv(poses[model][link]) @ eye
            rows, columns = np.nonzero((numbers == number) & np.isfinite(depth))
            z = depth[rows, columns].astype(float)
            points = np.stack([rays[0][rows, columns] * z, rays[1][rows, columns] * z, z], axis=1)
            points = points @ way[:3, :3].T + way[:3, 3]
            ahead = points[:, 2] > 1e-3
            old = np.full((len(points), 2), np.nan)
            old[ahead] = camera.project(points[ahead])
            found[rows, columns] = np.stack([columns, rows], axis=1) - old
        return found
