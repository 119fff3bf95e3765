# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m motion_planning``: compile the planner into the cache, so that no start has to wait for it."""
import numpy as np

from motion_planning import planners
from motion_planning.occupancy import kernels
from motion_planning.timing import time_path

planners.warm_up()
kernels.warm_up()
for algorithm in ("time_optimal_trajectory_generation", "iterative_time_parameterization"):
    time_path(np.array([[0.0], [1.0], [0.0]]), np.ones(1), np.ones(1), algorithm)
