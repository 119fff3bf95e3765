# SPDX-License-Identifier: BSD-3-Clause
"""A picture that a notebook shows and a terminal saves. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from pathlib import Path


class Picture:
    """A picture as PNG. A notebook shows the value of a cell's last line: make it a Picture."""

    def __init__(self, png: bytes) -> None:
        self.png = bytes(png)

    @classmethod
    def of_array(cls, pixels: np.ndarray) -> Picture:
        """Of a uint8 array (height, width, 3), red, green, blue."""
        return cls(cv2.imencode(".png", np.ascontiguousarray(pixels[:, :, ::-1]))[1].tobytes())

    @classmethod
    def of_figure(cls, figure: Figure) -> Picture:
        """Of a matplotlib figure."""
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return cls.of_array(np.asarray(canvas.buffer_rgba())[:, :, :3])

    def array(self) -> np.ndarray:
        """The uint8 array (height, width, 3), red, green, blue."""
        return cv2.imdecode(np.frombuffer(self.png, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]

    def save(self, path: Path) -> None:
        """Write a PNG file; raises OSError."""
        with open(path, "wb") as file:
            file.write(self.png)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        height, width, _ = self.array().shape
        return "picture of %d x %d pixels" % (width, height)


def new_figure(width: float, height: float) -> Figure:
    """A new matplotlib figure of that size [inches at 80 dots], outside of pyplot."""
    return Figure(figsize=(width, height), dpi=80, layout="constrained")
