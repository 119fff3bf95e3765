# SPDX-License-Identifier: BSD-3-Clause
"""Planners by the names of ompl_planning.yaml files."""
from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from motion_planning.planners import ompl_wheel
from motion_planning.planners.trees import rrt_connect

if TYPE_CHECKING:
    from motion_planning.planners.trees import Planner

#: The built-in planner.
OWN = "RRTConnect"
# The closest counterpart of planners that neither this package nor the wheel has. All others search for any path, and
# RRTConnect is by far the fastest at that.
_ANYTIME = dict.fromkeys(("PRMstar", "LazyPRMstar", "LBTRRT", "AnytimePathShortening"), "RRTstar") \
    | dict.fromkeys(("ABITstar", "AITstar"), "BITstar")
_ANY_PATH = frozenset(("BiEST", "BiTRRT", "EST", "LazyPRM", "LazyRRT", "PDST", "PRM", "ProjEST", "SBL", "SPARS",
                       "SPARStwo", "STRIDE", "TRRT"))
INSTALL = "python3 -m pip install ompl==2.0.1"

#: All known names.
NAMES = (OWN, *ompl_wheel.CLASSES, *_ANYTIME, *sorted(_ANY_PATH))


def kind_of(name: str, planners: Mapping[str, Mapping[str, str]]) -> str:
    """Return the planner's type, such as "RRTstar", of a requested name: ``Name`` or ``group[Name]``.

    planners: {name: {key: text}}, the planner_configs. A name that is not in it may be a type itself; the old ending
    kConfigDefault is ignored.
    """
    name = config_name(name)
    kind = str(planners.get(name, {}).get("type", name)).rpartition("::")[2]
    return kind.removesuffix("kConfigDefault")


def config_name(name: str) -> str:
    """Return ``Name`` of ``group[Name]``, and of ``Name``."""
    return name.rpartition("[")[2].removesuffix("]") if name.endswith("]") else name


def planner_of(kind: str, settings: Mapping[str, str]) -> tuple[Planner, list[str]]:
    """Return (planner, sentences for the user) for a type of planner, such as "RRTstar".

    planner: a function with the signature of ``rrt_connect``, which finds a path. settings: {key: text}.
    """
    if kind in ("", OWN):
        return _own(settings), []
    if kind not in NAMES:
        return _own({}), ["there is no planner '%s'; RRTConnect plans" % kind]
    if kind in _ANY_PATH:
        return _own({}), ["planner '%s' is not built in; RRTConnect plans in its place" % kind]
    nearest, remarks = kind, []
    if kind in _ANYTIME:
        nearest = _ANYTIME[kind]
        remarks = ["planner '%s' is not built in; %s plans in its place" % (kind, nearest)]
    if not ompl_wheel.is_there():
        return _own({}), ["planner '%s' is one of the ompl wheel, which is not installed; RRTConnect plans in its "
                          "place. %s installs it" % (nearest, INSTALL)]
    planner = ompl_wheel.OmplPlanner(nearest, settings if nearest == kind else {})
    return planner, remarks + planner.remarks


def _own(settings: Mapping[str, str]) -> Planner:
    try:
        reach = float(settings.get("range", 0.0))
    except ValueError:
        reach = 0.0
    return functools.partial(rrt_connect, reach=reach) if 0.0 < reach < math.inf else rrt_connect
