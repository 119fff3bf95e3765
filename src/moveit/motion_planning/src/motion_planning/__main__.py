# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m motion_planning``: compile the planner into the cache, so that no start has to wait for it."""
from motion_planning.planners import warm_up

warm_up()
