# SPDX-License-Identifier: BSD-3-Clause
"""Virtual springs at the joints. Free of ROS."""

from __future__ import annotations

# Stiffness [Nm/rad] and damping [Nm s/rad] of each joint: at the start, and at most.
STIFFNESS = {"s0": (10.0, 30.0), "s1": (15.0, 30.0), "e0": (5.0, 15.0), "e1": (5.0, 15.0), "w0": (3.0, 9.0),
             "w1": (2.0, 4.0), "w2": (1.5, 4.0)}
DAMPING = {"s0": (0.1, 10.0), "s1": (0.1, 7.5), "e0": (0.1, 7.5), "e1": (0.1, 5.0), "w0": (0.1, 1.5), "w1": (0.1, 1.5),
           "w2": (0.1, 1.0)}


def spring_torques(rest: dict[str, float], angles: dict[str, float], speeds: dict[str, float],
                   stiffness: dict[str, float], damping: dict[str, float]) -> dict[str, float]:
    """Torques [Nm] that pull `angles` to `rest` [rad] against `speeds` [rad/s]; dicts by joint name, all of them."""
    return {name: stiffness[name] * (rest[name] - angles[name]) - damping[name] * speeds[name] for name in rest}
