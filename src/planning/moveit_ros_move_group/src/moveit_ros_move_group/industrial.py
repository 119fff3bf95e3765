# SPDX-License-Identifier: BSD-3-Clause
"""Requests to the pipeline pilz_industrial_motion_planner."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import rospy
from geometry_msgs.msg import Quaternion
from moveit_msgs.msg import MoveItErrorCodes
from shape_msgs.msg import SolidPrimitive

from motion_planning import industrial, pipeline
from motion_planning.errors import PlanningError
from moveit_ros_move_group.context import RequestError
from moveit_ros_move_group.convert.constraints import constraint_set_of
from moveit_ros_move_group.convert.geometry import matrix_of

if TYPE_CHECKING:
    from moveit_msgs.msg import Constraints, MotionPlanRequest, MotionSequenceItem

    from motion_planning.industrial import Auxiliary, IndustrialCommand
    from motion_planning.pipeline import Plan, Tools
    from motion_planning.scene import Scene
    from moveit_ros_move_group.context import Context
    from moveit_ros_move_group.settings import Pipeline

# Radius of a position that was given without a region [m].
_POINT_M = 1e-4


class IndustrialPlanner:
    """PTP, LIN, CIRC and sequences of them. Calls may come from any thread."""

    def __init__(self, context: Context, description: str) -> None:
        """description: name of the robot's parameter, beside which its limits are."""
        self._context = context
        self._limits, self._complaints = industrial.CartesianLimits.from_mapping(
            rospy.get_param(description + "_planning/cartesian_limits", None))

    def plan(self, request: MotionPlanRequest, scene: Scene, pipe: Pipeline, tools: Tools) -> Plan:
        """Return a pipeline.Plan for a MotionPlanRequest. Raises PlanningError."""
        return industrial.plan(self._command(request, scene, pipe), tools, self._limits)

    def plan_sequence(self, items: Sequence[MotionSequenceItem], scene: Scene, pipes: Sequence[Pipeline],
                      tools: Tools) -> list[tuple[str, Plan]]:
        """Return [(group name, pipeline.Plan), ...] for MotionSequenceItems; pipes: a settings.Pipeline for each.

        Raises PlanningError.
        """
        commands = []
        for number, (item, pipe) in enumerate(zip(items, pipes, strict=True)):
            if number and item.req.start_state.joint_state.name:
                raise RequestError(MoveItErrorCodes.INVALID_ROBOT_STATE, "command %d of the sequence has a start "
                                   "state; it starts where command %d ends, so leave it empty" % (number + 1, number))
            commands.append(self._command(item.req, scene, pipe))
        return industrial.plan_sequence(commands, [item.blend_radius for item in items], tools, self._limits)

    def _command(self, request: MotionPlanRequest, scene: Scene, pipe: Pipeline) -> IndustrialCommand:
        """The industrial.Command of a MotionPlanRequest."""
        for text in self._complaints:
            rospy.logwarn("%s", text)
        self._complaints = []
        planner = request.planner_id or pipe.default_planner(request.group_name)
        reader = self._context.monitor.reader
        auxiliary = path_constraints = None
        remarks, of_goals = [], []
        try:
            if planner == "CIRC":
                auxiliary = self._auxiliary(request.path_constraints, scene)
            else:
                path_constraints = constraint_set_of(_with_regions(request.path_constraints), scene, reader, remarks)
            goals = [constraint_set_of(_with_regions(goal), scene, reader, of_goals)
                     for goal in request.goal_constraints]
        except PlanningError as error:
            raise RequestError(getattr(error, "code", MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS), str(error)) from None
        if of_goals:  # this planner leaves nothing out of a goal
            raise RequestError(MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS, "; ".join(of_goals))
        self._context.remark(planner, remarks, request.group_name)
        query = pipeline.PlanQuery(
            scene, request.group_name, [goal for goal in goals if goal is not None], path_constraints,
            planner_id=planner, velocity_scaling=request.max_velocity_scaling_factor,
            acceleration_scaling=request.max_acceleration_scaling_factor, start_bounds_error=pipe.start_bounds_error)
        start = request.start_state.joint_state
        speeds = dict(zip(start.name, start.velocity, strict=False))
        joints = self._context.group(request.group_name).joints
        return industrial.IndustrialCommand(query, auxiliary, [speeds.get(joint, 0.0) for joint in joints])

    def _auxiliary(self, message: Constraints, scene: Scene) -> Auxiliary | None:
        """The industrial.Auxiliary of CIRC's path constraints, None where there are none."""
        positions = message.position_constraints
        if not message.name and not positions:
            return None
        if len(positions) != 1 or not positions[0].constraint_region.primitive_poses:
            raise RequestError(MoveItErrorCodes.INVALID_MOTION_PLAN, "CIRC's path_constraints '%s' have %d position "
                               "constraints; expected one, whose constraint_region.primitive_poses[0] is the point"
                               % (message.name, len(positions)))
        frame = self._context.monitor.reader.frame(scene, positions[0].header.frame_id)
        pose = frame @ matrix_of(positions[0].constraint_region.primitive_poses[0], "the point '%s'" % message.name)
        return industrial.Auxiliary(message.name, pose[:3, 3])


def _with_regions(constraints: Constraints) -> Constraints:
    """The message, with a region around positions that are given by primitive_poses alone, and with quaternions of
    length 1, as this planner takes them."""
    for one in constraints.orientation_constraints:
        turn = np.array([one.orientation.x, one.orientation.y, one.orientation.z, one.orientation.w])
        length = float(np.linalg.norm(turn))
        if 0.0 < length < math.inf:
            one.orientation = Quaternion(*(turn / length).tolist())
    for position in constraints.position_constraints:
        region = position.constraint_region
        if not region.primitives:
            region.primitives = [SolidPrimitive(SolidPrimitive.SPHERE, [_POINT_M]) for _ in region.primitive_poses]
    return constraints
