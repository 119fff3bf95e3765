# SPDX-License-Identifier: BSD-3-Clause
"""The grippers that this robot carries."""
from __future__ import annotations

from collections.abc import Iterable

import rospy

from baxter_interface import CHECK_VERSION, Gripper
from baxter_interface.gripper_link import NoGripper
from baxter_model import CUSTOM, ELECTRIC


def mounted_grippers(sides: Iterable[str], calibrate: bool = False) -> dict[str, Gripper]:
    """Return {side: Gripper} of the `sides` whose arm carries one that can be commanded; the log names the others.

    With `calibrate`, electric ones that are not calibrated yet are. Raises OSError.
    """
    grippers = {}
    for side in sides:
        try:
            gripper = Gripper(side, CHECK_VERSION)
        except NoGripper as lacking:
            rospy.loginfo("%s", lacking.strerror)
            continue
        if gripper.type() == CUSTOM.name:
            rospy.loginfo("%s is a custom one: it is left alone", gripper.name)
            continue
        if calibrate and gripper.type() == ELECTRIC.name and not gripper.calibrated():
            gripper.calibrate()
        grippers[side] = gripper
    return grippers
