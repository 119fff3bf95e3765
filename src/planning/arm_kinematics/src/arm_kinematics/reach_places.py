# SPDX-License-Identifier: BSD-3-Clause
"""Where to place a task before an arm, by its map: the poses of the task are looked up, not searched for."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.reach import ReachError
from command_line.options import counted
from urdf_model.transforms import rigid, rpy_matrix

if TYPE_CHECKING:
    from arm_kinematics.reach_map import ReachMap

# Places times poses, and poses of a task: more take minutes and gigabytes.
_MAX_LOOKUPS, _MAX_POSES = 200_000_000, 100_000


@dataclass(frozen=True)
class BasePlace:
    """position: (3,) [m] of the task's origin in the map's frame; yaw: [rad] about z; share: of the task's poses that
    are reached there; spare: the mean share of orientations in their cells, which tells equally good places apart."""

    position: np.ndarray
    yaw: float
    share: float
    spare: float

    @property
    def pose(self) -> np.ndarray:
        """The task's frame (4, 4) in the map's frame."""
        return rigid(rpy_matrix(0.0, 0.0, self.yaw), self.position)


@dataclass(frozen=True)
class Region:
    """Places that are tried: lower, upper: (3,) [m] corners; step_m: between places; yaws: [rad]."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    step_m: float
    yaws: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        if not (np.isfinite([*self.lower, *self.upper]).all() and np.less_equal(self.lower, self.upper).all()):
            raise ReachError("the region must have each lower bound at or below its upper one, got %s to %s"
                             % (self.lower, self.upper))
        if not 0.0 < self.step_m < math.inf:
            raise ReachError("the step must be positive and finite, got %g m" % self.step_m)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of positions along x, y, z."""
        return tuple(int((high - low) / self.step_m + 1e-9) + 1
                     for low, high in zip(self.lower, self.upper, strict=True))

    def positions(self) -> np.ndarray:
        """All positions (m, 3), x slowest."""
        axes = [low + self.step_m * np.arange(count) for low, count in zip(self.lower, self.shape, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def table_poses(width_m: float, depth_m: float, step_m: float, rotations: np.ndarray) -> np.ndarray:
    """Return the poses (m, 4, 4) of a tool on a table top: every ``step_m``, with each of ``rotations`` (k, 3, 3).

    width_m along y, depth_m along x; the origin is the middle of the top. Raises ReachError.
    """
    if not (0.0 < width_m < math.inf and 0.0 < depth_m < math.inf and step_m > 0.0):
        raise ReachError("a table has a positive width and depth, got %g and %g m" % (width_m, depth_m))
    counts = [max(2, math.ceil(size / step_m) + 1) for size in (depth_m, width_m)]
    if math.prod(counts) * len(rotations) > _MAX_POSES:
        raise ReachError("a table of %g by %g m with a point every %g m has %s; take a larger step"
                         % (width_m, depth_m, step_m, counted(math.prod(counts) * len(rotations), "pose")))
    xs, ys = (np.linspace(-0.5 * size, 0.5 * size, count)
              for size, count in zip((depth_m, width_m), counts, strict=True))
    return np.array([rigid(rotation, (x, y, 0.0)) for x in xs for y in ys for rotation in rotations])


def best_places(reach_map: ReachMap, poses: np.ndarray, region: Region, most: int = 10) -> list[BasePlace]:
    """Return the best Places of a task with ``poses`` (m, 4, 4) in its own frame, best first.

    A pose counts as reached where the map reaches its cell with the nearest of its orientations. Equal shares are
    ordered by ``spare``, then as the region has them. Raises ReachError.
    """
    places = math.prod(region.shape) * len(region.yaws)
    if places * len(poses) > _MAX_LOOKUPS:
        raise ReachError("%s and %s are too many; take a larger step or a smaller region"
                         % (counted(places, "place"), counted(len(poses), "pose")))
    positions = region.positions()
    share, found = reach_map.share, []
    for yaw in region.yaws:
        turned = rigid(rpy_matrix(0.0, 0.0, yaw), np.zeros(3)) @ poses
        nearest = nearest_rotations(reach_map, turned[:, :3, :3])[0]
        reached, spare = np.zeros(len(positions)), np.zeros(len(positions))
        for point, turn in zip(turned[:, :3, 3], nearest, strict=True):
            cells, inside = reach_map.cells_of(positions + point)
            index = tuple(cells.T)
            reached += inside & reach_map.reached[(*index, turn)]
            spare += np.where(inside, share[index], 0.0)
        found += [BasePlace(*one) for one in zip(positions, [yaw] * len(positions), reached / len(poses),
                                                 spare / len(poses), strict=True)]
    found.sort(key=lambda place: (-place.share, -place.spare))
    return found[:most]


def nearest_rotations(reach_map: ReachMap, rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (number (m,) of the map's nearest orientation for each of ``rotations`` (m, 3, 3), its distance [rad])."""
    traces = np.einsum("mab,kab->mk", rotations, reach_map.rotations)
    nearest = traces.argmax(axis=1)
    cosines = 0.5 * (traces[np.arange(len(nearest)), nearest] - 1.0)
    return nearest, np.arccos(np.clip(cosines, -1.0, 1.0))

