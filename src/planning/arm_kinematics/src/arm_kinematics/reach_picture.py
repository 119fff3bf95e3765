# SPDX-License-Identifier: BSD-3-Clause
"""Draw a reachability map: one panel a level of z, x to the right and y up, the share of orientations as a colour."""
from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from arm_kinematics.reach import MapSettings
    from arm_kinematics.reach_map import Overlap

_MARGIN, _TITLE, _BAR = 12, 22, 46  # [pixels]
_INK, _PAPER = (60, 60, 60), (255, 255, 255)


def draw(share: np.ndarray, settings: MapSettings | Overlap, path: str | Path, max_panels: int = 12) -> None:
    """Write the PNG ``path`` of ``share`` (x, y, z). At most ``max_panels`` levels are drawn, evenly chosen.

    Raises OSError when it cannot be written.
    """
    levels = np.unique(np.linspace(0, share.shape[2] - 1, min(max_panels, share.shape[2])).round().astype(int))
    columns = math.ceil(math.sqrt(len(levels)))
    scale = max(2, int(260 / max(share.shape[:2])))
    width, height = share.shape[0] * scale, share.shape[1] * scale
    rows = math.ceil(len(levels) / columns)
    canvas = np.full((rows * (height + _TITLE + _MARGIN) + _MARGIN + _BAR, columns * (width + _MARGIN) + _MARGIN, 3),
                     _PAPER, dtype=np.uint8)
    for number, level in enumerate(levels):
        top = _MARGIN + number // columns * (height + _TITLE + _MARGIN)
        left = _MARGIN + number % columns * (width + _MARGIN)
        z = settings.lower[2] + settings.cell_m * (level + 0.5)
        _write(canvas, "z = %.2f m" % z, left, top + 15)
        panel = _coloured(share[:, ::-1, level].T)
        panel = cv2.resize(panel, (width, height), interpolation=cv2.INTER_NEAREST)
        canvas[top + _TITLE:top + _TITLE + height, left:left + width] = panel
    _legend(canvas, "orientations reached; x %.2f to %.2f m, y %.2f to %.2f m" % (
        settings.lower[0], settings.upper[0], settings.lower[1], settings.upper[1]))
    if not cv2.imwrite(str(path), canvas):
        raise OSError("the picture '%s' cannot be written" % path)


def _coloured(share: np.ndarray) -> np.ndarray:
    """Colours (h, w, 3) of shares 0 to 1; unreachable cells are light grey."""
    colours = cv2.applyColorMap(np.clip(255.0 * share, 0, 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    colours[share <= 0.0] = (225, 225, 225)
    return colours


def _legend(canvas: np.ndarray, text: str) -> None:
    bottom = canvas.shape[0] - _MARGIN
    bar = _coloured(np.linspace(0.004, 1.0, 100)[None])
    canvas[bottom - 12:bottom, _MARGIN:_MARGIN + 100] = np.repeat(bar, 12, axis=0)
    _write(canvas, "0 to 100 %", _MARGIN + 106, bottom - 2)
    _write(canvas, text, _MARGIN, bottom - 20)


def _write(canvas: np.ndarray, text: str, x: int, y: int) -> None:
    cv2.putText(canvas, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.38, _INK, 1, cv2.LINE_AA)
