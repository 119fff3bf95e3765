# SPDX-License-Identifier: BSD-3-Clause
"""A reachability map as data, and its files."""
from __future__ import annotations

import csv
import math
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from arm_kinematics.reach import ReachError
from command_line.user_files import check_file
from disk_cache.files import draft_of
from urdf_model.transforms import quaternion_from_matrix

# Rows that are written to HDF5 at a time.
_ROWS = 65536
# Of a map in a file; the largest that reach makes has a tenth of it.
MAX_BYTES = 2_000_000_000
# A capability map has a cone for a cell with at most this share of its orientations, and a sphere for one with more.
_MAX_IN_CONE = 0.2
# Reuleaux's measures of a cone: its opening angle is pi divided by one of these.
_CONES = np.arange(2.0, 10.5, 0.5)
_CONE, _SPHERE = 1.0, 2.0
_REQUIRED = ("reached", "manipulability", "lower", "cell_m", "rotations", "base", "tip", "self_collision")


@dataclass(frozen=True, eq=False)
class ReachMap:
    """lower: (3,) corner of the volume [m, frame of the link ``base``]; cell_m: edge of a cell; rotations: (k, 3, 3)
    of the link ``tip``; reached: (x, y, z, k) bool; manipulability: (x, y, z), NaN where nothing is reached."""

    lower: np.ndarray
    cell_m: float
    rotations: np.ndarray
    reached: np.ndarray
    manipulability: np.ndarray
    base: str
    tip: str
    self_collision: bool

    @property
    def share(self) -> np.ndarray:
        """Share (x, y, z) of the orientations that are reached, 0 to 1."""
        return self.reached.mean(axis=3)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.reached.shape[:3]

    @property
    def centres(self) -> np.ndarray:
        """Centres (x, y, z, 3) of the cells [m]."""
        return self.lower + self.cell_m * (0.5 + np.moveaxis(np.indices(self.shape), 0, -1))

    def cells_of(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (cells (..., 3) int that hold ``points`` (..., 3) [m], whether they are inside the volume (...))."""
        cells = np.floor((points - self.lower) / self.cell_m).astype(int)
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=-1)
        return np.where(inside[..., None], cells, 0), inside

    def write(self, path: str | Path) -> None:
        """Write ``path`` (.npz), complete or not at all. Raises OSError."""
        count = len(self.rotations)
        with draft_of(path) as unfinished:
            np.savez_compressed(unfinished, share=self.share, manipulability=self.manipulability, lower=self.lower,
                                upper=self.lower + self.cell_m * np.array(self.shape), cell_m=self.cell_m,
                                orientations=count, rotations=self.rotations, base=self.base, tip=self.tip,
                                reached=np.packbits(self.reached, axis=3), self_collision=self.self_collision)

    @classmethod
    def read(cls, path: str | Path) -> ReachMap:
        """Return the map in ``path``: reach.npz, or the folder that holds it. Raises ReachError, OSError."""
        path = Path(path)
        path = path / "reach.npz" if path.is_dir() else path
        check_file(path, MAX_BYTES)
        try:
            with np.load(path) as data:
                missing = [name for name in _REQUIRED if name not in data]
                if missing:
                    raise ReachError("'%s' is no map of reach: it has no %s" % (path, ", ".join(missing)))
                kept = {name: data[name] for name in _REQUIRED}
        except (ValueError, EOFError, zipfile.BadZipFile):
            raise ReachError("'%s' is no map of reach, or is cut off" % path) from None
        rotations = kept["rotations"]
        reached = np.unpackbits(kept["reached"], axis=3, count=len(rotations)).astype(bool)
        return cls(kept["lower"], float(kept["cell_m"]), rotations, reached, kept["manipulability"],
                   str(kept["base"]), str(kept["tip"]), bool(kept["self_collision"]))

    def points(self) -> np.ndarray:
        """Return a structured array of the reached cells: x, y, z [m], share, manipulability (float32), rgb (uint32:
        red for few orientations, by hue to blue for all)."""
        import cv2

        share = self.share
        some = share > 0.0
        table = np.empty(some.sum(), dtype=[(name, "<f4") for name in ("x", "y", "z", "share", "manipulability")]
                         + [("rgb", "<u4")])
        table["x"], table["y"], table["z"] = self.centres[some].T
        table["share"], table["manipulability"] = share[some], self.manipulability[some]
        hues = np.full((len(table), 1, 3), 255, dtype=np.uint8)
        hues[:, 0, 0] = np.rint(120.0 * table["share"])  # OpenCV's hue is half the angle
        colours = cv2.cvtColor(hues, cv2.COLOR_HSV2RGB)[:, 0].astype(np.uint32) if len(table) else hues[:, 0]
        table["rgb"] = (colours[:, 0] << 16) | (colours[:, 1] << 8) | colours[:, 2]
        return table

    def write_csv(self, path: str | Path) -> None:
        """Write a row for each cell. Raises OSError."""
        with open(path, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("x_m", "y_m", "z_m", "reached_percent", "mean_manipulability"))
            rows = zip(self.centres.reshape(-1, 3), self.share.ravel(), self.manipulability.ravel(), strict=True)
            for centre, part, value in rows:
                writer.writerow((*("%.4f" % c for c in centre), "%.2f" % (100.0 * part),
                                 "" if math.isnan(value) else "%.5f" % value))

    def write_hdf5(self, path: str | Path) -> None:
        """Write the reached poses and cells in the layout of Reuleaux's reachability maps. Raises OSError.

        /Poses/poses_dataset: float32 rows, centre of a cell (x y z), then a pose (x y z, qx qy qz qw).
        /Spheres/sphere_dataset: rows, centre of a cell and its reached percentage; its attribute Resolution [m].
        Cells in which nothing is reached have no row. Reuleaux finds the poses of a sphere by comparing both centres
        exactly, so those of the spheres are rounded to float32 as well. Written in portions, however large the map is.
        """
        import h5py

        quaternions = np.array([quaternion_from_matrix(rotation) for rotation in self.rotations])
        flat = self.reached.reshape(-1, len(self.rotations))
        centres = self.centres.reshape(-1, 3).astype(np.float32)
        with draft_of(path) as unfinished, h5py.File(unfinished, "w") as file:
            poses = file.create_dataset("Poses/poses_dataset", (0, 10), "float32", maxshape=(None, 10),
                                        chunks=(4096, 10))
            step = max(1, _ROWS // len(self.rotations))
            for first in range(0, len(flat), step):
                cell, turn = np.nonzero(flat[first:first + step])
                places = centres[first + cell]
                rows = np.column_stack((places, places, quaternions[turn]))
                poses.resize(len(poses) + len(rows), axis=0)
                poses[len(poses) - len(rows):] = rows
            some = flat.any(axis=1)
            spheres = file.create_dataset(
                "Spheres/sphere_dataset", data=np.column_stack((centres[some], 100.0 * flat[some].mean(axis=1))))
            spheres.attrs["Resolution"] = np.array([self.cell_m], dtype="float32")

    def write_capabilities(self, path: str | Path) -> None:
        """Write from where each cell is reached, in the layout of Reuleaux's capability maps. Raises OSError.

        /Capability/capability_dataset: rows as of :meth:`capabilities`; its attribute Resolution [m].
        """
        import h5py

        with draft_of(path) as unfinished, h5py.File(unfinished, "w") as file:
            data = file.create_dataset("Capability/capability_dataset", data=self.capabilities())
            data.attrs["Resolution"] = np.array([self.cell_m], dtype="float32")

    def capabilities(self) -> np.ndarray:
        """Return a row (10,) for each reached cell: kind, reached percentage, cone, centre (x y z), quaternion.

        Kind 1, where at most a fifth of the orientations are reached: a cone whose tip is at the centre and out of
        which the tip of the arm comes, along the quaternion's x axis; ``cone`` is pi divided by its opening angle. The
        axis is the mean of the directions that are reached; of the opening angles that one is chosen with which the
        fewest orientations are reached outside of it or not reached inside. Kind 2: a sphere. After Zacharias, Borst
        and Hirzinger, Capturing robot workspace structure (2007), with the directions of the tip's z axis.
        """
        flat, centres = self.reached.reshape(-1, len(self.rotations)), self.centres.reshape(-1, 3)
        step = max(1, _ROWS // len(self.rotations))
        rows = [self._capabilities(flat[first:first + step], centres[first:first + step])
                for first in range(0, len(flat), step)]
        return np.concatenate([np.empty((0, 10)), *rows])

    def _capabilities(self, reached: np.ndarray, centres: np.ndarray) -> np.ndarray:
        some = reached.any(axis=1)
        reached, centres = reached[some], centres[some]
        rows = np.zeros((len(reached), 10))
        rows[:, 0], rows[:, 1], rows[:, 3:6], rows[:, 9] = _SPHERE, 100.0 * reached.mean(axis=1), centres, 1.0
        thin = reached.mean(axis=1) <= _MAX_IN_CONE
        reached, directions = reached[thin], self.rotations[:, :, 2]
        axes = reached @ directions
        lengths = np.linalg.norm(axes, axis=1)
        # Directions that are opposite have no mean: the first of them.
        axes = np.where(lengths[:, None] > 1e-6, axes / np.maximum(lengths, 1e-6)[:, None],
                        directions[reached.argmax(axis=1)])
        cosines = axes @ directions.T
        wrong = [(reached != (cosines >= math.cos(0.5 * math.pi / cone) - 1e-9)).sum(axis=1) for cone in _CONES]
        rows[thin, 0], rows[thin, 2] = _CONE, _CONES[np.argmin(np.reshape(wrong, (len(_CONES), -1)), axis=0)]
        rows[thin, 6:] = _quaternions_to(axes)
        return rows


def _quaternions_to(axes: np.ndarray) -> np.ndarray:
    """The shortest turns (n, 4), x y z w, of the x axis to unit vectors ``axes`` (n, 3)."""
    turns = np.column_stack((np.zeros(len(axes)), -axes[:, 2], axes[:, 1], 1.0 + axes[:, 0]))
    turns[axes[:, 0] < -1.0 + 1e-9] = 0.0, 0.0, 1.0, 0.0
    return turns / np.linalg.norm(turns, axis=1)[:, None]


@dataclass(frozen=True, eq=False)
class Overlap:
    """share: (x, y, z) of cells of two maps, the less of both; lower, upper: (3,) corners [m]; cell_m: their edge."""

    share: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    cell_m: float


def overlap(first: ReachMap, second: ReachMap) -> Overlap:
    """Return the Overlap of two maps. Raises ReachError where they have no cells in common."""
    if first.base != second.base:
        raise ReachError("the maps are in the frames of %s and %s; give the same --base" % (first.base, second.base))
    cell = first.cell_m
    apart = (second.lower - first.lower) / cell
    steps = np.rint(apart).astype(int)
    if second.cell_m != cell or np.abs(apart - steps).max() > 1e-6:
        raise ReachError("the cells of the maps do not coincide (%g m from %s; %g m from %s); make both with the same "
                         "--cell, and without --volume or with the same one"
                         % (cell, first.lower.tolist(), second.cell_m, second.lower.tolist()))
    low, high = np.maximum(steps, 0), np.minimum(steps + second.shape, first.shape)
    if (low >= high).any():
        raise ReachError("the volumes of the maps have no cell in common")
    ours, theirs = (tuple(slice(a, b) for a, b in zip(low - shift, high - shift, strict=True)) for shift in (0, steps))
    share = np.minimum(first.share[ours], second.share[theirs])
    return Overlap(share, first.lower + cell * low, first.lower + cell * high, cell)
