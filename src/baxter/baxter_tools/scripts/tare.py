#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Tare an arm: let the robot set the zero of the arm's torque sensors."""
import sys

from baxter_maintenance_msgs.msg import TareData, TareEnable

from baxter_tools.arm_procedure import run_arm_procedure

TIMEOUT_S = 300.0

if __name__ == "__main__":
    sys.exit(run_arm_procedure("rsdk_tare", "Tare", TareEnable, TareData(tuneGravitySpring=True), TIMEOUT_S, __doc__))
