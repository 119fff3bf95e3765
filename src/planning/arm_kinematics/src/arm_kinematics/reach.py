# SPDX-License-Identifier: BSD-3-Clause
"""Workspace of an arm: a volume in cells, and for each cell the share of orientations that the tip can reach."""
from __future__ import annotations

import json
import math
import multiprocessing
import signal
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from arm_kinematics.errors import KinematicsError
from arm_kinematics.reach_search import search_cells
from disk_cache.files import draft_of
from urdf_model.transforms import matrix_from_quaternion

if TYPE_CHECKING:
    from arm_kinematics.chain import Chain
    from arm_kinematics.collision import Touch

# Cells that are computed, saved and counted together: about a second of work. Postures of neighbouring cells help each
# other within a part alone, so that a map does not depend on the order of its parts.
PART = 128
# Of the search. Parts of another number do not belong to the same map.
_METHOD = 2
# A million cells take a day. A request for far more is a mistake, and would not fit into memory.
_MAX_CELLS = 10_000_000


class ReachError(KinematicsError):
    """A map cannot be made or continued."""


@dataclass(frozen=True)
class MapSettings:
    """The settings that a map depends on. lower, upper: corners (3,) of the volume [m, base frame]; cell_m: edge of a
    cell; orientations: how many are tried in each; tool: (3,) the direction of the tip's z axis [base frame] if only
    turns about that count, else None; starts: of each search; chain: data that identifies the arm; self_collision: a
    pose counts only if a posture reaches it in which the robot does not touch itself."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    cell_m: float
    orientations: int
    tool: tuple[float, ...] | None
    starts: int
    chain: str
    self_collision: bool = False

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (*self.lower, *self.upper)) or not np.less(self.lower, self.upper).all():
            raise ReachError("the volume must have each lower bound below its upper one, got %s to %s"
                             % (self.lower, self.upper))
        if not (0.0 < self.cell_m < math.inf and self.orientations >= 1 and self.starts >= 1):
            raise ReachError("cell, orientations and starts must be positive and finite, got %g m, %d and %d"
                             % (self.cell_m, self.orientations, self.starts))
        cells = math.prod((high - low) / self.cell_m for low, high in zip(self.lower, self.upper, strict=True))
        if cells > _MAX_CELLS:
            raise ReachError("the volume has %.2g cells of %g m, more than %d; take larger cells"
                             % (cells, self.cell_m, _MAX_CELLS))
        if self.tool is not None and not 1e-9 < np.linalg.norm(self.tool) < math.inf:
            raise ReachError("the tool must point somewhere, e.g. 0 0 -1 for down, got %s" % (self.tool,))

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along x, y, z."""
        return tuple(max(1, int(round((high - low) / self.cell_m)))
                     for low, high in zip(self.lower, self.upper, strict=True))

    def centres(self, first: int = 0, count: int | None = None) -> np.ndarray:
        """Return the centres (cells, 3) [m] of ``count`` cells from number ``first`` on, by default of all; x slowest.
        """
        cells = math.prod(self.shape)
        return np.array(self.lower) + self.cell_m * (0.5 + self.cells(first, cells if count is None else count))

    def cells(self, first: int, count: int) -> np.ndarray:
        """Return the indices (count, 3) of cells from number ``first`` on, as far as there are any; x slowest."""
        numbers = np.arange(first, min(first + count, math.prod(self.shape)))
        return np.column_stack(np.unravel_index(numbers, self.shape))

    def parts(self) -> dict[int, int]:
        """Return {number of the first cell: number of cells} of the parts of the map."""
        cells = math.prod(self.shape)
        return {first: min(PART, cells - first) for first in range(0, cells, PART)}

    def rotations(self) -> np.ndarray:
        """Return the orientations (orientations, 3, 3) tried in every cell: the same for the same settings."""
        if self.tool is None:
            # Normalised normal deviates are spread evenly over the rotations.
            quaternions = np.random.default_rng(0).normal(size=(self.orientations, 4))
            return np.array([matrix_from_quaternion((x, y, z, w)) for w, x, y, z in quaternions])
        z = np.array(self.tool) / np.linalg.norm(self.tool)
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        turns = 2.0 * math.pi * np.arange(self.orientations) / self.orientations
        return np.array([np.column_stack((math.cos(t) * x + math.sin(t) * np.cross(z, x),
                                          math.cos(t) * np.cross(z, x) - math.sin(t) * x, z)) for t in turns])


class PoseChecker(Protocol):
    """Checks postures for contact, as bullet_checker.BulletChecker does. Not thread-safe."""

    def contact(self, joint_names: Sequence[str], q: np.ndarray) -> Touch | None:
        """Return the deepest Touch of the robot with its ``joint_names`` at ``q``, or None where it is clear."""
        ...

    def contact_and_cause(self, joint_names: Sequence[str], q: np.ndarray) -> tuple[Touch | None, bool]:
        """Return (:meth:`contact`, whether all postures touch that have the last joint's link in the same pose)."""
        ...


@dataclass(frozen=True)
class PartValues:
    """reached: (cells, orientations) bool; manipulability: (cells,) the mean over the reached orientations, NaN where
    none is."""

    reached: np.ndarray
    manipulability: np.ndarray


def compute(chain: Chain, settings: MapSettings, folder: str | Path, processes: int,
            progress: Callable[[int, int], object] = lambda done, total: None,
            new_checker: Callable[[], PoseChecker] | None = None) -> PartValues:
    """Compute a map and return its PartValues, of all cells, x slowest.

    Each finished part is kept in ``folder``; existing parts are not computed again. ``progress`` is
    called with the number of cells done and of all. ``new_checker()``: a PoseChecker for each process, which
    ``self_collision`` needs. Raises ReachError where ``folder`` holds parts of another map.
    """
    if settings.self_collision and new_checker is None:
        raise ReachError("a map of postures in which the robot does not touch itself needs a collision checker")
    parts = _Parts(Path(folder), settings)
    sizes = settings.parts()
    cells = sum(sizes.values())
    values = parts.load(sizes)
    todo = [first for first in sizes if first not in values]
    done = sum(sizes[first] for first in values)
    progress(done, cells)
    if todo:
        context = multiprocessing.get_context("fork")
        with context.Pool(min(processes, len(todo)), _begin, (chain, settings, parts, new_checker)) as pool:
            for first in pool.imap_unordered(_work, todo):
                done += sizes[first]
                progress(done, cells)
        values.update(parts.load({first: sizes[first] for first in todo}))
    return PartValues(np.concatenate([values[first].reached for first in sizes]),
                      np.concatenate([values[first].manipulability for first in sizes]))


class MapParts:
    """The parts of a map that several programs compute, each some of them, into one folder."""

    def __init__(self, chain: Chain, settings: MapSettings, folder: str | Path,
                 checker: PoseChecker | None = None) -> None:
        """Arguments as of :func:`compute`. Raises ReachError."""
        self.settings = settings
        self._chain, self._checker, self._parts = chain, checker, _Parts(Path(folder), settings)

    def compute(self, first: int) -> PartValues:
        """Compute and keep the part that begins with cell number ``first``, and return its PartValues. A part that is
        there already is not computed again."""
        found = self._parts.load({first: self.settings.parts()[first]})
        if first not in found:
            found[first] = part_values(self._chain, self.settings, first, self._checker)
            self._parts.save(first, found[first])
        return found[first]


def part_values(chain: Chain, settings: MapSettings, first: int, checker: PoseChecker | None = None) -> PartValues:
    """Return the PartValues of the part that begins with cell number ``first``.

    Manipulability is Yoshikawa's sqrt(det(J J^T)). ``checker``: a PoseChecker; postures with contacts do not count.
    """
    found = search_cells(chain, settings.cells(first, PART), settings.centres(first, PART), settings.rotations(),
                         settings.starts, checker)
    manipulability = np.full(len(found.reached), math.nan)
    for cell, reached in enumerate(found.reached):
        if reached.any():
            jacobians = np.array([chain.jacobian(q) for q in found.postures[cell, reached]])
            manipulability[cell] = yoshikawa(jacobians).mean()
    return PartValues(found.reached, manipulability)


def yoshikawa(jacobians: np.ndarray) -> np.ndarray:
    """Return the manipulability of a Jacobian (6, n), or of many (m, 6, n)."""
    return np.sqrt(np.maximum(np.linalg.det(jacobians @ np.swapaxes(jacobians, -1, -2)), 0.0))


class _Parts:
    """The files of a map that is being computed."""

    def __init__(self, folder: Path, settings: MapSettings) -> None:
        self._folder, self._orientations = folder / "parts", settings.orientations
        self._folder.mkdir(parents=True, exist_ok=True)
        wanted = json.loads(json.dumps({**asdict(settings), "method": _METHOD}))
        note = self._folder / "settings.json"
        if note.exists():
            try:
                found = json.loads(note.read_text())
                kept = {key: found[key] for key in wanted}
            except (ValueError, LookupError, TypeError):
                raise ReachError("'%s' does not say what map it belongs to; choose another folder or delete '%s'"
                                 % (note, self._folder)) from None
            other = sorted(key for key in wanted if kept[key] != wanted[key])
            if other:
                raise ReachError("'%s' holds parts of a map with another %s (%s there); choose another folder or "
                                 "delete it" % (self._folder, other[0], kept[other[0]]))
        else:
            # Written under another name and then renamed, like the parts: an existing file is complete.
            with draft_of(note) as unfinished:
                unfinished.write_text(json.dumps(wanted, indent=1) + "\n")

    def load(self, sizes: Mapping[int, int]) -> dict[int, PartValues]:
        """Return {first cell: PartValues} of the complete parts of ``sizes`` {first cell: cells}."""
        values = {}
        for first, size in sizes.items():
            try:
                with np.load(self._path(first)) as part:
                    bits, manipulability = part["reached"], part["manipulability"]
            except (OSError, ValueError, LookupError, EOFError, zipfile.BadZipFile):
                continue  # not there, or cut off when the machine went down
            if bits.shape == (size, math.ceil(self._orientations / 8)) and manipulability.shape == (size,):
                reached = np.unpackbits(bits, axis=1, count=self._orientations).astype(bool)
                values[first] = PartValues(reached, manipulability)
        return values

    def save(self, first: int, values: PartValues) -> None:
        with draft_of(self._path(first)) as unfinished:
            np.savez(unfinished, reached=np.packbits(values.reached, axis=1), manipulability=values.manipulability)

    def _path(self, first: int) -> Path:
        return self._folder / ("%07d.npz" % first)


_task: tuple[Chain, MapSettings, _Parts, PoseChecker | None]  # of a worker process


def _begin(chain: Chain, settings: MapSettings, parts: _Parts, new_checker: Callable[[], PoseChecker] | None) -> None:
    global _task
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends the workers
    _task = (chain, settings, parts, None if new_checker is None or not settings.self_collision else new_checker())


def _work(first: int) -> int:
    chain, settings, parts, checker = _task
    parts.save(first, part_values(chain, settings, first, checker))
    return first
