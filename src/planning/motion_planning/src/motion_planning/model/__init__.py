# SPDX-License-Identifier: BSD-3-Clause
"""The model of the robot for planning: joint variables, limits, groups, forward kinematics of all links."""
from motion_planning.model.errors import ModelError
from motion_planning.model.group import Group
from motion_planning.model.meshes import MeshReader, MeshUnreadable
from motion_planning.model.planning_model import PlanningModel
from motion_planning.model.state import State
from motion_planning.srdf import EndEffector, VirtualJoint

__all__ = ["EndEffector", "Group", "MeshReader", "MeshUnreadable", "ModelError", "PlanningModel", "State",
           "VirtualJoint"]
