# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m motion_planning``: compile the planner into the cache, so that no start has to wait for it."""
from motion_planning import planners
from motion_planning.occupancy import kernels

planners.warm_up()
kernels.warm_up()
