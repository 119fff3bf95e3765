# SPDX-License-Identifier: BSD-3-Clause
"""A robot's data from the parameter server: its planning model, and the settings of its groups."""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, cast

import rospy
import yaml

from motion_planning.model import PlanningModel

from .connection import how_to_start
from .node import ensure_node


@dataclass(frozen=True)
class Description:
    """model: a :class:`motion_planning.model.PlanningModel`; kinematics: group to its mapping of settings;
    velocity_scaling, acceleration_scaling: defaults."""

    model: PlanningModel
    kinematics: dict[str, Any] = field(default_factory=dict)
    velocity_scaling: float = 0.1
    acceleration_scaling: float = 0.1


@lru_cache(maxsize=8)
def _model(urdf: str, srdf: str, limits: str) -> PlanningModel:
    """Programs make several commanders of one robot; building its model takes longer than all the rest."""
    return PlanningModel.from_xml(urdf, srdf, cast("dict[str, Any]", yaml.safe_load(limits)))


def _parameter_name(name: str, namespace: str) -> str:
    """The full name of the robot's description: resolved like the program's own names, else in the namespace of
    move_group."""
    if name.startswith("/"):
        return name
    return rospy.search_param(name) or rospy.resolve_name("/".join(filter(None, [namespace, name])))


def load(robot_description: str, namespace: str) -> Description:
    """Return the :class:`Description` under the parameter ``robot_description`` and those named after it.

    Raises RuntimeError if the URDF or the SRDF is missing or invalid; the text says which.
    """
    ensure_node()
    name = _parameter_name(robot_description, namespace)
    urdf, srdf = (rospy.get_param(name + suffix, None) for suffix in ("", "_semantic"))
    missing = [name + suffix for suffix, text in (("", urdf), ("_semantic", srdf)) if not text]
    if missing:
        raise RuntimeError("Unable to construct robot model. Please make sure all needed information is on the "
                           "parameter server: there is no %s. move_group brings them. %s"
                           % (" and no ".join(missing), how_to_start()))
    planning = rospy.get_param(name + "_planning", None) or {}
    try:
        model = _model(urdf, srdf, yaml.safe_dump(planning.get("joint_limits") or {}))
    except ValueError as error:
        raise RuntimeError("Unable to construct robot model from %s: %s" % (name, error)) from error
    return Description(model, rospy.get_param(name + "_kinematics", None) or {},
                       float(planning.get("default_velocity_scaling_factor", Description.velocity_scaling)),
                       float(planning.get("default_acceleration_scaling_factor", Description.acceleration_scaling)))
