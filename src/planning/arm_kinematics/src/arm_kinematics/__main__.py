# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m arm_kinematics``: compile everything into the cache, so that no start has to wait for it."""
import numpy as np

from arm_kinematics import Chain, Targets, solve_batch, warm_up

# Compiled code does not depend on the robot: any chain will do.
chain = Chain("base", "tip", [("turn", "revolute", "tip", np.eye(4), (0, 0, 1), -1.0, 1.0)])
warm_up(chain)
solve_batch(chain, Targets([np.eye(4)], free_axis=(0, 0, 1)), [0.0])
