# SPDX-License-Identifier: BSD-3-Clause
"""Square tags of the family AprilTag 36h11: what they look like, and where a camera sees them. Free of ROS."""
from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from .looking import CameraView

#: Cells of a tag's side, the black border included. Around it a white margin of one cell is needed.
CELLS = 8
_DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
#: Different tags of the family.
COUNT = 587
# A side is measured at so many places of its middle part, as shares of its length, along a line across it of so many
# steps; the corners are close after so many rounds.
_PLACES = np.linspace(0.12, 0.88, 60)
_STEPS, _ROUNDS = 41, 2
# So far to both sides of it: at most some pixels, and not into the next cell.
_REACH_PX, _REACH_CELLS = 3.0, 0.45
# Of the blur that makes an edge as wide as some pixels, so that the place of its steepest part is between pixels.
_BLUR_PX = 0.8


def pattern(number: int) -> np.ndarray:
    """The cells of a tag, (8, 8) of bool from its upper left corner, True for white. ``ValueError`` for a number that
    the family does not have."""
    if not 0 <= number < COUNT:
        raise ValueError("tag %r is not one of AprilTag 36h11; expected 0 to %d" % (number, COUNT - 1))
    # OpenCV 4.7 has renamed it.
    draw = getattr(cv2.aruco, "generateImageMarker", None) or cv2.aruco.drawMarker
    return draw(_DICTIONARY, number, CELLS) > 127


def find_tags(view: CameraView, side_m: float) -> dict[int, np.ndarray]:
    """{number: pose (4, 4) in `base` [m]} of the tags with black borders of `side_m` [m] in a `looking.CameraView`.

    A tag's frame is in its middle: x to its right, y to its upper edge, z out of it, towards the camera.
    """
    grey = cv2.cvtColor(np.ascontiguousarray(view.picture), cv2.COLOR_RGB2GRAY)
    corners, numbers = _detected(grey)
    half = side_m / 2.0
    square = np.array([(-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0), (-half, -half, 0.0)])
    found = {}
    for number, four in zip(numbers, corners, strict=True):
        # In focal lengths: so it does not matter which model the lens has.
        rays = view.rays(_by_sides(grey, four)).reshape(-1, 1, 2)
        _, turns, places, errors = cv2.solvePnPGeneric(square, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        best = int(np.argmin(np.ravel(errors)))
        turn, place = cv2.solvePnPRefineLM(square, rays, np.eye(3), None, turns[best], places[best])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], place.ravel()
        found[number] = view.pose @ pose
    return found


def _detected(grey):
    """(corners [(4, 2) pixels], numbers): upper left, upper right, lower right, lower left of each tag.

    OpenCV has two ways to find squares; each misses some that the other finds.
    """
    found = {}
    for refinement in (cv2.aruco.CORNER_REFINE_NONE, cv2.aruco.CORNER_REFINE_APRILTAG):
        if hasattr(cv2.aruco, "ArucoDetector"):
            parameters = cv2.aruco.DetectorParameters()
            parameters.cornerRefinementMethod = refinement
            corners, numbers, _ = cv2.aruco.ArucoDetector(_DICTIONARY, parameters).detectMarkers(grey)
        else:
            parameters = cv2.aruco.DetectorParameters_create()
            parameters.cornerRefinementMethod = refinement
            corners, numbers, _ = cv2.aruco.detectMarkers(grey, _DICTIONARY, parameters=parameters)
        for four, number in zip(corners, np.ravel(numbers).tolist() if len(corners) else (), strict=True):
            found[number] = four.reshape(4, 2).astype(float)
    return list(found.values()), list(found)


def _by_sides(grey, corners):
    """The corners (4, 2) [pixels] where straight lines through the sides of the black border meet.

    On each line across a side, the side is in the middle of the rise from black to white, weighted by steepness. The
    errors of the pixels average out along the side, which those of a corner alone do not.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), _BLUR_PX).astype(np.float32)
    for _ in range(_ROUNDS):
        lines = [_side(smooth, corners[k], corners[(k + 1) % 4], corners.mean(axis=0)) for k in range(4)]
        corners = np.array([np.cross(lines[k - 1], lines[k]) for k in range(4)])
        corners = corners[:, :2] / corners[:, 2:]
    return corners


def _side(smooth, one, other, middle):
    """The line (a, b, c), a u + b v + c = 0, of the side near two corners."""
    along = other - one
    length = np.linalg.norm(along)
    across = np.array([along[1], -along[0]]) / length
    if across @ (one - middle) < 0.0:
        across = -across
    reach = min(_REACH_PX, _REACH_CELLS * length / CELLS)
    offsets = np.linspace(-reach, reach, _STEPS)
    places = one + _PLACES[:, None] * along
    sampled = (places[:, None, :] + offsets[None, :, None] * across).astype(np.float32)
    rise = np.maximum(np.diff(cv2.remap(smooth, sampled[..., 0], sampled[..., 1], cv2.INTER_LINEAR), axis=1), 0.0)
    between = (offsets[:-1] + offsets[1:]) / 2.0
    found = places + ((rise @ between) / np.maximum(rise.sum(axis=1), 1e-6))[:, None] * across
    centre = found.mean(axis=0)
    _, _, axes = np.linalg.svd(found - centre)
    normal = axes[1]
    return np.array([*normal, -normal @ centre])
