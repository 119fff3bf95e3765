# SPDX-License-Identifier: BSD-3-Clause
"""Fill the cache of compiled functions: `python3 -m baxter_sysid`."""
import numpy as np

from baxter_sim_hardware.arms.actuators import NUMBERS

from .arm_body import ArmBody, holding_torques
from .replay import replay

if __name__ == "__main__":
    count = 7
    body = ArmBody(np.tile(np.eye(3), (count, 1, 1)), np.ones((count, 3)), np.ones(count), np.ones((count, 3)),
                   np.tile(np.eye(3), (count, 1, 1)), np.ones(count), np.array([0.0, 0.0, 1.0]))
    still = np.zeros(count)
    holding_torques(body, still)
    replay(body, body, np.ones((len(NUMBERS), count)), (still, still), np.zeros((5, count)), 0.01)
