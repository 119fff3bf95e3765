# SPDX-License-Identifier: BSD-3-Clause
"""Compile the planner into the cache, so that neither the start nor the first plan has to wait for it."""
from __future__ import annotations

import time

import numpy as np

from motion_planning.constraints import ConstraintSet, OrientationTarget
from motion_planning.constraints.manifold import Manifold
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners import kernels
from motion_planning.planners.errors import NoPath
from motion_planning.planners.trees import Path, TreeSearch, rrt_connect, shorten
from motion_planning.scene import Scene
from motion_planning.spheres import SphereChecker, SphereModel
from motion_planning.spheres.world_tables import solids_of
from urdf_model import Cylinder

# Compiled code does not depend on the robot, so any robot is suitable. This one cannot pass its base.
_URDF = """<robot name="two">
<link name="base"><collision><geometry><box size="0.1 0.1 4"/></geometry></collision></link>
<link name="arm"><collision><origin xyz="1 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""
_SRDF = "<robot name='two'><group name='arm'><joint name='turn'/></group></robot>"


def warm_up() -> None:
    """Compile all code of planning, or load it from the cache."""
    model, meshes = PlanningModel.from_xml(_URDF, _SRDF), MeshReader(lambda filename: None)
    checker = SphereChecker(SphereModel.of(model, meshes), model.groups["arm"], Scene(model))
    run = TreeSearch(seed=1, deadline=0.0, clock=time.monotonic)
    ends = np.array([[0.5], [2.5]])
    try:
        rrt_connect(checker, model.bounds, ends[0], ends[1:], run)
    except NoPath:
        pass  # as expected; everything is compiled now
    shorten(Path(ends), checker, run)
    checker.valid(ends)
    checker.edges(ends)
    solids_of([(Cylinder(0.1, 0.2), np.eye(4))])
    kernels.at_once(ends, ends)
    kernels.between_checked(ends, 0.1)
    kernels.traced(np.zeros((2, 1, 16), np.float32), np.full((2, 16), -1, np.int32), np.zeros(7, np.int64))
    kernels.way_through(np.ones((2, 2), dtype=bool), np.zeros((2, 2, 9), dtype=bool))
    arm, level = model.groups["arm"], ConstraintSet(orientations=(OrientationTarget("arm", np.eye(3)),))
    Manifold(Scene(model), arm, level, ends[0]).project(ends[0])
    exact = ExactChecker(model, meshes)
    exact.first_blocked(Scene(model), [[0.0], [1.6]])
    exact.distance(Scene(model))
