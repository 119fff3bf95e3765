# SPDX-License-Identifier: BSD-3-Clause
"""Simulation time as the time stamp of a message."""
import genpy


def stamp(time_s):
    """The ``genpy.Time`` of a time [s], rounded to the nanosecond."""
    return stamp_ns(round(time_s * 1e9))


def stamp_ns(time_ns):
    """The ``genpy.Time`` of a time [ns], an int."""
    return genpy.Time(*divmod(time_ns, 10**9))
