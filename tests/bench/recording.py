# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of both arms: commanded and sensed positions, and what is worked out of them. Nothing here knows ROS."""
from typing import NamedTuple

import numpy as np

from baxter_model import SIDES, joint_names

JOINT_NAMES = tuple(name for side in SIDES for name in joint_names(side))
# A set-point rests where it has not moved by this [rad] for so many rows.
REST_RAD, REST_ROWS = 2e-4, 100
# So long ago was a set-point where its joint may still be, behind as it is [rows].
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
    def read(cls, path, seconds=None):
        """Read a CSV file with a line of names. Raises SystemExit that says what is wrong with it."""
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
        if seconds is not None:
            table = table[table["time_s"] < table["time_s"][0] + seconds]
        return cls(table["time_s"], *(np.stack([table["%s_%s_rad" % (name, kind)] for name in JOINT_NAMES], axis=1)
                                      for kind in ("commanded", "sensed")))


def delay_s(commanded, position, period_s):
    """The delay [s] of a copy of `commanded` that is nearest to `position`, both (n,); up to half a second."""
    most = min(round(0.5 / period_s), len(position) // 2)
    errors = [np.mean((position[most:] - commanded[most - shift:len(commanded) - shift]) ** 2)
              for shift in range(most + 1)]
    return int(np.argmin(errors)) * period_s


def overshoots(commanded, position):
    """Farthest [rad] that `position` goes beyond everything that was `commanded`, (n,) both, in the second before."""
    windows = np.lib.stride_tricks.sliding_window_view(commanded, BEHIND_ROWS + 1)
    there = position[BEHIND_ROWS:]
    return float(max((there - windows.max(axis=1)).max(), (windows.min(axis=1) - there).max(), 0.0))


def rest(commanded, position):
    """Largest distance [rad] of `position` from `commanded`, (n,) both, where that has rested for a while, or 0."""
    at_rest = [k for k in range(2 * REST_ROWS, len(commanded)) if np.ptp(commanded[k - REST_ROWS:k + 1]) < REST_RAD]
    return float(np.abs(position[at_rest] - commanded[at_rest]).max()) if at_rest else 0.0
