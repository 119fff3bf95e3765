# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of both arms: commanded and sensed positions, and figures computed from them. No ROS needed."""
from typing import NamedTuple

import numpy as np

from baxter_model import SIDES, joint_names

JOINT_NAMES = tuple(name for side in SIDES for name in joint_names(side))
# A set-point is at rest if it has not changed by this [rad] for this many rows.
REST_RAD, REST_ROWS = 2e-4, 100
# Natural frequencies [rad/s] and dampings of the systems of second order that a joint is compared with; steps of their
# integration in a row.
FREQUENCIES, DAMPINGS, STEPS = np.geomspace(4.0, 60.0, 40), np.geomspace(0.3, 2.0, 40), 5
LEAST_ROWS = 20
# A joint's lag behind its set-point is at most this [rows].
BEHIND_ROWS = 100


class Recording(NamedTuple):
    """time_s (n,), commanded and sensed (n, 14) [rad] in the order of JOINT_NAMES."""

    time_s: np.ndarray
    commanded: np.ndarray
    sensed: np.ndarray

    @property
    def period_s(self):
        return float(np.median(np.diff(self.time_s)))

    @classmethod
    def read(cls, path, seconds=None, begin=0.0):
        """Read a CSV file with a line of names, from its second `begin` on, so many seconds of it.

        Raises SystemExit with the reason if the file cannot be used.
        """
        try:
            table = np.genfromtxt(path, delimiter=",", names=True)
        except (OSError, ValueError) as error:
            raise SystemExit("%s cannot be read: %s" % (path, error)) from error
        wanted = ["time_s", *("%s_%s_rad" % (name, kind) for kind in ("commanded", "sensed") for name in JOINT_NAMES)]
        missing = set(wanted) - set(table.dtype.names or ())
        if missing:
            raise SystemExit("%s has no column %s" % (path, ", ".join(sorted(missing))))
        if table.size < 2 or not all(np.isfinite(table[name]).all() for name in wanted):
            raise SystemExit("%s must have two rows or more, all of finite numbers" % path)
        first = table["time_s"][0] + begin
        table = table[(table["time_s"] >= first - 1e-9) & (table["time_s"] < first + (seconds or np.inf))]
        if len(table) < LEAST_ROWS:
            raise SystemExit("%s has %d rows from its second %g on; it must have %d or more" % (
                path, len(table), begin, LEAST_ROWS))
        return cls(table["time_s"], *(np.stack([table["%s_%s_rad" % (name, kind)] for name in JOINT_NAMES], axis=1)
                                      for kind in ("commanded", "sensed")))


def delay_s(commanded, position, period_s):
    """Return the delay [s], up to half a second, that brings `commanded` closest to `position`, both (n,)."""
    most = min(round(0.5 / period_s), len(position) // 2)
    errors = [np.mean((position[most:] - commanded[most - shift:len(commanded) - shift]) ** 2)
              for shift in range(most + 1)]
    return int(np.argmin(errors)) * period_s


def overshoots(commanded, position):
    """Return how far [rad] `position` goes beyond all values of `commanded` in the second before; both (n,)."""
    windows = np.lib.stride_tricks.sliding_window_view(commanded, BEHIND_ROWS + 1)
    there = position[BEHIND_ROWS:]
    return float(max((there - windows.max(axis=1)).max(), (windows.min(axis=1) - there).max(), 0.0))


def step_overshoot(commanded, position, period_s):
    """(k,) [%] by how much the joints of `position` (n, k) would overshoot a step of `commanded` (n, k): that of the
    system of second order which is nearest to what they did, from a grid."""
    frequency, damping = (grid.ravel()[:, None] for grid in np.meshgrid(FREQUENCIES, DAMPINGS))
    where = np.tile(position[0], (len(frequency), 1))
    speed, error = np.zeros_like(where), np.zeros_like(where)
    dt = period_s / STEPS
    for target, there in zip(commanded, position, strict=True):
        error += (where - there) ** 2
        for _ in range(STEPS):
            speed += dt * frequency * (frequency * (target - where) - 2.0 * damping * speed)
            where += dt * speed
    zeta = np.minimum(damping[np.argmin(error, axis=0), 0], 1.0)
    return 100.0 * np.exp(-np.pi * zeta / np.sqrt(np.maximum(1.0 - zeta ** 2, 1e-9)))


def rest(commanded, position):
    """Return the largest distance [rad] of `position` from `commanded` while the set-point is at rest, else 0; both
    (n,)."""
    at_rest = [k for k in range(2 * REST_ROWS, len(commanded)) if np.ptp(commanded[k - REST_ROWS:k + 1]) < REST_RAD]
    return float(np.abs(position[at_rest] - commanded[at_rest]).max()) if at_rest else 0.0
