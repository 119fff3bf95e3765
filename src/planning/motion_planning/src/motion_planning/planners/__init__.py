# SPDX-License-Identifier: BSD-3-Clause
"""Collision-free paths: found with spheres, shortened, and checked by exact geometry."""
from motion_planning.planners.errors import NoPath
from motion_planning.planners.planning import SearchOptions, first_touching, plan_path, prepare
from motion_planning.planners.trees import Path, TreeSearch, rrt_connect, shorten
from motion_planning.planners.warming import warm_up

__all__ = ["NoPath", "Path", "TreeSearch", "SearchOptions", "first_touching", "plan_path", "prepare", "rrt_connect",
           "shorten", "warm_up"]
