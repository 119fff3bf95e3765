# SPDX-License-Identifier: BSD-3-Clause
"""Workspace of an arm: a volume in cells, and for each cell the share of orientations that the tip can reach."""
import json
import math
import multiprocessing
import os
import signal
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from baxter_sim_kinematics.batch import solve_batch
from baxter_sim_kinematics.budget import Budget
from baxter_sim_kinematics.errors import KinematicsError, NoSolution
from baxter_sim_kinematics.ik import solve
from urdf_model.transforms import matrix_from_quaternion

# Cells that are computed, saved and counted together: about a second of work.
_CHUNK = 32
# A million cells take a day. A request for far more is a mistake, and would not fit into memory.
_MOST_CELLS = 10_000_000


class ReachError(KinematicsError):
    """A map cannot be made or continued."""


@dataclass(frozen=True)
class MapSettings:
    """The settings that a map depends on. lower, upper: corners (3,) of the volume [m, base frame]; cell_m: edge of a
    cell; orientations: how many are tried in each; tool: (3,) the direction of the tip's z axis [base frame] if only
    turns about that count, else None; starts: of each search; chain: data that identifies the arm; self_collision: a
    pose counts only if a posture reaches it in which the robot does not touch itself."""

    lower: tuple
    upper: tuple
    cell_m: float
    orientations: int
    tool: tuple | None
    starts: int
    chain: str
    self_collision: bool = False

    def __post_init__(self):
        if not all(math.isfinite(v) for v in (*self.lower, *self.upper)) or not np.less(self.lower, self.upper).all():
            raise ReachError("the volume must have each lower bound below its upper one, got %s to %s"
                             % (self.lower, self.upper))
        if not (0.0 < self.cell_m < math.inf and self.orientations >= 1 and self.starts >= 1):
            raise ReachError("cell, orientations and starts must be positive and finite, got %g m, %d and %d"
                             % (self.cell_m, self.orientations, self.starts))
        cells = math.prod((high - low) / self.cell_m for low, high in zip(self.lower, self.upper, strict=True))
        if cells > _MOST_CELLS:
            raise ReachError("the volume has %.2g cells of %g m, more than %d; take larger cells"
                             % (cells, self.cell_m, _MOST_CELLS))
        if self.tool is not None and not 1e-9 < np.linalg.norm(self.tool) < math.inf:
            raise ReachError("the tool must point somewhere, e.g. 0 0 -1 for down, got %s" % (self.tool,))

    @property
    def shape(self):
        """Number of cells along x, y, z."""
        return tuple(max(1, int(round((high - low) / self.cell_m)))
                     for low, high in zip(self.lower, self.upper, strict=True))

    def centres(self, first=0, count=None):
        """Return the centres (cells, 3) [m] of ``count`` cells from number ``first`` on, by default of all; x slowest.
        """
        cells = math.prod(self.shape)
        numbers = np.arange(first, cells if count is None else min(first + count, cells))
        return np.array(self.lower) + self.cell_m * (0.5 + np.column_stack(np.unravel_index(numbers, self.shape)))

    def rotations(self):
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


def compute(chain, settings, folder, processes, progress=lambda done, total: None, new_checker=None):
    """Compute a map and return (share (x, y, z) in 0 to 1, mean manipulability (x, y, z), NaN where nothing is
    reached).

    Each finished part is kept in ``folder``; existing parts are not computed again. ``progress`` is
    called with the number of cells done and of all. ``new_checker()``: a CollisionChecker for each process, which
    ``self_collision`` needs. Raises ReachError where ``folder`` holds parts of another map.
    """
    if settings.self_collision and new_checker is None:
        raise ReachError("a map of postures in which the robot does not touch itself needs a collision checker")
    parts = _Parts(Path(folder), settings)
    cells = math.prod(settings.shape)
    sizes = {first: min(_CHUNK, cells - first) for first in range(0, cells, _CHUNK)}
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
    share, manipulability = zip(*(values[first] for first in sizes), strict=True)
    return np.concatenate(share).reshape(settings.shape), np.concatenate(manipulability).reshape(settings.shape)


def cell_values(chain, settings, centres, checker=None):
    """Return share and mean manipulability (k,) of the cells at ``centres`` (k, 3).

    Manipulability is Yoshikawa's sqrt(det(J J^T)), the mean over the reached orientations. ``checker``: a
    CollisionChecker; postures with contacts do not count.
    """
    rotations = settings.rotations()
    budget = Budget(candidates=1, max_starts=settings.starts, tolerance_m=1e-5, tolerance_rad=1e-5)
    share, manipulability = np.zeros(len(centres)), np.full(len(centres), math.nan)
    for k, centre in enumerate(centres):
        # No search is needed beyond the outstretched arm.
        if math.dist(centre, chain.shoulder) > chain.tip_reach_m:
            continue
        targets = np.tile(np.eye(4), (len(rotations), 1, 1))
        targets[:, :3, :3], targets[:, :3, 3] = rotations, centre
        targets = targets[~_beyond_wrist(chain, targets)]
        if not len(targets):
            continue
        found = solve_batch(chain, targets, chain.mid_range, budget=budget, threads=1)
        reached = [(target, q) for target, q in zip(targets[found.solved], found.q[found.solved], strict=True)]
        postures = [q for _, q in reached] if checker is None else _without_contact(chain, reached, budget, checker)
        share[k] = len(postures) / len(rotations)
        if postures:
            manipulability[k] = np.mean([yoshikawa(chain.jacobian(q)) for q in postures])
    return share, manipulability


def _beyond_wrist(chain, targets):
    """Which targets (m, 4, 4) would have the last joint's origin beyond the outstretched arm."""
    if not chain.wrist_is_fixed:
        return np.zeros(len(targets), dtype=bool)
    wrists = targets[:, :3, 3] - targets[:, :3, :3] @ chain.wrist_in_tip
    return np.linalg.norm(wrists - chain.shoulder, axis=1) > chain.wrist_reach_m


def _without_contact(chain, reached, budget, checker):
    """Postures without contact for the (target, posture) of ``reached``: the same ones, or others where there are."""
    postures = []
    for target, q in reached:
        if checker.contact(chain.joint_names, q) is not None:
            try:
                q = solve(chain, target, chain.mid_range, budget=budget, checker=checker).q
            except NoSolution:
                continue
        postures.append(q)
    return postures


def yoshikawa(jacobian):
    """Return the manipulability of a Jacobian (6, n)."""
    return math.sqrt(max(np.linalg.det(jacobian @ jacobian.T), 0.0))


class _Parts:
    """The files of a map that is being computed."""

    def __init__(self, folder, settings):
        self._folder = folder / "parts"
        self._folder.mkdir(parents=True, exist_ok=True)
        wanted = json.loads(json.dumps(asdict(settings)))
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
            unfinished = self._folder / (".settings.%d.json" % os.getpid())
            unfinished.write_text(json.dumps(wanted, indent=1) + "\n")
            unfinished.rename(note)

    def load(self, sizes):
        """Return {first cell: (share, manipulability)} of the complete parts of ``sizes`` {first cell: cells}.
        """
        values = {}
        for first, size in sizes.items():
            try:
                with np.load(self._path(first)) as part:
                    value = part["share"], part["manipulability"]
            except (OSError, ValueError, LookupError, EOFError, zipfile.BadZipFile):
                continue  # not there, or cut off when the machine went down
            if value[0].shape == value[1].shape == (size,):
                values[first] = value
        return values

    def save(self, first, share, manipulability):
        unfinished = self._folder / (".%07d.%d.npz" % (first, os.getpid()))
        np.savez(unfinished, share=share, manipulability=manipulability)
        unfinished.rename(self._path(first))

    def _path(self, first):
        return self._folder / ("%07d.npz" % first)


_task = None  # of a worker process: (chain, settings, parts, checker)


def _begin(chain, settings, parts, new_checker):
    global _task
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends the workers
    _task = (chain, settings, parts, new_checker() if settings.self_collision else None)


def _work(first):
    chain, settings, parts, checker = _task
    parts.save(first, *cell_values(chain, settings, settings.centres(first, _CHUNK), checker))
    return first
