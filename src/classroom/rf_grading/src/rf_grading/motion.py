# SPDX-License-Identifier: BSD-3-Clause
"""The robot's motion in a run, small enough for a page: points of both arms over time. Free of ROS."""
from __future__ import annotations

from typing import Any

from baxter_model import SIDES

#: Links of an arm that are drawn, from shoulder to hand.
LINKS = ("upper_shoulder", "upper_elbow", "upper_forearm", "wrist", "gripper")
#: Most moments of a run that are kept.
MAX_FRAMES = 60


def of_run(recording: Any, robot: Any) -> dict[Any, Any] | dict[str, list[Any]]:
    """{"times": [s, ...], "left": frames, "right": frames} of a rf_checks Recording; {} for one without records.

    A frame is [[x, y, z] of each of LINKS], in `base`, in whole mm. robot: a rf_checks Robot.
    """
    count = len(recording.records)
    if not count:
        return {}
    rows = sorted({round(k * (count - 1) / max(1, MAX_FRAMES - 1)) for k in range(MAX_FRAMES)})
    start = recording.records[0]["t"]
    found = {"times": [round(recording.records[row]["t"] - start, 2) for row in rows]}
    for side in SIDES:
        found[side] = [[[round(1000 * float(value)) for value in robot.frame("%s_%s" % (side, link), joints)[:3, 3]]
                        for link in LINKS] for joints in map(recording.joints_at, rows)]
    return found
