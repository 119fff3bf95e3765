#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Calibrate an arm: let the robot measure the arm's own parameters."""
import sys

from baxter_maintenance_msgs.msg import CalibrateArmData, CalibrateArmEnable

from baxter_tools.arm_procedure import run_arm_procedure

TIMEOUT_S = 600.0

if __name__ == "__main__":
    sys.exit(run_arm_procedure("rsdk_calibrate_arm", "CalibrateArm", CalibrateArmEnable,
                               CalibrateArmData(suppressWriteToFile=False), TIMEOUT_S, __doc__))
