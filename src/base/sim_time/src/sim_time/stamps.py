# SPDX-License-Identifier: BSD-3-Clause
"""Simulation time as the time stamp of a message."""
from __future__ import annotations

import genpy


def stamp(time_s: float) -> genpy.Time:
    """The ``genpy.Time`` of a time [s], rounded to the nanosecond."""
    return stamp_ns(round(time_s * 1e9))


def stamp_ns(time_ns: int) -> genpy.Time:
    """The ``genpy.Time`` of a time [ns], an int."""
    return genpy.Time(*divmod(time_ns, 10**9))
