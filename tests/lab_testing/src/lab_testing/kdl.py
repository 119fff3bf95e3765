# SPDX-License-Identifier: BSD-3-Clause
"""An arm in KDL, beside which tests put ours."""
from __future__ import annotations

from typing import Any

import pytest

from urdf_model import Robot


def kdl_arm(robot: Robot, base: str, tip: str) -> tuple[Any, Any]:
    """Return (KDL's Python module, the chain from ``base`` to ``tip`` in it); skips the test where there is none."""
    kdl = pytest.importorskip("PyKDL", reason="python3-pykdl is not installed")
    arm = kdl.Chain()
    for joint in robot.chain(base, tip):
        rotation, p = joint.origin[:3, :3], joint.origin[:3, 3]
        offset = kdl.Frame(kdl.Rotation(*rotation.ravel().tolist()), kdl.Vector(*p.tolist()))
        if joint.type == "fixed":
            arm.addSegment(kdl.Segment(kdl.Joint(), offset))
            continue
        # KDL turns about an axis given in the parent, before the offset's rotation.
        axis = kdl.Vector(*(rotation @ joint.axis).tolist())
        arm.addSegment(kdl.Segment(kdl.Joint(joint.name, kdl.Vector(*p.tolist()), axis, kdl.Joint.RotAxis), offset))
    return kdl, arm
