# SPDX-License-Identifier: BSD-3-Clause
"""Goals that are valid except for one random fault."""
import math

KINDS = ("number", "time", "size", "limit", "velocity", "start", "joints", "empty", "too_long")
# Texts that the server's message must contain, by kind.
WORDS = {"number": "not a finite number", "time": "time_from_start must increase", "size": "expected",
         "limit": "is beyond its limit", "velocity": "rad/s is beyond its limit", "start": "start_tolerance",
         "joints": "joint_names has", "empty": "no points", "too_long": "max_duration_s"}


def spoilt_goal(source, number, limits, here):
    """(kind, joint names, rows (time, positions), the rows without the fault), with a fault of the next kind in turn.

    ``source``: random.Random; ``limits``: {joint: JointLimit}; ``here``: {joint: angle [rad]}.
    """
    kind = KINDS[number % len(KINDS)]
    names = source.sample(sorted(limits), source.randrange(2, len(limits) + 1))
    rows = [[float(i), [_inwards(source, limits[name], here[name]) for name in names]]
            for i in range(source.randrange(3, 6))]
    rows[0][1] = [here[name] for name in names]
    good = [[time_s, list(positions)] for time_s, positions in rows]
    index, joint = source.randrange(2, len(rows)), source.randrange(len(names))
    limit = limits[names[joint]]
    if kind == "number":
        rows[index][1][joint] = source.choice([math.nan, math.inf, -math.inf])
    elif kind == "time":
        rows[index][0] = rows[index - 1][0] - source.choice([0.0, 0.1])
    elif kind == "size":
        rows[index][1].pop()
    elif kind == "limit":
        rows[index][1][joint] = source.choice([limit.lower - source.uniform(0.01, 9.0),
                                               limit.upper + source.uniform(0.01, 9.0)])
    elif kind == "velocity":
        # Across the middle, in too short a time.
        rows[index - 1][1][joint], rows[index][1][joint] = 0.9 * limit.lower, 0.9 * limit.upper
        rows[index - 1][0] += 0.99
    elif kind == "start":
        rows[0][1][joint] = here[names[joint]] + source.uniform(0.11, 0.5) * (
            1 if here[names[joint]] < 0.5 * (limit.lower + limit.upper) else -1)
    elif kind == "joints":
        names[joint] = source.choice(["right_s9", "head_pan", "", names[joint - 1]])
    elif kind == "empty":
        rows.clear()
    elif kind == "too_long":
        rows[-1][0] = source.uniform(600.1, 1e6)
    return kind, names, rows, good


def _inwards(source, limit, here):
    """An angle near ``here``, within the limit's range even if ``here`` is at its edge."""
    return here + source.uniform(0.0, 0.1) * (1 if here < 0.5 * (limit.lower + limit.upper) else -1)
